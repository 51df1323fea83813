"""The least by which one limit must give way, from what samples ask of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.proofs.selection import cover_problem
from planning.scene.limits.limit import LimitRelaxation
from solvers import solve_max_coverage

# Less isn't worth telling.
_GAIN = 0.01
# Counted work of each cover, of which no proof is asked.
_BUDGET = 1e8


@dataclass(frozen=True, eq=False)
class Share:
    """How much of n samples is reached now, and how much must be.

    Attributes:
        n: Samples.
        reached: Those that some pose reaches.
        least: Share that must be.
    """

    n: int
    reached: int
    least: float

    @property
    def wanted(self) -> int:
        """Samples to gain."""
        return int(np.ceil(self.least * self.n - 1e-9)) - self.reached

    def gains(self, gained: dict[str, int]) -> list[dict[str, Any]]:
        """Return the changes that gain at least a percentage point, least first."""
        entries = [
            {"change": change, "reachable_share": (self.reached + gain) / self.n}
            for change, gain in gained.items()
            if gain >= _GAIN * self.n
        ]
        return sorted(entries, key=lambda entry: entry["reachable_share"])


def least_changes(
    relaxations: Sequence[LimitRelaxation], asked: NDArray[np.float64], wanted: int
) -> dict[str, int]:
    """Return how far each limit alone must give way, and how many samples that gains.

    As far as is wanted, or where that can't be had, as far as it helps.

    Args:
        relaxations: Limits that may give way.
        asked: The least that samples out of reach ask of each, (n_relaxations, n).
        wanted: Samples to gain.
    """
    changes: dict[str, int] = {}
    for relaxation, asks in zip(relaxations, asked, strict=True):
        helped = np.sort(asks[np.isfinite(asks)])
        if helped.size and wanted > 0:
            last = min(wanted, helped.size) - 1
            value = float(relaxation.rounded(helped[last]))
            changes[relaxation.say(value)] = int((asks <= value).sum())
    return changes


def covers_enough(
    covered: NDArray[np.bool_],
    required: int,
    count: int,
    *,
    n_existing: int,
    seed: int,
) -> bool:
    """Return whether so many candidates cover as many samples as are required.

    Args:
        covered: Which candidate covers which sample, shape (n, m).
        required: Samples.
        count: Candidates.
        n_existing: First ones, which are taken whatever they cover.
        seed: Of the search.
    """
    problem = cover_problem(covered, required, n_existing)
    best = solve_max_coverage(problem, count, seed=seed, budget=_BUDGET).selected
    return bool(covered[:, best].any(axis=1).sum() >= required)
