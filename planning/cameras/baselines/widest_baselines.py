"""Moves neighbouring cameras to the largest baselines that coverage allows.

`solvers.poses.baseline_program` proposes by eqs. (9)-(10); rays decide: a move counts
only if as much is measured as before, and the parts stay registered. Samples that a
proposal lost are demanded of the next one; steps are halved where that doesn't help.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.device_poses import poses_of
from planning.model.devices.planned import PlannedCamera
from solvers.poses.baseline_problem import smallest_baseline

from .baseline_limits import BaselineLimits, RingsOnSurface
from .baseline_terms import BaselineTerms
from .camera_moves import at_poses, between, centres_between, looks_of
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


@dataclass(eq=False)
class BaselineSearch:
    """Raises the smallest baseline of neighbouring cameras without losing coverage.

    A move is taken iff as many samples are measured as at the start, `confirm` agrees,
    the overlap graph falls into no more groups, and the smallest baseline of neighbours
    rises, or their mean does while the smallest stays.

    Attributes:
        cameras: As chosen; each keeps the point that it looks at, and its roll.
        measure: Maps poses (k, 4, 4) to which camera measures which sample, (n, k), by
            rays and every limit of the plan.
        surface: The samples.
        limits: What binds a camera.
        rings: Rings of each projector on the samples; None: no rings.
        confirm: Whether at poses no fewer of more samples are measured than at the
            start, on which no proposal rests: of many moves, those pass that samples
            happen to favour.
        max_evaluations: Calls of `measure` at most.
        max_programs: Programs solved at most.
    """

    cameras: Sequence[PlannedCamera]
    measure: Measure
    surface: SampledSurface
    limits: BaselineLimits
    rings: RingsOnSurface | None = None
    confirm: Confirm | None = None
    max_evaluations: int = 48
    max_programs: float = np.inf

    def __post_init__(self) -> None:
        self._spent = self._solved = 0
        self._poses = poses_of(self.cameras)
        self._measured = self._evaluate(self._poses)
        self._floor = _count(self._measured)
        space = self.limits.workspace
        self._looks = looks_of(
            self.cameras,
            self._measured,
            self.surface.points,
            space,
            np.array(space.up),
        )
        self._pairs = neighbouring_pairs(self._measured, self.surface)
        self._groups = len(overlap_components(self._measured))

    def run(self) -> WidestBaselines:
        """Return the cameras where no further move is taken, or the budget is spent."""
        before = self._smallest()
        radius = self.limits.workspace.camera_radius_m[1]
        reach = _REACH * radius
        movable = bool(self._pairs) and not all(c.existing for c in self.cameras)
        while movable and self._affords() and reach >= _MIN_REACH * radius:
            taken, proposed = self._improve(reach)
            if not taken:
                reach = _SHRINK * min(reach, proposed)
        return WidestBaselines(
            tuple(at_poses(self.cameras, self._poses)),
            self._measured,
            before,
            self._smallest(),
        )

    def _affords(self) -> bool:
        return self._spent < self.max_evaluations and self._solved < self.max_programs

    def _improve(self, reach: float) -> tuple[bool, float]:
        """Whether a proposal within reach was taken, whole or in part; its reach."""
        # CasADi is imported where it is used.
        from solvers.poses.baseline_program import solve_baseline

        demanded = np.zeros((0, 2), dtype=np.int64)
        proposals: list[_Array] = []
        for _ in range(_REPEATS):
            if not self._affords():
                break
            self._solved += 1
            terms = BaselineTerms(
                at_poses(self.cameras, self._poses),
                self._measured,
                self.surface,
                self.limits,
                self.rings,
            )
            solution = solve_baseline(
                terms.problem(self._looks, self._pairs, demanded, reach)
            )
            if not (solution.status.has_point and self._gains(solution.centres)):
                break
            proposals.append(solution.centres)
            whole = self._between(solution.centres, np.ones(len(solution.centres)))
            taken, lost = self._attempt(whole)
            if taken:
                return True, reach
            n_known, lost = len(demanded), terms.holders(lost, solution.centres)
            demanded = np.unique(np.concatenate([demanded, lost]), axis=0)
            if len(demanded) == n_known:
                break
        # The first is the boldest, the last loses least: part of either may do.
        ends = proposals[-1:] + proposals[:-1][:1]
        moves = [np.linalg.norm(c - self._poses[:, :3, 3], axis=1).max() for c in ends]
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
        if self._spent >= self.max_evaluations:
            return False, none
        cameras, space = at_poses(self.cameras, self._poses), self.limits.workspace
        poses = between(cameras, self._looks, centres, self._looks, 1.0, space)
        if poses is None or not self._gains(poses[:, :3, 3]):
            return False, none
        centres = poses[:, :3, 3]
        measured = self._evaluate(poses)
        lost = np.flatnonzero(self._measured.any(axis=1) & ~measured.any(axis=1))
        if _count(measured) < self._floor:
            return False, lost
        pairs = sorted({*self._pairs, *neighbouring_pairs(measured, self.surface)})
        index = np.array(pairs, dtype=np.int64)
        held = smallest_baseline(centres, index) >= smallest_baseline(
            self._poses[:, :3, 3], index
        )
        if not held or len(overlap_components(measured)) > self._groups:
            return False, none
        if self.confirm is not None and not self.confirm(poses):
            return False, none
        self._poses, self._measured, self._pairs = poses, measured, pairs
        return True, none

    def _between(self, centres: _Array, share: _Array) -> _Array:
        start = self._poses[:, :3, 3]
        return centres_between(start, centres, share, self.limits.workspace)

    def _lengths(self, centres: _Array) -> _Array:
        """Baselines of neighbours at other centres in [m], one for each pair."""
        index = np.array(self._pairs, dtype=np.int64)
        return np.linalg.norm(centres[index[:, 0]] - centres[index[:, 1]], axis=1)

    def _gains(self, centres: _Array) -> bool:
        old, new = (self._lengths(c) for c in (self._poses[:, :3, 3], centres))
        if new.min() >= old.min() * (1.0 + _GAIN):
            return True
        return bool(new.min() >= old.min() and new.mean() >= old.mean() * (1.0 + _GAIN))

    def _by_baseline(self) -> list[int]:
        """Cameras, those of the shortest baselines first."""
        order = np.argsort(self._lengths(self._poses[:, :3, 3]), kind="stable")
        return list(dict.fromkeys(c for i in order for c in self._pairs[i]))

    def _evaluate(self, poses: _Array) -> NDArray[np.bool_]:
        self._spent += 1
        return self.measure(poses)

    def _smallest(self) -> float | None:
        if not self._pairs:
            return None
        return float(self._lengths(self._poses[:, :3, 3]).min())


def _count(measured: NDArray[np.bool_]) -> int:
    return int(measured.any(axis=1).sum())
