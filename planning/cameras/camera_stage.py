"""Cameras and ring axes together: each is best only given the other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.certificates import CamerasBy, Certificate, RouteCounts
from planning.model.document.ring_records import AxisTaken
from planning.proofs.selection import Selection
from planning.rings.axis_moves import move_ring_axes
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.scene import Scene

from .camera_cover import CameraCover
from .camera_routes import better_route, cover_again, cover_for
from .proved_cameras import CameraStage, camera_stage

_ROUNDS = 3
# Share of the measured area for which other cameras aren't worth larger errors.
_SPARE = 0.002


@dataclass(frozen=True, eq=False)
class CameraSolution:
    """Cameras, and the projectors with the ring axes that they were proved for."""

    projectors: tuple[PlannedProjector, ...]
    stage: CameraStage
    axes: AxisTaken | None = "free"


def place_cameras(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    candidates: CandidateViews,
    by: CamerasBy = "both",
    axes: AxisTaken | None = "free",
) -> CameraSolution:
    """Choose cameras, move free ring axes for them, and see which route is better."""
    cover = cover_axes(scene, projectors, candidates, by, axes)
    return by_better_route(scene, cover, by)


@dataclass(frozen=True, eq=False)
class AxesCover:
    """A cover, and the projectors with the ring axes that it was solved for."""

    projectors: tuple[PlannedProjector, ...]
    cover: CameraCover
    axes: AxisTaken | None


def cover_axes(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    candidates: CandidateViews,
    by: CamerasBy,
    axes: AxisTaken | None,
) -> AxesCover:
    """Choose cameras, and move free ring axes for them."""
    cover = cover_for(scene, projectors, candidates, by)
    if axes == "free":
        projectors, cover = move_axes(scene, projectors, cover, by)
    return AxesCover(projectors, cover, axes)


def by_better_route(scene: Scene, chosen: AxesCover, by: CamerasBy) -> CameraSolution:
    """Return the cameras of the cover, or of the paper's route if these are better."""
    cover, routes, rival = better_route(scene, chosen.projectors, chosen.cover, by)
    stage = replace(camera_stage(scene, cover, routes), rival=rival)
    return CameraSolution(chosen.projectors, stage, chosen.axes)


def move_axes(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    cover: CameraCover,
    by: CamerasBy = "cover",
) -> tuple[tuple[PlannedProjector, ...], CameraCover]:
    """Move the ring axes to where errors are smallest, and choose cameras again.

    The cameras stay, for which the axes were moved, unless others measure notably more;
    then the axes move for these. All stays as it was where more cameras would be needed
    or less is measured.
    """
    kept = projectors
    for _ in range(_ROUNDS):
        among = scene.among((*kept, *cover.cameras))
        moved = move_ring_axes(among, kept, cover.cameras, cover.samples)
        if not _differ(moved, kept):
            break
        again = cover_again(scene, moved, cover, by)
        if _rank(cover) > _rank(again):
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
    if cover.interference is not None and cover.has_bodies:
        each = chosen.tolist()
        measured = cover.interference.covers(each, each)
    count = int(measured.any(axis=1).sum())
    least = min(selection.required, selection.n_covered)
    least = max(least, int(np.ceil((1.0 - _SPARE) * selection.n_covered)))
    if (floors := selection.floors) is not None:
        kept = floors.as_far_as(np.any(cover.measured[:, selection.chosen], axis=1))
        if not kept.enough(np.any(measured, axis=1)):
            return None
    if len(chosen) != len(selection.chosen) or count < least:
        return None
    return replace(cover, selection=replace(selection, chosen=chosen, n_covered=count))


def follow_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    stage: CameraStage,
    by: CamerasBy = "both",
) -> CameraSolution:
    """Move the ring axes for cameras that have left the candidates' poses.

    What was proved of the number of cameras holds for one set of ring axes, so it is
    proved again; axes under which it no longer is this number, or less is proved, are
    dropped.
    """
    among = scene.among((*projectors, *cameras))
    moved = move_ring_axes(among, projectors, cameras, stage.cover.samples)
    if _differ(moved, projectors):
        scene = scene.among(projectors)
        cover = cover_again(scene, moved, stage.cover, by)
        if proves_as_much(cover.selection, stage.certificate, len(cameras)):
            # Other axes may need another count than the routes did.
            as_told = cover.selection.needed == stage.certificate.needed.count
            as_told &= _may_follow(cover.selection, stage.routes)
            proved = camera_stage(scene, cover, stage.routes if as_told else None)
            return CameraSolution(moved, proved)
    return CameraSolution(tuple(projectors), stage)


def _may_follow(new: Selection, routes: RouteCounts | None) -> bool:
    """Return whether what routes need is told of a selection, too.

    One more than they need may have come in for fresh samples; that many may be the
    fewest for the axes as they are now, and the routes were of others.
    """
    if routes is None:
        return True
    counts = {"cover": routes.cover, "paper": routes.paper}
    least = min((n for n in counts.values() if n is not None), default=new.needed)
    taken = counts[routes.taken]
    told = taken is None or new.needed == taken or new.status == "feasible"
    return told and min(new.lower_bound, new.needed) <= least


def proves_as_much(new: Selection, old: Certificate, count: int) -> bool:
    """Return whether a selection takes so many cameras, met and bounded no worse."""
    taken = len(new.chosen)
    return (
        taken == count
        and new.status in (old.status, "optimal")
        and min(new.lower_bound, taken) >= old.candidates.lower_bound
    )


def _differ(a: Sequence[PlannedProjector], b: Sequence[PlannedProjector]) -> bool:
    return any(new is not old for new, old in zip(a, b, strict=True))


def _rank(cover: CameraCover) -> tuple[int, float]:
    """Larger where fewer cameras are needed, or as many measure more area."""
    selection, weight = cover.selection, cover.samples.target.samples.weight
    return -selection.needed, selection.n_covered * weight
