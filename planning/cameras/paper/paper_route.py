"""The paper's route to the cameras: baselines as large as (10) lets them be.

1. Start: of the cameras offered always the one that measures most of what none does.
2. A camera goes. Where its part was, (10) is violated; the others close the hole, their
   baselines out to d_max as far as that takes. Again, while they can, and until the
   bound over all poses says that no fewer are enough.
3. The baselines of those that are left are maximised.

Source: Lee and Krim, 2014, section VI; `docs/method/baselines.md`, *The two routes*.
"""

from dataclasses import dataclass

import numpy as np

from .hole_closing import one_fewer
from .route_problem import Cameras, CameraSet, RouteProblem

# Counts beyond the final one for which cameras are wanted.
_MORE = 2
# Cameras that are tried where bodies may be in each other's way.
_TRIED = 4


@dataclass(frozen=True, eq=False)
class PaperRoute:
    """Where the route ended.

    Attributes:
        cameras: The cameras, and what they measure.
        by_count: Cameras for 1, 2, ... of them, on the way and beyond; those of the
            final count at their largest baselines.
        best_without_one: Most samples that one camera fewer was seen to measure.
        bounded: Whether none was tried, since fewer can't be enough anywhere.
    """

    cameras: CameraSet
    by_count: dict[int, Cameras]
    best_without_one: int
    bounded: bool


def paper_route(problem: RouteProblem) -> PaperRoute:
    """Plan cameras by the largest baselines alone; where short, as many as help."""
    by_count: dict[int, Cameras] = {}
    placed, best_without_one, bounded = _grown(problem), 0, False
    while len(placed.cameras) > problem.n_fixed:
        count = len(placed.cameras)
        by_count[count] = placed.cameras
        bounded = not problem.short(placed) and problem.least(count) >= count
        if bounded:
            best_without_one = 0
            break
        fewer = one_fewer(problem, placed)
        best_without_one = 0 if fewer is None else fewer.count
        if fewer is None or problem.short(fewer) > problem.short(placed):
            break
        placed = fewer
    if len(placed.cameras) > problem.n_fixed:
        widest = problem.widen(placed.cameras)
        wide = CameraSet(widest.cameras, widest.measured_by)
        # As many samples, but perhaps fewer of a region.
        placed = wide if problem.short(wide) <= problem.short(placed) else placed
    by_count[len(placed.cameras)] = placed.cameras
    _fill(problem, placed, by_count)
    by_count.pop(0, None)
    return PaperRoute(placed, by_count, best_without_one, bounded)


def _grown(problem: RouteProblem) -> CameraSet:
    """The existing cameras with those that measure most of what isn't measured yet."""
    placed: CameraSet | None = problem.placed(problem.offered[: problem.n_fixed])
    grown = placed
    while grown is not None and problem.short(grown):
        placed, grown = grown, one_more(problem, grown)
    return grown or placed


def one_more(problem: RouteProblem, placed: CameraSet) -> CameraSet | None:
    """Return the set with the camera that measures most of what isn't measured yet."""
    wanted = problem.wanted(placed)
    if not wanted.any():
        wanted = ~placed.covered
    gain = problem.alone[wanted].sum(axis=0)
    for i in np.argsort(-gain, kind="stable")[:_TRIED]:
        more = problem.placed((*placed.cameras, problem.offered[int(i)]))
        if gain[i] and more.count > placed.count:
            return more
    return None


def _fill(
    problem: RouteProblem, placed: CameraSet, by_count: dict[int, Cameras]
) -> None:
    """Note cameras for every count up to some more than the final one."""
    fewer = placed
    while len(fewer.cameras) > max(1, problem.n_fixed):
        fewer = fewer.without(fewer.least_missed(problem.n_fixed)[0])
        by_count[len(fewer.cameras)] = fewer.cameras
    for _ in range(_MORE):
        more = one_more(problem, placed)
        if more is None:
            break
        placed = more
        by_count[len(placed.cameras)] = placed.cameras
