"""The paper's route to the cameras: the largest baselines first, their number follows.

1. Seed: cameras on a ring, at the pitch of the closed forms (`ring_seeds`), about
   several axes; the seed grows while rays say that too little is measured.
2. Neighbours slide apart to the limit (10).
3. A camera whose loss the rest can bear goes, or can once they have closed the gap to
   that limit. Again from 2, until none can go.

Source: Lee and Krim, 2014, section VI; `docs/method/baselines.md`, *The two routes*.
"""

from dataclasses import dataclass

from .paper_moves import one_fewer, swept
from .paper_seeds import one_more, rank, rank_by_spare, seeds
from .route_problem import Cameras, CameraSet, RouteProblem

# Counts beyond the final one for which cameras are wanted.
_MORE = 2


@dataclass(frozen=True, eq=False)
class PaperRoute:
    """Where the route ended.

    Attributes:
        stand: The cameras, and what they measure.
        by_count: Cameras for 1, 2, ... of them, on the way and beyond; those of the
            final count slid apart.
        met: Whether they measure what is required.
        best_without_one: Most samples that one camera fewer was found to measure.
    """

    stand: CameraSet
    by_count: dict[int, Cameras]
    met: bool
    best_without_one: int


def paper_route(ground: RouteProblem) -> PaperRoute:
    """Plan cameras by the largest baselines alone.

    Args:
        ground: Samples, rays and limits.

    Returns:
        Cameras that measure the required samples; as many as could be found where
        nothing more helps.
    """
    by_count: dict[int, Cameras] = {}
    stand, best_without_one = _best_start(ground, by_count)
    while len(stand.cameras) > len(ground.given):
        slid = ground.slide(stand.cameras)
        stand = CameraSet(slid.cameras, slid.measured_by)
        by_count[len(stand.cameras)] = stand.cameras
        fewer = one_fewer(ground, stand, most=1)
        best_without_one = max(best_without_one, 0 if fewer is None else fewer.rows)
        if fewer is None or fewer.rows < ground.required:
            break
        stand, best_without_one = _fewest(ground, fewer, by_count)
        stand = swept(ground, stand)
    _fill(ground, stand, by_count)
    by_count.pop(0, None)
    met = stand.rows >= ground.required
    return PaperRoute(stand, by_count, met, best_without_one)


def _best_start(
    ground: RouteProblem, by_count: dict[int, Cameras]
) -> tuple[CameraSet, int]:
    """What is left of the best ring, when none can go; and what one fewer measured.

    The ring that measures most isn't always the one that can spare a camera.
    """
    offered = seeds(ground)
    most = min(offered, key=lambda seed: rank(ground, seed))
    spare = min(offered, key=lambda seed: rank_by_spare(ground, seed))
    found, trail = _fewest(ground, most, by_count), {}
    if spare is not most:
        other = _fewest(ground, spare, trail)
        if rank(ground, other[0])[:2] < rank(ground, found[0])[:2]:
            by_count.update(trail)
            found = other
    return swept(ground, found[0]), found[1]


def _fewest(
    ground: RouteProblem, stand: CameraSet, by_count: dict[int, Cameras]
) -> tuple[CameraSet, int]:
    """Let cameras go as long as one can; and what was measured without one more."""
    while True:
        by_count[len(stand.cameras)] = stand.cameras
        fewer = one_fewer(ground, stand)
        if fewer is None or fewer.rows < ground.required:
            return stand, 0 if fewer is None else fewer.rows
        stand = fewer


def _fill(ground: RouteProblem, stand: CameraSet, by_count: dict[int, Cameras]) -> None:
    """Note cameras for every count up to some more than the final one."""
    fewer = stand
    while len(fewer.cameras) > max(1, len(ground.given)):
        fewer = fewer.without(fewer.least_missed(len(ground.given))[0])
        by_count[len(fewer.cameras)] = fewer.cameras
    for _ in range(_MORE):
        more = one_more(ground, stand)
        if more is None:
            break
        stand = more
        by_count[len(stand.cameras)] = stand.cameras
