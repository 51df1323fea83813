"""A rig that measures from one image of each camera under each projector.

Rings are told apart by a mesh that the object is known to lie near, not by a sequence.
"""

from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning.verify.reconstruction.calibration import (
    PairCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.decode.decode import (
    Decoded,
    PairIndex,
    measure_edges,
)
from planning.verify.reconstruction.decode.edges import ImageEdges
from planning.verify.reconstruction.patterns.ring_patterns import RingsForCamera
from planning.verify.reconstruction.reconstruct import conclude
from planning.verify.reconstruction.render.photometry import Photometry, assumed_light
from planning.verify.reconstruction.render.render import render_lines
from planning.verify.reconstruction.render.rendered import (
    Progress,
    RenderedScene,
    Spent,
)
from planning.verify.reconstruction.scanner import Scanner

from .prior_labels import label_by_prior
from .ring_lines import find_lines

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
        index: Of projector and camera.
        pair: Calibration of both.
        width: Of a drawn line, in the unit of the radii.
        decoded: The points.
        lines: Points of lines that were found; ring -1: not told.
    """

    index: PairIndex
    pair: PairCalibration
    width: float
    decoded: Decoded
    lines: ImageEdges


def reconstruct_single_shot(
    plan: Scanner,
    expected: Expected | None = None,
    *,
    tolerance_m: float,
    seed: int,
    photometry: Photometry | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Measure the object of a plan from one image of each pair of devices.

    Args:
        plan: Devices, patterns and the object; its mesh is the prior, too.
        expected: As in `reconstruct`; what sequences would measure.
        tolerance_m: How near the object is taken to lie to the mesh [m].
        seed: Of the pixel noise.
        photometry: Simulated light and sensor; None: as the plan's check assumes.
        progress: Called with the pairs done and their total.
    """
    light, spent = photometry or assumed_light(plan), Spent()
    with spent.on("decode"):
        shots = shoot_rig(
            plan,
            plan.mesh,
            tolerance_m=tolerance_m,
            photometry=light,
            seed=seed,
            progress=progress,
        )
    return conclude(
        plan,
        [(shot.index, shot.decoded) for shot in shots],
        seed=seed,
        expected=expected,
        photometry=light,
        spent=spent,
    )


def shoot_rig(
    plan: Scanner,
    prior: TriangleMesh,
    *,
    tolerance_m: float,
    photometry: Photometry,
    seed: int,
    progress: Progress | None = None,
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
    scene = RenderedScene(plan, plan, photometry)
    views = [scene.seen(c) for c in range(len(plan.cameras))]
    shots: list[Shot] = []
    pairs = list(plan.pairs())
    for done, ((p, c), pair) in enumerate(pairs, start=1):
        patterns = pair.projector.pattern_for(pair.camera)
        width, drawn = drawn_lines(pair.projector, patterns, plan.mesh)
        seen, shown = views[c], scene.shown(p, drawn)
        if seen is not None and shown is not None:
            frames = render_lines(seen, [shown], scene.lenses[c], (seed, _STREAM, p, c))
            lines, rejected = label_by_prior(
                find_lines(frames, _width_px(width, pair, prior)),
                pair,
                prior,
                tolerance_m=tolerance_m,
            )
            decoded = measure_edges(
                lines.take(lines.rings >= 0),
                patterns,
                pair,
                int(np.count_nonzero(frames.stack[0])),
                np.zeros((0, 2)),
                min_conditioning=plan.limits.min_conditioning,
            )
            rejected |= decoded.rejected
            decoded = replace(decoded, n_edges=len(lines), rejected=rejected)
            shots.append(Shot((p, c), pair, width, decoded, lines))
        if progress is not None:
            progress(done, len(pairs))
    return tuple(shots)


def drawn_lines(
    projector: ProjectorCalibration, patterns: RingsForCamera, mesh: TriangleMesh
) -> tuple[float, RingsForCamera]:
    """Return the width of a projector's lines, in the unit of its radii, and them."""
    depth = (mesh.centre - projector.centre)[None] @ projector.axis
    width = _LINE_M * float(projector.light.shrink(depth)[0])
    width = min(width, _MAX_SHARE * patterns.least_gap)
    return width, patterns.lines(width)


def _width_px(width: float, pair: PairCalibration, prior: TriangleMesh) -> float:
    """Width of a line in the image; lines are as wide as at the ring axis."""
    away = float(np.linalg.norm(prior.centre - pair.camera.centre))
    depth = pair.projector.to_ring(prior.centre[None])[:, 2]
    width_m = width / float(pair.projector.light.shrink(depth)[0])
    return width_m * pair.camera.focal_px / away
