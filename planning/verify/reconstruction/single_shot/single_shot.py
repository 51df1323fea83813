"""One image of rings to measured points: labels by a prior mesh, not by a sequence."""

from dataclasses import replace

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.decode.decode import Decoded, measure_edges
from planning.verify.reconstruction.decode.edges import ImageEdges
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingPatterns

from .prior_labels import PriorLabels, label_by_prior
from .ring_lines import RingLines, find_lines


def decode_single_shot(
    frames: Frames,
    patterns: RingPatterns,
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
    width_m = line_width
    if projector.light == "diverging":
        width_m *= float(projector.to_ring(prior.centre[None])[0, 2])
    lines = find_lines(frames, width_m * camera.focal_px / away)
    labels = label_by_prior(
        lines.pixels, patterns.radii, calibration, prior, tolerance_m=tolerance_m
    )
    sure = labels.rings >= 0
    none = np.zeros(0, dtype=np.int64)
    edges = ImageEdges(
        lines.pixels[sure],
        labels.rings[sure],
        labels.roots[sure],
        lines.across[sure],
        lines.noise_px[sure],
        none,
        none,
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
