"""One camera fewer: which may go, and how the others take over the hole it leaves.

One program over all that may move, centres and aims, restores (10) at the hole
(`hole_program`). Rays decide: poses count that measure more; the samples that others
lost are in the next program.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.camera_moves import (
    Looks,
    at_poses,
    between,
    looks_of,
)
from planning.cameras.baselines.hole_program import HoleTerms

from .route_problem import CameraSet, RouteProblem

# Cameras that are dropped in turn, with a program each; of those the most promising,
# and programs for each of these.
_DROPPED, _PURSUED = 8, 3
_PROGRAMS = 12
# Sets that lack more than this share of what is required aren't promising.
_CLOSABLE = 0.25
# How far these move centres and aims, as a share of the largest radius of the shell.
_REACH, _SHRINK = 0.5, 0.4
_STEPS = (1.0, 0.5)
# Programs in a row that measure no more, until it is given up.
_FAILED = 6
# A program that measures less than this share of what is missing won't do in the rest.
_WORTH = 0.1


@dataclass(frozen=True, eq=False)
class Closing:
    """How far a hole is closed, and from where the next program goes on.

    Attributes:
        placed: The cameras.
        reach: How far they may move [m].
        lost: Samples that the program before lost.
        failed: Programs that measured no more.
    """

    placed: CameraSet
    reach: float
    lost: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    failed: int = 0

    @classmethod
    def of(cls, problem: RouteProblem, placed: CameraSet) -> "Closing":
        """Return what is begun with these cameras."""
        return cls(placed, _REACH * problem.limits.workspace.camera_radius_m[1])


def one_fewer(problem: RouteProblem, placed: CameraSet) -> CameraSet | None:
    """Return the best of one camera fewer, the hole closed; None where none may go."""
    free = placed.least_missed(problem.n_fixed)
    fewer = [placed.without(i) for i in free[: _DROPPED - 1]]
    if fewer and fewer[0].cameras:
        best = problem.best(len(fewer[0].cameras)).tolist()
        fewer.insert(0, problem.placed([problem.offered[i] for i in best]))
    begun = [Closing.of(problem, one) for one in fewer]
    tried: list[Closing] = []
    for programs, most in ((1, _DROPPED), (_PROGRAMS, _PURSUED)):
        for i, one in enumerate(begun[:most]):
            begun[i] = closed(problem, one, programs)
            if not problem.short(begun[i].placed):
                return begun[i].placed
        tried = sorted(
            begun[:most] or tried,
            key=lambda one: (problem.short(one.placed), -one.placed.count),
        )
        least = _CLOSABLE * problem.quotas.total
        begun = [one for one in tried if problem.short(one.placed) <= least]
    return tried[0].placed if tried else None


def closed(problem: RouteProblem, begun: Closing, programs: int) -> Closing:
    """Move cameras over the hole until enough is measured, or too little helps.

    Programs that failed before are counted, and not solved again.
    """
    placed, reach, lost, failed = begun.placed, begun.reach, begun.lost, begun.failed
    movable = len(placed.cameras) > problem.n_fixed
    for _ in range(programs - failed if movable else 0):
        short = problem.short(placed)
        if not short:
            break
        moved, lost = _taken_over(problem, placed, lost, reach)
        if moved is placed:
            failed, reach = failed + 1, _SHRINK * reach
            if failed == _FAILED:
                break
        else:
            worth = short - problem.short(moved) >= _WORTH * short
            placed, lost = moved, lost[:0]
            if not worth:
                break
    return Closing(placed, reach, lost, failed)


def _taken_over(
    problem: RouteProblem, placed: CameraSet, lost: NDArray[np.int64], reach: float
) -> tuple[CameraSet, NDArray[np.int64]]:
    """Return the cameras that a program moved, or as they stand; and what it lost."""
    # CasADi is imported where it is used.
    from solvers.poses.baseline_program import solve_baseline

    space = problem.limits.workspace
    now = looks_of(placed.cameras, placed.measured, problem.surface.points, space)
    terms = HoleTerms(
        placed.cameras,
        placed.measured,
        problem.surface,
        problem.wanted(placed),
        problem.limits,
        problem.rings,
    )
    solution = solve_baseline(terms.problem(now, lost, reach))
    for share in _STEPS if solution.status.has_point else ():
        then = Looks(solution.aims, now.ups, solution.rolls)
        poses = between(placed.cameras, now, solution.centres, then, share, space)
        if poses is None:
            continue
        moved = problem.placed(at_poses(placed.cameras, poses))
        if problem.short(moved) < problem.short(placed):
            return moved, lost
        lost = np.union1d(lost, np.flatnonzero(placed.covered & ~moved.covered))
    return placed, lost
