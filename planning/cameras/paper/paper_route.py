"""The paper's route to the cameras: the largest baselines first, their number follows.

1. Start: cameras on a ring, at the spacing of the closed forms (`camera_rings`), about
   several axes; the ring grows while rays say that too little is measured.
2. The baselines of neighbours are maximised, to the limit (10).
3. A camera whose loss the others make up for goes, or can once they have closed the
   hole to that limit. Again from 2, until none can go.

Source: Lee and Krim, 2014, section VI; `docs/method/baselines.md`, *The two routes*.
"""

from dataclasses import dataclass

from .one_fewer_camera import one_fewer, swept
from .route_problem import Cameras, CameraSet, RouteProblem
from .route_starts import one_more, rank, rank_without_one, starts

# Counts beyond the final one for which cameras are wanted.
_MORE = 2


@dataclass(frozen=True, eq=False)
class PaperRoute:
    """Where the route ended.

    Attributes:
        cameras: The cameras, and what they measure.
        by_count: Cameras for 1, 2, ... of them, on the way and beyond; those of the
            final count at their largest baselines.
        best_without_one: Most samples that one camera fewer was seen to measure.
    """

    cameras: CameraSet
    by_count: dict[int, Cameras]
    best_without_one: int


def paper_route(problem: RouteProblem) -> PaperRoute:
    """Plan cameras by the largest baselines alone; where short, as many as help."""
    by_count: dict[int, Cameras] = {}
    placed, best_without_one = _best_start(problem, by_count)
    while len(placed.cameras) > len(problem.fixed):
        widest = problem.widen(placed.cameras)
        placed = CameraSet(widest.cameras, widest.measured_by)
        by_count[len(placed.cameras)] = placed.cameras
        fewer = one_fewer(problem, placed, most=1)
        best_without_one = max(best_without_one, 0 if fewer is None else fewer.count)
        if fewer is None or fewer.count < problem.required:
            break
        placed, best_without_one = _fewest(problem, fewer, by_count)
        placed = swept(problem, placed)
    _fill(problem, placed, by_count)
    by_count.pop(0, None)
    return PaperRoute(placed, by_count, best_without_one)


def _best_start(
    problem: RouteProblem, by_count: dict[int, Cameras]
) -> tuple[CameraSet, int]:
    """What is left of the best ring, when none can go; and what one fewer measured.

    The ring that measures most isn't always the one that can spare a camera.
    """
    rings = starts(problem)
    most = min(rings, key=lambda ring: rank(problem, ring))
    spare = min(rings, key=lambda ring: rank_without_one(problem, ring))
    placed, without_one = _fewest(problem, most, by_count)
    if spare is not most:
        trail: dict[int, Cameras] = {}
        other, without_other = _fewest(problem, spare, trail)
        if rank(problem, other)[:2] < rank(problem, placed)[:2]:
            by_count.update(trail)
            placed, without_one = other, without_other
    return swept(problem, placed), without_one


def _fewest(
    problem: RouteProblem, placed: CameraSet, by_count: dict[int, Cameras]
) -> tuple[CameraSet, int]:
    """Let cameras go as long as one can; and what was measured without one more."""
    while True:
        by_count[len(placed.cameras)] = placed.cameras
        fewer = one_fewer(problem, placed)
        if fewer is None or fewer.count < problem.required:
            return placed, 0 if fewer is None else fewer.count
        placed = fewer


def _fill(
    problem: RouteProblem, placed: CameraSet, by_count: dict[int, Cameras]
) -> None:
    """Note cameras for every count up to some more than the final one."""
    fewer, n_fixed = placed, len(problem.fixed)
    while len(fewer.cameras) > max(1, n_fixed):
        fewer = fewer.without(fewer.least_missed(n_fixed)[0])
        by_count[len(fewer.cameras)] = fewer.cameras
    for _ in range(_MORE):
        more = one_more(problem, placed)
        if more is None:
            break
        placed = more
        by_count[len(placed.cameras)] = placed.cameras
