"""Where ring axes stand: in the middle of the light, or where errors are smallest.

Centred rings are fewest and lie on the object. The blind curve of a camera, where r.m =
0, then crosses the object, so that it may take more cameras.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.certificates import CamerasBy
from planning.model.document.ring_records import AxisTaken, RingAxis
from planning.proofs.selection import fewest_count, fewest_of
from planning.rings.acquisition import pixels_read
from planning.rings.axis_moves import move_ring_axes
from planning.rings.centred_axes import centred_axes
from planning.rings.idle_rings import without_idle
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.measuring.measured import LitSamples, lit_samples
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .camera_cover import (
    CameraCover,
    NothingMeasuredError,
    candidate_cover,
    measured_of,
    measured_samples,
    n_fixed,
)
from .camera_stage import (
    AxesCover,
    CameraSolution,
    by_better_route,
    cover_axes,
    place_cameras,
)


def place_for_axes(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    candidates: CandidateViews,
    by: CamerasBy,
    *,
    axis: RingAxis | None,
    margin: float,
) -> CameraSolution:
    """Choose cameras for ring axes as they are wanted; None: there are none.

    `auto` takes centred axes if they take no more cameras than free ones: either that
    was proved over the candidates, or these are planned as well. The margin is how far
    beside the lit surface centred rings reach, in the unit of radii.

    Raises:
        NothingMeasuredError: If no candidate measures any lit sample.
    """
    if axis is None or axis == "free":
        return place_cameras(scene, projectors, candidates, by, axis)
    middle, free = centred_axes(scene, projectors, margin), None
    try:
        if axis == "auto" and by != "paper":
            needed = _needed_by_more(scene, middle, candidates)
            if needed is not None:
                free = cover_axes(scene, projectors, candidates, by, "free")
                if _burden(free)[:2] < (False, needed):
                    return by_better_route(scene, free, by)
        taken = cover_axes(scene, middle, candidates, by, "centred")
    except NothingMeasuredError:
        if axis == "centred":
            raise
        return place_cameras(scene, projectors, candidates, by)
    if axis == "auto" and free is None and not no_axes_need_fewer(scene, taken.cover):
        free = cover_axes(scene, projectors, candidates, by, "free")
    taken = taken if free is None else min(taken, free, key=_burden)
    return by_better_route(scene, taken, by)


def _needed_by_more(
    scene: Scene, projectors: Sequence[PlannedProjector], candidates: CandidateViews
) -> int | None:
    """Return how many candidates measure enough, unless other axes need no fewer.

    Which ones, and whether fresh samples confirm them, is left to who takes them.
    """
    samples, measured = measured_samples(scene, projectors, candidates)
    cover = candidate_cover(scene, measured, samples, candidates.cameras)
    needed = fewest_count(cover)
    proved = _seen_bound(scene, candidates, samples, measured) >= needed
    return None if proved and needed <= cover.most else needed


def no_axes_need_fewer(scene: Scene, cover: CameraCover) -> bool:
    """Return whether the requirement is met, and by no fewer candidates of any axes."""
    if cover.selection.status == "infeasible":
        return False
    bound = _seen_bound(scene, cover.candidates, cover.samples, cover.measured)
    return bound >= len(cover.cameras)


def _seen_bound(
    scene: Scene,
    candidates: CandidateViews,
    samples: LitSamples,
    measured: NDArray[np.bool_],
) -> float:
    """Return the least candidates, for as many samples measured, whatever the axes.

    Whatever a camera measures it sees: no cover of what is seen with fewer cameras
    bounds those of all ring axes.
    """
    seen = candidates.seen(samples.target)
    seen &= np.any(measured, axis=1)[:, None]
    cover = candidate_cover(scene, seen, samples, candidates.cameras)
    return fewest_of(cover).lower_bound


def standing_axes(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    views: CandidateViews,
    target: Target,
    *,
    axis: RingAxis,
    margin: float,
) -> tuple[tuple[PlannedProjector, ...], AxisTaken]:
    """Return existing projectors with ring axes for the existing cameras, and which.

    `auto` takes centred ones if with them enough of the target is measured.
    """
    if axis != "free":
        centred = centred_axes(scene, projectors, margin)
        samples, measured = measured_of(scene, centred, views, target)
        cover = candidate_cover(scene, measured, samples, views.cameras)
        if axis == "centred" or cover.enough(np.arange(cover.n_existing)):
            return centred, "centred"
    cameras = views.cameras[: n_fixed(scene)]
    lit = lit_samples(scene, projectors, target)
    return move_ring_axes(scene, projectors, cameras, lit), "free"


def other_axes(
    scene: Scene,
    solution: CameraSolution,
    cameras: Sequence[PlannedCamera],
    templates: Sequence[PlannedProjector],
    margin: float,
) -> tuple[PlannedProjector, ...]:
    """Return the projectors with the ring axes that weren't taken, to compare.

    Free axes start from the templates' and move for the cameras as they stand.
    """
    projectors, samples = solution.projectors, solution.stage.cover.samples
    scene = scene.among((*projectors, *cameras))
    if solution.axes == "free":
        return centred_axes(scene, projectors, margin)
    aside = tuple(
        p if p.keeps_rings else _with_rings_of(p, templates) for p in projectors
    )
    free = move_ring_axes(scene, aside, cameras, samples)
    return tuple(without_idle(scene, projector, margin) for projector in free)


def _with_rings_of(
    projector: PlannedProjector, templates: Sequence[PlannedProjector]
) -> PlannedProjector:
    (template,) = (t for t in templates if t.model == projector.model)
    frame = projector.world_from_device @ template.world_from_ring
    return replace(projector, world_from_ring=frame, ring_radii=template.ring_radii)


def _burden(chosen: AxesCover) -> tuple[bool, int, int]:
    """Smaller where the requirement is met, then with fewer cameras, then cheaper."""
    cameras, status = chosen.cover.cameras, chosen.cover.selection.status
    return status == "infeasible", len(cameras), pixels_read(chosen.projectors, cameras)
