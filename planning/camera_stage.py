"""Cameras and ring axes together: each is best only given the other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .body_room import lacks_room
from .camera_bodies import lit_among, settled_cover
from .camera_spread import CameraSpread, spread_cameras
from .cameras import (
    CameraCover,
    CameraStage,
    LitSamples,
    camera_stage,
    lit_samples,
    measured_by,
    offered_cameras,
    plan_cameras,
)
from .plan import PlannedCamera, PlannedProjector
from .ring_axes import turn_ring_axes
from .scene import Scene
from .spread_problem import RingsOnTarget, SpreadLimits

_ROUNDS = 3
_SPREAD_ROWS = 6000
_STREAM = 300


@dataclass(frozen=True, eq=False)
class CameraSolution:
    """Cameras as placed, and the projectors with their ring axes turned for them.

    Attributes:
        projectors: With the ring axes that the cameras were chosen for.
        stage: Candidates, cover and certificate, for exactly these ring axes.
    """

    projectors: tuple[PlannedProjector, ...]
    stage: CameraStage


def place_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    template: PlannedCamera,
    n_candidates: int,
    tilt: float,
    *,
    spare_light: float = 0.0,
) -> CameraSolution:
    """Choose cameras, turn the ring axes for them, and choose again until it settles.

    A later round counts only if it needs no more cameras and measures no less, so the
    certificate always belongs to the ring axes that are kept.

    Args:
        scene: Surface and requirements.
        projectors: As planned.
        template: Optics of the camera.
        n_candidates: Poses offered.
        tilt: Tilt of the ring axes, or their shift.
        spare_light: Share of what is lit that bodies of cameras may keep dark.
    """
    kept = tuple(projectors)
    scene = scene.among(kept)
    offered = offered_cameras(scene, template, n_candidates)
    cover = plan_cameras(scene, kept, offered)
    best = settled_cover(scene, kept, cover, spare_light)
    for _ in range(_ROUNDS):
        turned = turn_ring_axes(scene, kept, best.cameras, best.rows, tilt)
        if all(a is b for a, b in zip(turned, kept, strict=True)):
            break
        cover = plan_cameras(scene, turned, offered)
        cover = settled_cover(scene, turned, cover, spare_light)
        if not _better(cover, best):
            break
        kept, best = turned, cover
    return CameraSolution(kept, camera_stage(scene, best))


def spread(
    scene: Scene, projectors: Sequence[PlannedProjector], stage: CameraStage
) -> CameraSpread:
    """Slide the cameras apart; no move that loses coverage is taken.

    Coverage is held on samples that the cover never saw: on its own rows, to which the
    cameras are fitted, a move seems to lose less than it does.

    Args:
        scene: Surface and requirements.
        projectors: As planned, with their rings.
        stage: Cameras from the cover.
    """
    required, scene = scene.requirements, scene.among(projectors)
    rows = lit_samples(scene, projectors, scene.target_samples(_SPREAD_ROWS, _STREAM))
    samples = rows.target.samples

    def measure(poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        moved = [
            replace(camera, world_from_device=pose)
            for camera, pose in zip(stage.cameras, poses, strict=True)
        ]
        return _measured_among(scene, tuple(projectors), moved, rows, spared)

    spared = int(lit_among(projectors, rows, stage.cameras).any(axis=1).sum())
    return spread_cameras(
        stage.cameras,
        measure,
        points=samples.points,
        normals=samples.normals,
        weights=samples.weight,
        limits=SpreadLimits(
            required.camera.max_incidence,
            required.triangulation.min_conditioning,
            scene.safe_workspace,
            required.triangulation.min_ring_pitch_px,
            required.triangulation.max_sigma_m,
        ),
        rings=RingsOnTarget(
            np.stack([rings.normals for rings in rows.rings]),
            np.stack([rings.spacing for rings in rows.rings]),
            np.stack(
                [
                    required.triangulation.noise_px
                    / np.maximum(light.incidence_cos, 1e-9)
                    for light in rows.lights
                ]
            ),
            rows.lit,
        ),
    )


def _measured_among(
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
    if all(camera.body is None or camera.existing for camera in cameras):
        return measured_by(scene, cameras, rows)
    among = scene.among((*projectors, *cameras))
    lit = lit_among(projectors, rows, cameras)
    fits = not any(lacks_room(among, camera) for camera in cameras)
    if not fits or lit.any(axis=1).sum() < spared:
        return np.zeros((len(rows.target), len(cameras)), dtype=bool)
    return measured_by(among, cameras, replace(rows, lit=lit))


def _better(new: CameraCover, old: CameraCover) -> bool:
    """Whether fewer cameras are needed, or as many measure more area."""
    if new.selection.needed != old.selection.needed:
        return new.selection.needed < old.selection.needed
    a, b = (
        cover.selection.best_rows * cover.rows.target.samples.weight
        for cover in (new, old)
    )
    return a > b
