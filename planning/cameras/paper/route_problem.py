"""What the paper's route is taken on: lit samples, rays, and sets of cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.baseline_limits import BaselineLimits, RingsOnSurface
from planning.cameras.baselines.seams import SampledSurface
from planning.cameras.baselines.widest_baselines import WidestBaselines
from planning.model.devices.planned import PlannedCamera
from planning.proofs.quotas import Quotas

_Measured = NDArray[np.bool_]
Cameras = tuple[PlannedCamera, ...]


@dataclass(frozen=True, eq=False)
class RouteProblem:
    """Samples, rays, and where cameras may stand.

    Attributes:
        surface: Lit samples.
        limits: What binds a camera.
        offered: Cameras to begin with, existing ones first.
        alone: Which of them measures which sample, but for each other's bodies, (n, m).
        together: Which camera measures which sample with all their bodies in place,
            (n, k); nothing where they don't fit.
        widen: Maximises the baselines of cameras to the limit (10), losing nothing.
        quotas: What must be measured, of all samples and of regions.
        best: As many of the offered cameras that measure most, as far as counted work
            goes; their indices.
        least: Of a number of cameras that are enough, how many are needed at least,
            wherever they stand.
        n_fixed: Existing cameras.
        rings: Rings of each projector on the samples; None: no rings.
    """

    surface: SampledSurface
    limits: BaselineLimits
    offered: Cameras
    alone: _Measured
    together: Callable[[Sequence[PlannedCamera]], _Measured]
    widen: Callable[[Sequence[PlannedCamera]], WidestBaselines]
    quotas: Quotas
    best: Callable[[int], NDArray[np.int64]]
    least: Callable[[int], int]
    n_fixed: int = 0
    rings: RingsOnSurface | None = None

    def placed(self, cameras: Sequence[PlannedCamera]) -> "CameraSet":
        """Return cameras with what they measure among each other's bodies."""
        return CameraSet(tuple(cameras), self.together(cameras))

    def short(self, placed: "CameraSet") -> int:
        """Return how many samples more must be measured; 0: enough are."""
        return self.quotas.lacking(placed.covered)

    def wanted(self, placed: "CameraSet") -> _Measured:
        """Return which samples would bring it nearer to enough, shape (n,)."""
        missed = self.alone.any(axis=1) & ~placed.covered
        return missed & self.quotas.wanted(placed.covered)


@dataclass(frozen=True, eq=False)
class CameraSet:
    """Cameras, existing ones first, and which measures which sample, shape (n, k)."""

    cameras: Cameras
    measured: _Measured

    @property
    def covered(self) -> _Measured:
        """Which samples any of them measures, shape (n,)."""
        return np.asarray(self.measured.any(axis=1))

    @property
    def count(self) -> int:
        """Samples that any of them measures."""
        return int(self.covered.sum())

    def least_missed(self, n_fixed: int) -> list[int]:
        """Return the cameras that may go, the one that measures least alone first."""
        alone = self.measured.sum(axis=1) == 1
        sole = self.measured[alone].sum(axis=0)
        order = [int(i) for i in np.argsort(sole, kind="stable")]
        return [i for i in order if i >= n_fixed]

    def without(self, camera: int) -> "CameraSet":
        """Return the others, as far as bodies don't count."""
        others = [i for i in range(len(self.cameras)) if i != camera]
        return CameraSet(
            tuple(self.cameras[i] for i in others), self.measured[:, others]
        )
