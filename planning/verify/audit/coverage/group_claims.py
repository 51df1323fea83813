"""Claims about which cameras' parts can be brought into one frame."""

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.ledger import Ledger
from planning.verify.audit.predicates.recompute import Recomputed

# Parts that share so much of the target can be registered with each other.
_OVERLAP = 0.01
_DEVIATIONS = 4.0


def audit_groups(
    plan: RigPlan, own: Recomputed, n_claimed: int, ledger: Ledger
) -> None:
    """Check camera_groups: a partition, linked by overlaps of 1 % of the target.

    Overlaps clearly above 1 % must not be torn apart; no group may need one that is
    clearly below. Between the two, sampling decides and both answers are honest.

    Args:
        plan: The plan.
        own: What its devices measure of the audit's samples.
        n_claimed: Samples behind the plan's claims.
        ledger: Takes the false claims.
    """
    key = "camera_groups"
    names = [camera.id for camera in plan.cameras]
    claimed = ledger.read(key)
    groups = _groups(claimed)
    listed = [name for group in groups for name in group]
    if not ledger.holds(
        sorted(listed) == sorted(names) and all(groups),
        key,
        f"{claimed!r} must name each of {', '.join(names)} exactly once",
    ):
        return
    shares, slack = _overlaps(own, n_claimed)
    places = [[names.index(name) for name in group] for group in groups]
    for group in places:
        for i in group:
            for j in set(range(len(names))) - set(group):
                ledger.holds(
                    j < i or shares[i, j] < _OVERLAP + slack[i, j],
                    key,
                    f"{names[i]} and {names[j]} stand in two groups, but share "
                    f"{100 * shares[i, j]:.2f} % of the target",
                )
        reached = _reached(shares + slack >= _OVERLAP, group)
        left = [names[i] for i in group if i not in reached]
        ledger.holds(
            not left,
            key,
            f"{', '.join(left)} stand in the group of {names[group[0]]}, but no "
            f"overlaps of 1 % of the target link them",
        )


def _groups(value: object) -> list[list[str]]:
    """The lists of names of a document; anything else makes an impossible group."""
    if not isinstance(value, list):
        return [[]]
    return [
        [str(name) for name in group] if isinstance(group, list) else []
        for group in value
    ]


def _overlaps(
    own: Recomputed, n_claimed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share of the target that each two cameras measure, and its tolerance."""
    part = own.measured_by[:, own.samples.in_target].astype(np.float64)
    n = part.shape[1]
    shared = part @ part.T
    p = (shared + 1.0) / (n + 2.0)
    error = np.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / max(n_claimed, 1)))
    return shared / n, _DEVIATIONS * error


def _reached(linked: NDArray[np.bool_], group: list[int]) -> set[int]:
    """Members of a group that links inside it connect with its first."""
    reached, fresh = {group[0]}, [group[0]]
    while fresh:
        at = fresh.pop()
        more = [j for j in group if linked[at, j] and j not in reached]
        reached.update(more)
        fresh += more
    return reached
