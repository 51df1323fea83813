"""Claims about which cameras' parts can be brought into one frame."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import share_error

# Parts that share so much of the target can be registered with each other.
_OVERLAP = 0.01
_DEVIATIONS = 4.0


def audit_groups(case: AuditCase, findings: AuditFindings) -> None:
    """Check camera_groups: a partition, linked by overlaps of 1 % of the target.

    Overlaps clearly above 1 % must not be torn apart; no group may need one that is
    clearly below. Between the two, sampling decides and both answers are honest.
    """
    claimed = case.plan.document.camera_groups
    measured = case.actual.measured_by[:, case.samples.in_target]
    names = [camera.id for camera in case.plan.cameras]
    audit_partition(claimed, names, measured, case.estimator.n_claimed, findings)


def audit_partition(
    groups: tuple[tuple[str, ...], ...],
    names: list[str],
    measured: NDArray[np.bool_],
    n_claimed: int,
    findings: AuditFindings,
) -> None:
    """Check groups of cameras against what each measures of n samples, (n_c, n).

    Args:
        groups: As claimed.
        names: Of the cameras.
        measured: Whether each camera measures each sample of the target.
        n_claimed: Samples behind the plan's claims.
        findings: Takes the false claims.
    """
    key = "camera_groups"
    if not findings.holds(
        sorted(name for group in groups for name in group) == sorted(names)
        and all(groups),
        key,
        f"{groups!r} must name each of {', '.join(names)} exactly once",
    ):
        return
    shares, slack = _overlaps(measured, n_claimed)
    group_of = {name: g for g, group in enumerate(groups) for name in group}
    number = np.array([group_of[name] for name in names])
    apart = number[:, None] != number
    for i, j in np.argwhere(np.triu(apart & (shares >= _OVERLAP + slack))):
        findings.fail(
            key,
            f"{names[i]} and {names[j]} stand in two groups, but share "
            f"{100 * shares[i, j]:.2f} % of the target",
        )
    _, linked = connected_components((shares + slack >= _OVERLAP) & ~apart)
    for group in groups:
        first = linked[names.index(group[0])]
        alone = [name for name in group if linked[names.index(name)] != first]
        findings.holds(
            not alone,
            key,
            f"{', '.join(alone)} stand in the group of {group[0]}, but no overlaps of "
            f"1 % of the target link them",
        )


def _overlaps(
    measured: NDArray[np.bool_], n_claimed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share of the target that each two cameras measure, and its tolerance."""
    n = measured.shape[1]
    shared = measured.astype(np.float64) @ measured.T
    return shared / n, _DEVIATIONS * share_error(shared, n, n_claimed)
