"""What the paper's route stands on: lit samples, rays, and cameras as they stand."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.cameras.baselines.camera_spread import CameraSpread
from planning.cameras.baselines.limit_poses import Parts
from planning.cameras.baselines.seams import Adjacency, adjacency
from planning.cameras.baselines.spread_problem import SpreadLimits
from planning.model.planned import PlannedCamera

_Array = NDArray[np.float64]
_Measured = NDArray[np.bool_]
Cameras = tuple[PlannedCamera, ...]


@dataclass(frozen=True, eq=False)
class RouteProblem:
    """What the route stands on: samples, rays, and places to stand.

    Attributes:
        points: Lit samples in [m], shape (n, 3).
        normals: Unit face normals, shape (n, 3).
        measure: Which camera measures which sample, but for each other's bodies.
        together: The same with all their bodies in place; nothing where they don't fit.
        stand: Cameras in directions (k, 3) from the centre, where some may stand.
        slide: Slides cameras apart to the limit (10), losing nothing.
        device: Optics of a camera.
        ring_radius: Distance from the centre at which cameras are offered [m].
        limits: What binds a camera.
        required: Samples that must be measured.
        given: Cameras that stand already.
    """

    points: _Array
    normals: _Array
    measure: Callable[[Sequence[PlannedCamera]], _Measured]
    together: Callable[[Sequence[PlannedCamera]], _Measured]
    stand: Callable[[_Array], Cameras]
    slide: Callable[[Sequence[PlannedCamera]], CameraSpread]
    device: PinholeModel
    ring_radius: float
    limits: SpreadLimits
    required: int
    given: Cameras = ()

    @cached_property
    def adjacent(self) -> Adjacency:
        """Near samples of each."""
        return adjacency(self.points, self.normals)

    def parts(self, measured_by: _Measured) -> Parts:
        """Return the samples with what cameras measure of them."""
        return Parts(self.points, self.normals, self.adjacent, measured_by)


@dataclass(frozen=True, eq=False)
class CameraSet:
    """Cameras as they stand, given ones first.

    Attributes:
        cameras: The cameras.
        measured: Which measures which sample, shape (n, k).
    """

    cameras: Cameras
    measured: _Measured

    @property
    def rows(self) -> int:
        """Samples that any of them measures."""
        return int(self.measured.any(axis=1).sum())

    def least_missed(self, n_given: int) -> list[int]:
        """Return the cameras that may go, the one that measures least alone first.

        Args:
            n_given: First cameras, which stay.
        """
        alone = self.measured.sum(axis=1) == 1
        sole = self.measured[alone].sum(axis=0)
        order = [int(i) for i in np.argsort(sole, kind="stable")]
        return [i for i in order if i >= n_given]

    def without(self, camera: int) -> "CameraSet":
        """Return the others, as far as bodies don't count."""
        rest = [i for i in range(len(self.cameras)) if i != camera]
        return CameraSet(tuple(self.cameras[i] for i in rest), self.measured[:, rest])
