"""Cameras and ring axes together: each is best only given the other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .axis_moves import move_ring_axes
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
from .selection import Selection
from .sights import Sights
from .spread_problem import RingsOnTarget, SpreadLimits
from .standing import moves_bodies

_ROUNDS = 3
_SPREAD_ROWS = 6000
_STREAM = 300
# Share of the measured area for which other cameras aren't worth larger errors.
_SPARE = 0.002


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
) -> CameraSolution:
    """Choose cameras and ring axes: azimuths of one tilt first, then any axis.

    Args:
        scene: Surface and requirements.
        projectors: As planned.
        template: Optics of the camera.
        n_candidates: Poses offered.
        tilt: Tilt of the ring axes, or their shift, to search azimuths of.
    """
    scene = scene.among(projectors)
    offered = offered_cameras(scene, template, n_candidates)
    turned, cover = choose_cameras(scene, projectors, offered, tilt)
    moved, cover = move_axes(scene, turned, cover)
    return CameraSolution(moved, camera_stage(scene, cover))


def choose_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    offered: Sights,
    tilt: float,
) -> tuple[tuple[PlannedProjector, ...], CameraCover]:
    """Choose cameras, turn the ring axes for them, and choose again until it settles.

    A later round counts only if it needs no more cameras and measures no less, so the
    certificate always belongs to the ring axes that are kept.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned.
        offered: Candidates, from `offered_cameras`.
        tilt: Tilt of the ring axes, or their shift.
    """
    kept = tuple(projectors)
    best = _cover(scene, kept, offered)
    for _ in range(_ROUNDS):
        turned = turn_ring_axes(scene, kept, best.cameras, best.rows, tilt)
        if not _differ(turned, kept):
            break
        cover = _cover(scene, turned, offered)
        if not _better(cover, best):
            break
        kept, best = turned, cover
    return kept, best


def move_axes(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cover: CameraCover,
) -> tuple[tuple[PlannedProjector, ...], CameraCover]:
    """Move the ring axes to where errors are smallest, and choose cameras again.

    The cameras stay, for which the axes were moved, unless others measure notably more;
    then the axes move for these. All stays as it was where more cameras would be needed
    or less is measured.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned.
        cover: Cameras chosen for these ring axes.
    """
    kept = tuple(projectors)
    for _ in range(_ROUNDS):
        among = scene.among((*kept, *cover.cameras))
        moved = move_ring_axes(among, kept, cover.cameras, cover.rows)
        if not _differ(moved, kept):
            break
        again = _cover(scene, moved, cover.offered)
        if _better(cover, again):
            break
        as_chosen = with_cameras(again, cover)
        if as_chosen is not None:
            return moved, as_chosen
        kept, cover = moved, again
    return kept, cover


def with_cameras(cover: CameraCover, before: CameraCover) -> CameraCover | None:
    """Return a cover with the cameras of one before; None where that loses too much."""
    selection, chosen = cover.selection, before.selection.chosen
    measured = cover.measured[:, chosen]
    if cover.crowd is not None and cover.crowd.bodied:
        each = chosen.tolist()
        measured = cover.crowd.covers(each, each)
    rows = int(measured.any(axis=1).sum())
    least = min(selection.required, selection.best_rows)
    least = max(least, int(np.ceil((1.0 - _SPARE) * selection.best_rows)))
    if len(chosen) != len(selection.chosen) or rows < least:
        return None
    return replace(cover, selection=replace(selection, chosen=chosen, best_rows=rows))


def follow_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    stage: CameraStage,
) -> CameraSolution:
    """Move the ring axes for cameras that have left the candidates' poses.

    What was proved of the number of cameras holds for one set of ring axes, so it is
    proved again; axes under which it no longer is this number, or less is proved, are
    dropped.

    Args:
        scene: Surface and requirements.
        projectors: As planned, with even rings.
        cameras: As they stand.
        stage: Of these projectors; as many cameras as these.
    """
    among = scene.among((*projectors, *cameras))
    moved = move_ring_axes(among, projectors, cameras, stage.rows)
    if _differ(moved, projectors):
        scene = scene.among(projectors)
        cover = _cover(scene, moved, stage.offered)
        if proves_as_much(cover.selection, stage.certificate, len(cameras)):
            return CameraSolution(moved, camera_stage(scene, cover))
    return CameraSolution(tuple(projectors), stage)


def proves_as_much(new: Selection, old: dict[str, Any], count: int) -> bool:
    """Return whether a selection takes so many cameras, met and bounded no worse.

    Args:
        new: Selection under other ring axes.
        old: Certificate under those before.
        count: Cameras that stand.
    """
    taken = len(new.chosen)
    return (
        taken == count
        and new.status in (old["status"], "optimal")
        and min(new.lower_bound, taken) >= old["candidates"]["lower_bound"]
    )


def spread(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    stage: CameraStage,
    *,
    spare_field: float = 0.0,
) -> CameraSpread:
    """Slide the cameras apart; no move that loses coverage is taken.

    Coverage is held on samples that the cover never saw: on its own rows, to which the
    cameras are fitted, a move seems to lose less than it does.

    Args:
        scene: Surface and requirements.
        projectors: As planned, with their rings.
        stage: Cameras from the cover.
        spare_field: What is kept free of the half fields beyond seams [rad].
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
            spare_field,
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


def _cover(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    offered: Sights,
) -> CameraCover:
    """The fewest cameras for these ring axes, that bear each other's bodies."""
    cover = plan_cameras(scene, projectors, offered)
    return settled_cover(scene, projectors, cover)


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
    if not moves_bodies(cameras):
        return measured_by(scene, cameras, rows)
    among = scene.among((*projectors, *cameras))
    lit = lit_among(projectors, rows, cameras)
    fits = not any(lacks_room(among, camera) for camera in cameras)
    if not fits or lit.any(axis=1).sum() < spared:
        return np.zeros((len(rows.target), len(cameras)), dtype=bool)
    return measured_by(among, cameras, replace(rows, lit=lit))


def _differ(a: Sequence[PlannedProjector], b: Sequence[PlannedProjector]) -> bool:
    return any(new is not old for new, old in zip(a, b, strict=True))


def _better(new: CameraCover, old: CameraCover) -> bool:
    """Whether fewer cameras are needed, or as many measure more area."""
    if new.selection.needed != old.selection.needed:
        return new.selection.needed < old.selection.needed
    a, b = (
        cover.selection.best_rows * cover.rows.target.samples.weight
        for cover in (new, old)
    )
    return a > b
