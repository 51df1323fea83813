"""A whole rig that measures from one image of each camera under each projector."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.model.plan import RigPlan
from planning.model.planned import PlannedProjector
from planning.verify.reconstruction.calibration import (
    PairCalibration,
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.decode.decode import Decoded
from planning.verify.reconstruction.patterns.ring_patterns import (
    RingPatterns,
    ring_patterns,
)
from planning.verify.reconstruction.render.defocus import defocus_of, through_lens
from planning.verify.reconstruction.render.occluders import Both, Occluder, obstacles_of
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.render import Shown, render_lines
from planning.verify.reconstruction.render.view import view

from .prior_labels import PriorLabels
from .ring_lines import RingLines, line_patterns
from .single_shot import decode_single_shot

# Drawn width of a ring at the object [m]: 4 blurs of a projector; and at most this
# share of the least gap between rings.
_LINE_M = 1.0e-3
_MAX_SHARE = 0.4
# Tells the noise of single images from that of sequences.
_STREAM = 7


@dataclass(frozen=True, eq=False)
class Shot:
    """What one image gave.

    Attributes:
        projector: Index in the plan.
        camera: Index in the plan.
        pair: Calibration of both.
        width: Of a drawn line, in the unit of the radii.
        decoded: The points.
        lines: Points of lines that were found.
        labels: What they were taken for.
    """

    projector: int
    camera: int
    pair: PairCalibration
    width: float
    decoded: Decoded
    lines: RingLines
    labels: PriorLabels


def shoot_rig(
    plan: RigPlan,
    prior: TriangleMesh,
    *,
    tolerance_m: float,
    photometry: Photometry,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Shot, ...]:
    """Render and decode single images of bright rings, projectors shining in turn.

    Cameras that see nothing of the object give no shot.

    Args:
        plan: Devices, and the object that is rendered.
        prior: What the decoder knows of the object.
        tolerance_m: How near the object lies to it [m].
        photometry: Light and sensor.
        seed: Of the pixel noise.
        progress: Called with the pairs done and their total.
    """
    mesh = plan.surface.mesh
    caster = RayCaster(mesh, threads=1)
    focus, blurred = (defocus_of(plan, role) for role in ("camera", "projector"))
    shots: list[Shot] = []
    total = len(plan.cameras) * len(plan.projectors)
    for c, planned in enumerate(plan.cameras):
        camera = calibrate_camera(planned)
        before = obstacles_of(plan, camera.id)
        depth = (mesh.centre - camera.centre) @ camera.world_from_device[:3, 2]
        lens = through_lens(photometry, focus, float(depth), camera.focal_px)
        seen = view(camera, mesh, caster, lens, before)
        for p, source in enumerate(plan.projectors):
            if seen is not None:
                pair = PairCalibration(calibrate_projector(source), camera)
                patterns = ring_patterns(pair.projector, source.ring_radii, camera)
                width, lines = drawn_lines(source, patterns, mesh)
                past = _past(plan, source, caster)
                own = pair.projector
                shown = [Shown(own, own, lines, past, blurred)]
                key = (seed, _STREAM, p, c)
                found = decode_single_shot(
                    render_lines(seen, shown, lens, key),
                    patterns,
                    pair,
                    prior,
                    line_width=width,
                    tolerance_m=tolerance_m,
                    min_conditioning=plan.requirements.triangulation.min_conditioning,
                )
                shots.append(Shot(p, c, pair, width, *found))
            if progress is not None:
                progress(c * len(plan.projectors) + p + 1, total)
    return tuple(shots)


def drawn_lines(
    source: PlannedProjector, patterns: RingPatterns, mesh: TriangleMesh
) -> tuple[float, RingPatterns]:
    """Return the width of a projector's lines, in the unit of its radii, and them."""
    width = _LINE_M
    if source.light == "diverging":
        pose = source.world_from_device
        width /= float((mesh.centre - pose[:3, 3]) @ pose[:3, 2])
    gap = float(np.diff(patterns.radii, prepend=0.0).min())
    width = min(width, _MAX_SHARE * gap)
    return width, line_patterns(patterns, width)


def _past(plan: RigPlan, source: PlannedProjector, caster: RayCaster) -> Occluder:
    before = obstacles_of(plan, source.id)
    return caster if before is None else Both(caster, before)
