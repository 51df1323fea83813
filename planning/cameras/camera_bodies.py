"""Cameras among each other's bodies: what they measure then, and whose light they take.

A camera's body may stand in a beam as well as in a view. Cameras whose bodies keep a
sample dark aren't taken: what is lit is what the number of cameras was proved for.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.proofs.conflicts import Interference, resolve_conflicts
from planning.scene.measuring.measured import LitSamples, measured_by, taken
from planning.scene.placed_bodies import blocked_by, bodies_of
from planning.scene.scene import Scene

from .camera_cover import CameraCover, candidate_cover


@dataclass(frozen=True, eq=False)
class CameraInterference(Interference):
    """Cameras, and the lit samples that each measures, were it alone."""

    devices: Sequence[PlannedCamera]
    scene: Scene
    projectors: tuple[PlannedProjector, ...]
    samples: LitSamples

    @classmethod
    def among(
        cls,
        scene: Scene,
        projectors: tuple[PlannedProjector, ...],
        samples: LitSamples,
        cameras: Sequence[PlannedCamera],
        measured: NDArray[np.bool_],
    ) -> Self:
        """Return cameras with what each measures, (n, m), among projectors."""
        points = samples.target.samples.points
        clearance = scene.requirements.workspace.clearance_m
        return cls(cameras, points, measured, clearance, scene, projectors, samples)

    def covers(
        self, standing: Sequence[int], columns: Sequence[int]
    ) -> NDArray[np.bool_]:
        """Return which samples candidates measure among the bodies of others."""
        measured = super().covers(standing, columns)
        chosen = [self.devices[i] for i in standing]
        scene = self.scene.among((*self.projectors, *chosen))
        lit = lit_among(self.projectors, self.samples, chosen)
        changed = np.flatnonzero((lit != self.samples.lit).any(axis=1))
        dimmed = taken(self.samples, changed, lit)
        for k, column in enumerate(columns):
            if column not in standing and self._shades[column]:
                measured[:, k] = False
            elif len(changed) and measured[:, k].any():
                device = self.devices[column]
                measured[changed, k] = measured_by(scene, [device], dimmed)[:, 0]
        return measured

    def stand_together(self, chosen: Sequence[int]) -> bool:
        """Return whether no bodies collide and all that is lit stays lit."""
        devices = [self.devices[i] for i in chosen]
        return super().stand_together(chosen) and not self._darkens(devices)

    @cached_property
    def _shades(self) -> NDArray[np.bool_]:
        """Whether each candidate alone keeps a sample dark."""
        return np.array(
            [
                device.body is not None
                and not device.existing
                and self._darkens([device])
                for device in self.devices
            ]
        )

    def _darkens(self, cameras: Sequence[PlannedCamera]) -> bool:
        lit = lit_among(self.projectors, self.samples, cameras)
        return not lit.any(axis=1).all()


def lit_among(
    projectors: Sequence[PlannedProjector],
    samples: LitSamples,
    cameras: Sequence[PlannedCamera],
) -> NDArray[np.bool_]:
    """Return which projector lights which sample past the bodies of planned cameras."""
    bodies = bodies_of(camera for camera in cameras if not camera.existing)
    lit = samples.lit.copy()
    for p, projector in enumerate(projectors):
        mine = np.flatnonzero(lit[:, p])
        points = samples.target.samples.points[mine]
        lit[mine[blocked_by(bodies, projector, points).any(axis=1)], p] = False
    return lit


def resolved_cover(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    cover: CameraCover,
) -> CameraCover:
    """Return a cover whose cameras are compatible, as `resolve_conflicts` says.

    Raises:
        InfeasibleLimitsError: If the body of every camera is in the way.
    """
    cameras, samples = cover.candidates.cameras, cover.samples
    interference = CameraInterference.among(
        scene, projectors, samples, cameras, cover.measured
    )
    problem = candidate_cover(scene, cover.measured, samples, cameras)
    selection = resolve_conflicts(interference, problem, cover.selection)
    if not len(selection.chosen):
        raise InfeasibleLimitsError(
            f"each of {len(cameras)} camera bodies collides, or keeps "
            f"something dark that the projectors light; make [camera.body] smaller, or "
            f"let cameras stand elsewhere"
        )
    return replace(cover, selection=selection, interference=interference)
