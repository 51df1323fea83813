"""Moves neighbouring cameras to the largest baselines that coverage allows.

`solvers.poses.baseline_program` proposes by eqs. (9)-(10); rays decide: a move counts
only if as much is measured as before, and the parts stay registered. Samples that a
proposal lost are demanded of the next one; steps are halved where that doesn't help.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.poses import look_at
from planning.model.planned import PlannedCamera
from planning.scene.workspace.admissible import admissible
from solvers.poses.baseline_problem import BaselineProblem, smallest_baseline

from .baseline_limits import BaselineLimits, RingsOnSurface
from .baseline_terms import lost_samples, state_baselines
from .camera_moves import aims_and_rolls, at_poses, centres_between, poses_of
from .seams import SampledSurface, neighbouring_pairs, overlap_components

_Array = NDArray[np.float64]
Measure = Callable[[_Array], NDArray[np.bool_]]
Confirm = Callable[[_Array], bool]

_STEPS = (1.0, 0.5, 0.25)
# Reach of the first proposals, as a share of the largest radius of the shell.
_REACH = 0.4
_MIN_REACH = 0.02
_SHRINK = 0.4
# Proposals from one state, each knowing what the one before lost.
_REPEATS = 4
# Gains below this share of a baseline aren't worth an evaluation.
_GAIN = 1e-2
# Programs end on a limit to their own rounding.
_SLACK = 1e-7


@dataclass(frozen=True, eq=False)
class WidestBaselines:
    """Cameras moved to larger baselines.

    Attributes:
        cameras: As moved.
        measured_by: Which camera measures which sample there, shape (n, k).
        smallest_before_m: Smallest baseline of neighbours before; None without any.
        smallest_after_m: The same after, over all pairs that were neighbours before or
            are now.
    """

    cameras: tuple[PlannedCamera, ...]
    measured_by: NDArray[np.bool_]
    smallest_before_m: float | None
    smallest_after_m: float | None


def maximise_baselines(
    cameras: Sequence[PlannedCamera],
    measure: Measure,
    surface: SampledSurface,
    limits: BaselineLimits,
    *,
    rings: RingsOnSurface | None = None,
    confirm: Confirm | None = None,
    max_evaluations: int = 48,
    max_programs: float = np.inf,
) -> WidestBaselines:
    """Raise the smallest baseline of neighbouring cameras without losing coverage.

    A move is taken iff as many samples are measured as at the start, `confirm` agrees,
    the overlap graph falls into no more groups, and the smallest baseline of neighbours
    rises, or their mean does while the smallest stays.

    `measure` maps poses (k, 4, 4) to which camera measures which sample, (n, k), by
    rays and every limit of the plan. `confirm` says whether at poses no fewer of more
    samples are measured than at the start, on which no proposal rests: of many moves,
    those pass that samples happen to favour.
    """
    search = _Search(cameras, measure, surface, limits, rings, confirm)
    return search.run(max_evaluations, max_programs)


class _Search:
    """The state of one search: poses, what they measure, and the budget."""

    def __init__(
        self,
        cameras: Sequence[PlannedCamera],
        measure: Measure,
        surface: SampledSurface,
        limits: BaselineLimits,
        rings: RingsOnSurface | None,
        confirm: Confirm | None,
    ) -> None:
        self.cameras, self.surface, self.limits = cameras, surface, limits
        self._measure, self._rings, self._confirm = measure, rings, confirm
        self.spent = self.solved = 0
        self.poses = poses_of(cameras)
        self.measured = self._evaluate(self.poses)
        self._floor = _count(self.measured)
        self.aims, self.rolls = aims_and_rolls(
            cameras, self.measured, surface.points, limits.workspace
        )
        self.pairs = neighbouring_pairs(self.measured, surface)
        self._groups = len(overlap_components(self.measured))
        self._free = np.array([not camera.existing for camera in cameras])

    def run(self, max_evaluations: int, max_programs: float) -> WidestBaselines:
        self._evaluations, self._programs = max_evaluations, max_programs
        before = self._smallest()
        radius = self.limits.workspace.camera_radius_m[1]
        reach = _REACH * radius
        movable = bool(self.pairs) and bool(self._free.any())
        while movable and self._affords() and reach >= _MIN_REACH * radius:
            taken, proposed = self._improve(reach)
            if not taken:
                reach = _SHRINK * min(reach, proposed)
        return WidestBaselines(
            tuple(at_poses(self.cameras, self.poses)),
            self.measured,
            before,
            self._smallest(),
        )

    def _affords(self) -> bool:
        return self.spent < self._evaluations and self.solved < self._programs

    def _improve(self, reach: float) -> tuple[bool, float]:
        """Whether a proposal within reach was taken, whole or in part; its reach."""
        # CasADi is imported where it is used.
        from solvers.poses.baseline_program import solve_baseline

        demanded = np.zeros((0, 2), dtype=np.int64)
        proposals: list[_Array] = []
        for _ in range(_REPEATS):
            if not self._affords():
                break
            self.solved += 1
            solution = solve_baseline(self._stated(demanded, reach))
            if not (solution.status.has_point and self._gains(solution.centres)):
                break
            proposals.append(solution.centres)
            whole = self._between(solution.centres, np.ones(len(solution.centres)))
            taken, lost = self._attempt(whole)
            if taken:
                return True, reach
            lost = lost_samples(lost, solution.centres, self.measured, self.surface)
            known, demanded = (
                demanded,
                np.unique(np.concatenate([demanded, lost]), axis=0),
            )
            if len(demanded) == len(known):
                break
        # The first is the boldest, the last loses least: part of either may do.
        ends = proposals[-1:] + proposals[:-1][:1]
        moves = [np.linalg.norm(c - self.poses[:, :3, 3], axis=1).max() for c in ends]
        taken = any(self._step_back(centres) for centres in ends)
        return taken, float(max(moves, default=0.0))

    def _step_back(self, centres: _Array) -> bool:
        """Try part of the way for all, then for one camera at a time."""
        k = len(centres)
        alone = [np.eye(k)[c] for c in self._by_baseline()]
        shares = [np.full(k, step) for step in _STEPS[1:]]
        shares += [step * one for one in alone for step in _STEPS]
        for share in shares:
            part = self._between(centres, share)
            if self._gains(part) and self._attempt(part)[0]:
                return True
        return False

    def _attempt(self, centres: _Array) -> tuple[bool, NDArray[np.int64]]:
        """Take a move if rays allow it; else which samples it loses."""
        none = np.zeros(0, dtype=np.int64)
        if self.spent >= self._evaluations or not self._admissible(centres):
            return False, none
        up = np.array(self.limits.workspace.up)
        poses = np.stack(
            [
                look_at(centre, aim, up, roll=float(roll))
                for centre, aim, roll in zip(
                    centres, self.aims, self.rolls, strict=True
                )
            ]
        )
        poses[~self._free] = self.poses[~self._free]
        measured = self._evaluate(poses)
        lost = np.flatnonzero(self.measured.any(axis=1) & ~measured.any(axis=1))
        if _count(measured) < self._floor:
            return False, lost
        pairs = sorted({*self.pairs, *neighbouring_pairs(measured, self.surface)})
        index = np.array(pairs, dtype=np.int64)
        held = smallest_baseline(centres, index) >= smallest_baseline(
            self.poses[:, :3, 3], index
        )
        if not held or len(overlap_components(measured)) > self._groups:
            return False, none
        if self._confirm is not None and not self._confirm(poses):
            return False, none
        self.poses, self.measured, self.pairs = poses, measured, pairs
        return True, none

    def _stated(self, demanded: NDArray[np.int64], reach: float) -> BaselineProblem:
        return state_baselines(
            at_poses(self.cameras, self.poses),
            self.aims,
            self.measured,
            self.pairs,
            self.surface,
            self._rings,
            self.limits,
            demanded=demanded,
            max_step=reach,
        )

    def _between(self, centres: _Array, share: _Array) -> _Array:
        start = self.poses[:, :3, 3]
        return centres_between(start, centres, share, self.limits.workspace)

    def _lengths(self, centres: _Array) -> _Array:
        """Baselines of neighbours at other centres in [m], one for each pair."""
        index = np.array(self.pairs, dtype=np.int64)
        return np.linalg.norm(centres[index[:, 0]] - centres[index[:, 1]], axis=1)

    def _gains(self, centres: _Array) -> bool:
        old, new = (self._lengths(c) for c in (self.poses[:, :3, 3], centres))
        if new.min() >= old.min() * (1.0 + _GAIN):
            return True
        return bool(new.min() >= old.min() and new.mean() >= old.mean() * (1.0 + _GAIN))

    def _admissible(self, centres: _Array) -> bool:
        space = self.limits.workspace
        offsets = centres[self._free] - np.array(space.centre)
        radius = space.camera_radius_m
        return bool(np.all(admissible(space, radius, offsets, slack=_SLACK)))

    def _by_baseline(self) -> list[int]:
        """Cameras, those of the shortest baselines first."""
        order = np.argsort(self._lengths(self.poses[:, :3, 3]), kind="stable")
        return list(dict.fromkeys(c for i in order for c in self.pairs[i]))

    def _evaluate(self, poses: _Array) -> NDArray[np.bool_]:
        self.spent += 1
        return self._measure(poses)

    def _smallest(self) -> float | None:
        if not self.pairs:
            return None
        return float(self._lengths(self.poses[:, :3, 3]).min())


def _count(measured: NDArray[np.bool_]) -> int:
    return int(measured.any(axis=1).sum())
