"""The margin at a share: how far within its limits the light is that counts.

Of the samples that are lit, as many count as are required; the rest is to spare. With
m_i the largest margin at sample i over the projectors that light it (minus infinity
where none does, `lighting.margins`), the margin at the share is the largest t with::

    |{i : m_i >= t}| >= required

Among covers of equally many projectors the one of largest t is taken: a cover of most
area often stands at the limit, where a little less area is lit a good deal better.
"""

import numpy as np
from numpy.typing import NDArray

from planning.proofs.selection import cover_problem
from solvers import solve_max_coverage

# Of an angle: closer than this no cover is looked for.
_STEP_RAD = float(np.radians(0.25))
# Lit beyond what is required, so that fresh samples don't fall short.
SPARE = 0.01
# Counted work of each cover, of which no proof is asked.
_BUDGET = 1e8


def margin_at_share(margin: NDArray[np.float64], required: int) -> float:
    """Return the margin that so many samples have at least, in [rad].

    Args:
        margin: Of each sample (row) and projector, -inf where unlit, shape (n, k).
        required: Samples that count, at least 1.

    Returns:
        Minus infinity where fewer are lit.
    """
    if required > len(margin):
        return -np.inf
    best = margin.max(axis=1, initial=-np.inf)
    return float(np.partition(best, len(best) - required)[len(best) - required])


def enough_lit(margin: NDArray[np.float64], required: int, before: int) -> bool:
    """Return whether so many are lit that fresh samples can be expected to confirm it.

    Args:
        margin: As for `margin_at_share`.
        required: Samples that count.
        before: Samples that were lit before the change that is judged.
    """
    lit = int(np.isfinite(margin).any(axis=1).sum())
    return lit >= min(before, int(np.ceil((1.0 + SPARE) * required)))


def widest_selection(
    margin: NDArray[np.float64],
    chosen: NDArray[np.int64],
    required: int,
    *,
    seed: int,
    n_existing: int = 0,
) -> NDArray[np.int64]:
    """Return as many candidates as chosen, with the largest margin at the share found.

    By steps that grow, then bisection: each cover program asks for most samples within
    a tighter limit.

    Args:
        margin: Of each sample and candidate, -inf where unlit, shape (n, m).
        chosen: Candidates that light what is required.
        required: Samples that count.
        seed: Of the search.
        n_existing: First candidates that are taken whatever they light.
    """
    lit_before = int(np.isfinite(margin[:, chosen]).any(axis=1).sum())
    best, low = chosen, margin_at_share(margin[:, chosen], required)
    high = margin_at_share(margin, required)
    step = 2.0 * _STEP_RAD
    while high - low > _STEP_RAD:
        level = min(0.5 * (low + high), low + step)
        problem = cover_problem(margin >= level, required, n_existing)
        selected = solve_max_coverage(
            problem, len(chosen), warm_start=best, seed=seed, budget=_BUDGET
        ).selected
        reached = margin_at_share(margin[:, selected], required)
        if reached >= level and enough_lit(margin[:, selected], required, lit_before):
            best, low, step = selected, reached, 2.0 * step
        else:
            high = level
    return best
