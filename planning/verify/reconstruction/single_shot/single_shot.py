"""A rig that measures from one image of each camera under each projector.

Rings are told apart by a mesh that the object is known to lie near, not by a sequence.
"""

from collections.abc import Callable, Sequence
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
    Pairs,
    measure_edges,
)
from planning.verify.reconstruction.decode.edges import ImageEdges
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingsForCamera
from planning.verify.reconstruction.reconstruct import conclude
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.render import render_lines
from planning.verify.reconstruction.render.rendered import (
    Progress,
    RenderedScene,
    Spent,
)
from planning.verify.reconstruction.scanner import Scanner

from .prior_labels import PriorLabels, label_by_prior
from .ring_lines import RingLines, find_lines

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
        lines: Points of lines that were found.
        labels: What they were taken for.
    """

    index: PairIndex
    pair: PairCalibration
    width: float
    decoded: Decoded
    lines: RingLines
    labels: PriorLabels


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
        photometry: Simulated light and sensor.
        progress: Called with the pairs done and their total.
    """
    light = photometry or Photometry()
    spent = Spent()
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
        decoded_pairs(shots),
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
    scene = RenderedScene(plan, plan, photometry)
    views = [scene.seen(c) for c in range(len(plan.cameras))]
    shots: list[Shot] = []
    total = len(plan.cameras) * len(plan.projectors)
    for done, ((p, c), pair) in enumerate(plan.pairs(), start=1):
        patterns = pair.projector.pattern_for(pair.camera)
        width, lines = drawn_lines(pair.projector, patterns, plan.mesh)
        seen, shown = views[c], scene.shown(p, lines)
        if seen is not None and shown is not None:
            key = (seed, _STREAM, p, c)
            measured = decode_single_shot(
                render_lines(seen, [shown], scene.lenses[c], key),
                patterns,
                pair,
                prior,
                line_width=width,
                tolerance_m=tolerance_m,
                min_conditioning=plan.limits.min_conditioning,
            )
            shots.append(Shot((p, c), pair, width, *measured))
        if progress is not None:
            progress(done, total)
    return tuple(shots)


def decoded_pairs(shots: Sequence[Shot]) -> Pairs:
    """Return what each pair of projector and camera measured."""
    return [(shot.index, shot.decoded) for shot in shots]


def drawn_lines(
    projector: ProjectorCalibration, patterns: RingsForCamera, mesh: TriangleMesh
) -> tuple[float, RingsForCamera]:
    """Return the width of a projector's lines, in the unit of its radii, and them."""
    depth = (mesh.centre - projector.centre)[None] @ projector.axis
    width = _LINE_M * float(projector.light.shrink(depth)[0])
    width = min(width, _MAX_SHARE * patterns.least_gap)
    return width, patterns.lines(width)


def decode_single_shot(
    frames: Frames,
    patterns: RingsForCamera,
    calibration: PairCalibration,
    prior: TriangleMesh,
    *,
    line_width: float,
    tolerance_m: float,
    min_conditioning: float = 0.1,
) -> tuple[Decoded, RingLines, PriorLabels]:
    """Measure points from one image of bright rings and a prior of the object.

    Args:
        frames: One image of one camera under one projector, shape (1, h, w).
        patterns: Whose rings are the middles of the lines.
        calibration: Of both devices.
        prior: What the object is known to lie near.
        line_width: Of a line, in the unit of the radii.
        tolerance_m: How near the object lies to the prior [m].
        min_conditioning: Least |r.m|.

    Returns:
        What was measured; the points of lines that were found; their labels.
    """
    camera, projector = calibration.camera, calibration.projector
    away = float(np.linalg.norm(prior.centre - camera.centre))
    depth = projector.to_ring(prior.centre[None])[:, 2]
    # Lines are as wide as at the ring axis.
    width_m = line_width / float(projector.light.shrink(depth)[0])
    lines = find_lines(frames, width_m * camera.focal_px / away)
    labels = label_by_prior(
        lines.pixels, patterns.radii, calibration, prior, tolerance_m=tolerance_m
    )
    sure = labels.rings >= 0
    edges = ImageEdges(
        lines.pixels[sure],
        labels.rings[sure],
        labels.roots[sure],
        lines.across[sure],
        lines.noise_px[sure],
    )
    found = measure_edges(
        edges,
        patterns,
        calibration,
        int(np.count_nonzero(frames.stack[0])),
        np.zeros((0, 2)),
        min_conditioning=min_conditioning,
    )
    rejected = labels.rejected | found.rejected
    return replace(found, n_edges=len(lines), rejected=rejected), lines, labels
