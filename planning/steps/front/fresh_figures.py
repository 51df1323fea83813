"""What rigs of a front do to samples that none was chosen on."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs.quotas import RegionFloors
from planning.report.claims.reach import furthest_lit, measured_by_any
from planning.report.entries.device_entries import rounded_camera, rounded_projector
from planning.scene.draws import DRAWS, Draw
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.camera_views import CameraView, camera_views
from planning.scene.measuring.measured import LitSamples, lit_samples, pairs_of
from planning.scene.scene import Scene

from .choices import Choice
from .front_matrix import FrontMatrix

_Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Figures:
    """What becomes of fresh samples under one rig, shape (n,) each.

    `sigma` is that of the best pair [m], infinite where none measures.
    """

    lit: _Mask
    sigma: NDArray[np.float64]
    by_cameras: _Mask

    @property
    def measured(self) -> _Mask:
        """Whether any pair measures."""
        return np.isfinite(self.sigma)


class FreshFigures:
    """Judges rigs from rounded poses; devices in several rigs are looked at once."""

    def __init__(self, matrix: FrontMatrix) -> None:
        self._matrix, self._scene = matrix, matrix.scene
        self.target = self._scene.target_samples(DRAWS.front)
        # By the device as chosen, which is kept so that its identity stays its own.
        self._lights: dict[PlannedProjector, tuple[LitSamples, _Mask]] = {}
        self._views: dict[PlannedCamera, CameraView] = {}
        self._sigma: dict[
            tuple[PlannedProjector, PlannedCamera], NDArray[np.float64]
        ] = {}
        self._reached: dict[tuple[PlannedProjector, ...], _Mask] = {}

    def look_with(self, cameras: Iterable[PlannedCamera]) -> None:
        """Look at the samples with cameras, all in one go."""
        unknown = [c for c in dict.fromkeys(cameras) if c not in self._views]
        if unknown:
            rounded = [rounded_camera(camera, "") for camera in unknown]
            views = camera_views(self._scene, rounded, self.target)
            self._views.update(zip(unknown, views, strict=True))

    def of(self, choice: Choice) -> Figures:
        """Return what becomes of the samples under a rig."""
        self.look_with(choice.cameras)
        lit = np.any([self._lit(p)[1] for p in choice.projectors], axis=0)
        pairs = [self._pair(p, c) for p in choice.projectors for c in choice.cameras]
        sigma = np.min(pairs, axis=0)
        reached = self._reachable(choice, np.isfinite(sigma))
        return Figures(lit, sigma, reached | np.isfinite(sigma))

    def by_projectors(self, lit: _Mask) -> _Mask:
        """Return which samples are lit, or some candidate lights, shape (n,)."""
        reached, dark = lit.copy(), self.target.take(~lit)
        furthest = furthest_lit(self._scene, self._matrix.candidates.projectors, dark)
        reached[~lit] = furthest == LIT
        return reached

    def regions(self, scene: Scene) -> RegionFloors:
        """Return which sample is of which region that has a floor in a scene."""
        return RegionFloors.of(scene, self.target)

    def _lit(self, projector: PlannedProjector) -> tuple[LitSamples, _Mask]:
        if projector not in self._lights:
            rounded = [rounded_projector(projector, "")]
            lit = lit_stages(self._scene, rounded, self.target) == LIT
            samples = LitSamples.of(rounded, self.target, lit)
            self._lights[projector] = samples, lit[:, 0]
        return self._lights[projector]

    def _pair(
        self, projector: PlannedProjector, camera: PlannedCamera
    ) -> NDArray[np.float64]:
        key = projector, camera
        if key not in self._sigma:
            samples, sight = self._lit(projector)[0], self._views[camera]
            sigma = np.full(len(self.target), np.inf)
            _lower(sigma, self._scene, samples, sight)
            self._sigma[key] = sigma
        return self._sigma[key]

    def _reachable(self, choice: Choice, measured: _Mask) -> _Mask:
        """Which samples are lit, and measured by some candidate camera."""
        lights = choice.projectors
        if lights not in self._reached:
            each = [self._lit(p) for p in lights]
            lit = np.stack([mask for _, mask in each], axis=1)
            pending = np.flatnonzero(lit.any(axis=1) & ~measured)
            rounded = [rounded_projector(p, "") for p in lights]
            samples = LitSamples.of(rounded, self.target.take(pending), lit[pending])
            reached = measured.copy()
            reached[pending] = measured_by_any(
                self._scene, self._matrix.cameras, samples
            )
            self._reached[lights] = reached
        return self._reached[lights]


def best_sigma(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    draw: Draw,
) -> NDArray[np.float64]:
    """Return the deviation of each lit sample's best pair [m], infinite for none."""
    among = scene.among((*projectors, *cameras))
    lit = lit_samples(among, projectors, scene.target_samples(draw))
    sigma = np.full(len(lit.target), np.inf)
    for sight in camera_views(among, cameras, lit.target):
        _lower(sigma, scene, lit, sight)
    return sigma


def _lower(
    sigma: NDArray[np.float64], scene: Scene, lit: LitSamples, sight: CameraView
) -> None:
    """Lower deviations to those of one camera's pairs, where they are less."""
    limits = scene.requirements.triangulation
    for pair in pairs_of(limits, lit, sight.view, samples=sight.samples):
        rows = pair.samples[pair.measured]
        sigma[rows] = np.minimum(sigma[rows], pair.quality.total[pair.measured])
