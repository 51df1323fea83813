"""Small covers whose best selections are known, and their certificates."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from planning.model.proofs import CoverProof
from planning.proofs.selection import cover_problem
from solvers.covers.cover import reduced_problem
from solvers.covers.exact.exclusion import excluded
from solvers.status import WorkBudget


def random_cover(seed: int, n: int = 40, m: int = 16) -> NDArray[np.bool_]:
    """Return a cover in which rows of some sets are of others, too, (n, m)."""
    rng = np.random.default_rng(seed)
    covers = rng.random((n, m)) < 0.25
    covers[:, 1] = covers[:, 0] & (rng.random(n) < 0.7)
    covers[0] = False
    return covers


def best_of(covers: NDArray[np.bool_], n_sets: int) -> int:
    """Return how many rows so many sets cover at most, all selections looked at."""
    return max(
        int(covers[:, list(chosen)].any(axis=1).sum())
        for chosen in combinations(range(covers.shape[1]), n_sets)
    )


def certificate(
    covers: NDArray[np.bool_], n_sets: int, required: int, budget: float = 1e9
) -> CoverProof | None:
    """Return why so many sets are too few; None where they aren't."""
    reduced = reduced_problem(cover_problem(covers, required))
    found = excluded(covers, reduced, n_sets, required, WorkBudget(budget))
    if found is None:
        return None
    n = len(covers)
    samples = np.array([[n, 1, 1]]), np.zeros((n, 3)), np.zeros(n, dtype=np.int64)
    return CoverProof(*samples, **vars(found))
