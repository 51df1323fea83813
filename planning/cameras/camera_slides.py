"""Slides a plan's cameras apart: rays, bodies and rings for `camera_spread`."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.camera_spread import CameraSpread, spread_cameras
from planning.cameras.baselines.spread_problem import (
    RingsOnTarget,
    SpreadLimits,
    at_poses,
)
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.scene.clearance import lacks_clearance
from planning.scene.measured import LitSamples, lit_samples, measured_by
from planning.scene.scene import Scene
from planning.scene.standing import moves_bodies

from .camera_bodies import lit_among
from .camera_cover import CameraStage

_ROWS = 6000
_STREAM = 300
# Samples that confirm a move which those did not forbid.
_MORE = 16_000
# What candidates reach is the measure of all claims: cameras may measure this share of
# it more, no further. Where candidates reach nearly all that is lit none can.
_STRAY, _NEARLY = 0.002, 0.97


def rows_to_slide_on(
    scene: Scene, projectors: Sequence[PlannedProjector]
) -> LitSamples:
    """Return lit samples that no cover ever saw.

    On a cover's own rows, to which its cameras are fitted, a move seems to lose less
    than it does.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned, with their rings.
    """
    return lit_samples(scene, projectors, scene.target_samples(_ROWS, _STREAM))


def slide_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    rows: LitSamples,
    *,
    max_evaluations: int = 48,
    max_programs: int | None = None,
    spare_field: float = 0.0,
    confirmed: bool = False,
    reached: NDArray[np.bool_] | None = None,
) -> CameraSpread:
    """Slide cameras apart; no move that loses coverage on the rows is taken.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned, with their rings.
        cameras: As they stand.
        rows: Samples on which coverage is held.
        max_evaluations: Times that coverage is evaluated, at most.
        max_programs: Baseline programs at most; None: no limit of their own.
        spare_field: What is kept free of the half fields beyond seams [rad].
        confirmed: Whether more samples than the rows must agree to each move.
        reached: Rows that any candidate measures, shape (n,); None: any may be.
    """
    samples = rows.target.samples

    def measure(poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        moved = at_poses(cameras, poses)
        found = measured_among(scene, tuple(projectors), moved, rows, spared)
        return found if reached is None else _no_stray(found, reached)

    spared = int(lit_among(projectors, rows, cameras).any(axis=1).sum())
    more = _More(scene, tuple(projectors), tuple(cameras)) if confirmed else None
    return spread_cameras(
        cameras,
        measure,
        points=samples.points,
        normals=samples.normals,
        weights=samples.weight,
        limits=spread_limits(scene, spare_field),
        confirm=None if more is None else more.measured,
        rings=rings_on(scene, rows),
        max_evaluations=max_evaluations,
        max_programs=max_programs,
    )


def reached_by_candidates(
    scene: Scene, stage: CameraStage, rows: LitSamples
) -> NDArray[np.bool_] | None:
    """Return which rows any candidate measures, (n,); None where they reach nearly all.

    Args:
        scene: With the bodies of the projectors.
        stage: The candidates, and what they measure of the cover's rows.
        rows: Lit samples.
    """
    lit = stage.rows.lit.any(axis=1)
    if stage.measured[lit].any(axis=1).mean() >= _NEARLY:
        return None
    return np.asarray(measured_by(scene, stage.reference, rows).any(axis=1))


def _no_stray(
    found: NDArray[np.bool_], reached: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return what is measured; nothing where cameras reach what no candidate does."""
    beyond = np.count_nonzero(found.any(axis=1) & ~reached)
    if beyond > _STRAY * np.count_nonzero(reached):
        return np.zeros_like(found)
    return found


class _More:
    """Further samples of the target; they are drawn when they are first asked for."""

    def __init__(
        self,
        scene: Scene,
        projectors: tuple[PlannedProjector, ...],
        cameras: tuple[PlannedCamera, ...],
    ) -> None:
        self._scene, self._projectors, self._cameras = scene, projectors, cameras

    def measured(self, poses: NDArray[np.float64]) -> float:
        """Return how many of them cameras at these poses measure."""
        moved = at_poses(self._cameras, poses)
        rows, spared = self._drawn
        found = measured_among(self._scene, self._projectors, moved, rows, spared)
        return float(found.any(axis=1).sum())

    @cached_property
    def _drawn(self) -> tuple[LitSamples, int]:
        target = self._scene.target_samples(_MORE, _STREAM + 1)
        rows = lit_samples(self._scene, self._projectors, target)
        lit = lit_among(self._projectors, rows, self._cameras)
        return rows, int(lit.any(axis=1).sum())


def spread_limits(scene: Scene, spare_field: float = 0.0) -> SpreadLimits:
    """Return what binds a camera that slides; `spare_field` as for `slide_cameras`."""
    required = scene.requirements
    return SpreadLimits(
        required.camera.max_incidence,
        required.triangulation.min_conditioning,
        scene.safe_workspace,
        required.triangulation.min_ring_pitch_px,
        required.triangulation.max_sigma_m,
        spare_field,
    )


def rings_on(scene: Scene, rows: LitSamples) -> RingsOnTarget:
    """Return the rings of every projector on samples."""
    noise = scene.requirements.triangulation.noise_px
    return RingsOnTarget(
        np.stack([rings.normals for rings in rows.rings]),
        np.stack([rings.spacing for rings in rows.rings]),
        np.stack(
            [noise / np.maximum(light.incidence_cos, 1e-9) for light in rows.lights]
        ),
        rows.lit,
    )


def measured_among(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    cameras: Sequence[PlannedCamera],
    rows: LitSamples,
    spared: int,
) -> NDArray[np.bool_]:
    """Return which camera measures which sample; none where their bodies don't fit.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned.
        cameras: As they are to stand.
        rows: Samples lit, were there no cameras.
        spared: How many must stay lit.
    """
    if not moves_bodies(cameras):
        return measured_by(scene, cameras, rows)
    among = scene.among((*projectors, *cameras))
    lit = lit_among(projectors, rows, cameras)
    fits = not any(lacks_clearance(among, camera) for camera in cameras)
    if not fits or lit.any(axis=1).sum() < spared:
        return np.zeros((len(rows.target), len(cameras)), dtype=bool)
    return measured_by(among, cameras, replace(rows, lit=lit))
