"""What the paper's route is taken on: lit samples, rays, and sets of cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.cameras.baselines.baseline_limits import BaselineLimits
from planning.cameras.baselines.seams import SampledSurface
from planning.cameras.baselines.widest_baselines import WidestBaselines
from planning.model.planned import PlannedCamera

_Array = NDArray[np.float64]
_Measured = NDArray[np.bool_]
Cameras = tuple[PlannedCamera, ...]


@dataclass(frozen=True, eq=False)
class RouteProblem:
    """Samples, rays, and where cameras may stand.

    Attributes:
        surface: Lit samples.
        measure: Which camera measures which sample, but for each other's bodies.
        together: The same with all their bodies in place; nothing where they don't fit.
        stand: Cameras in directions (k, 3) from the centre, where they may stand.
        widen: Maximises the baselines of cameras to the limit (10), losing nothing.
        device: Optics of a camera.
        ring_radius: Distance from the centre at which cameras stand [m].
        limits: What binds a camera.
        required: Samples that must be measured.
        fixed: Existing cameras.
    """

    surface: SampledSurface
    measure: Callable[[Sequence[PlannedCamera]], _Measured]
    together: Callable[[Sequence[PlannedCamera]], _Measured]
    stand: Callable[[_Array], Cameras]
    widen: Callable[[Sequence[PlannedCamera]], WidestBaselines]
    device: PinholeModel
    ring_radius: float
    limits: BaselineLimits
    required: int
    fixed: Cameras = ()

    def placed(self, cameras: Sequence[PlannedCamera]) -> "CameraSet":
        """Return cameras with what they measure among each other's bodies."""
        return CameraSet(tuple(cameras), self.together(cameras))


@dataclass(frozen=True, eq=False)
class CameraSet:
    """Cameras, existing ones first, and which measures which sample, shape (n, k)."""

    cameras: Cameras
    measured: _Measured

    @property
    def count(self) -> int:
        """Samples that any of them measures."""
        return int(self.measured.any(axis=1).sum())

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
