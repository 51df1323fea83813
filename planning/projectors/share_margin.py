"""The margin at a share: how far within its limits the light is that counts.

Of the samples that are lit, as many count as are required; the rest is to spare. With
m_i the largest margin at sample i over the projectors that light it (minus infinity
where none does, `lighting.margins`), the margin at the share is the largest t with::

    |{i : m_i >= t}| >= required

Among covers of equally many projectors the one of largest t is taken: a cover of most
area often stands at the limit, where a little less area is lit a good deal better.

The pose program moves one projector at a time and stays near where it starts. A cover
of the most margin stands between the poses of a lattice, several of them moved at once;
so poses around the chosen ones are offered, from less and less far.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.proofs.device_stock import DeviceStock
from planning.proofs.quotas import Quotas
from planning.proofs.selection import cover_problem
from planning.scene.placed_bodies import movable
from planning.scene.scene import Scene
from planning.scene.workspace.model_candidates import one_of_each
from solvers import solve_max_coverage

from .candidate_set import CandidateSource

# Of an angle: closer than this no cover is looked for.
_STEP_RAD = float(np.radians(0.25))
# Lit beyond what is required, so that fresh samples don't fall short.
_SPARE = 0.01
# Counted work of each cover, of which no proof is asked.
_BUDGET = 1e8
# How far out poses between are offered, in spacings of the lattice.
_SCALES = (1.0, 0.5, 0.25)


def margin_at_share(margin: NDArray[np.float64], required: int) -> float:
    """Return the margin that so many samples have at least, in [rad].

    Margins of each sample (row) and projector are -inf where unlit, and so is the
    answer where fewer are lit; where none is required it is inf.
    """
    if required <= 0:
        return np.inf
    if required > len(margin):
        return -np.inf
    best = margin.max(axis=1, initial=-np.inf)
    return float(np.partition(best, len(best) - required)[len(best) - required])


def to_keep(margin: NDArray[np.float64], quotas: Quotas) -> Quotas:
    """Return what must stay lit so that fresh samples should confirm the quotas.

    That is some to spare of all, and the floors, as far as the margins are of so many.
    """
    spared = replace(quotas, total=int(np.ceil((1.0 + _SPARE) * quotas.total)))
    return spared.as_far_as(lit_by_any(margin))


def lit_by_any(margin: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples are lit, by their margins, shape (n,)."""
    return np.any(np.isfinite(margin), axis=1)


def widest_selection(
    margin: NDArray[np.float64],
    chosen: NDArray[np.int64],
    quotas: Quotas,
    *,
    seed: int,
    n_existing: int = 0,
    stock: DeviceStock | None = None,
) -> NDArray[np.int64]:
    """Return as many candidates as chosen, with the largest margin at the share found.

    By steps that grow, then bisection: each cover program asks for most samples within
    a tighter limit.
    """
    kept, required = to_keep(margin[:, chosen], quotas), quotas.total
    best, low = chosen, margin_at_share(margin[:, chosen], required)
    high = margin_at_share(margin, required)
    step = 2.0 * _STEP_RAD
    while high - low > _STEP_RAD:
        level = min(0.5 * (low + high), low + step)
        problem = cover_problem(margin >= level, quotas, n_existing, stock)
        selected = solve_max_coverage(
            problem, len(chosen), warm_start=best, seed=seed, budget=_BUDGET
        ).selected
        reached = margin_at_share(margin[:, selected], required)
        if reached >= level and kept.enough(lit_by_any(margin[:, selected])):
            best, low, step = selected, reached, 2.0 * step
        else:
            high = level
    return best


def widest_between(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    margins: Callable[[tuple[PlannedProjector, ...]], NDArray[np.float64]],
    quotas: Quotas,
    n_lattice: int,
) -> tuple[PlannedProjector, ...]:
    """Return as many projectors at poses of larger margin, where there are any."""
    n_existing = len(projectors) - len(movable(projectors))
    margin, counts = margins(projectors), scene.requirements.stock_of("projector")
    source = CandidateSource(scene, one_of_each(reversed(projectors)))
    for scale in _SCALES:
        between = source.around(projectors, n_lattice, scale)
        if not between:
            break
        margin = np.concatenate([margin, margins(between)], axis=1)
        candidates = (*projectors, *between)
        chosen = widest_selection(
            margin,
            np.arange(len(projectors)),
            quotas,
            seed=scene.seed,
            n_existing=n_existing,
            stock=DeviceStock.of(candidates, counts),
        )
        projectors = tuple(candidates[i] for i in chosen)
        margin = margin[:, chosen]
    return projectors
