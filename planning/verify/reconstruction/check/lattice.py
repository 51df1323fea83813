"""How far the lattice of a projector's pixels may have moved edges in images."""

import numpy as np

from planning.model.planned import EDGE_VARIANCE, edge_linearity_px
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner


def lattice_px(cloud: Cloud, normals: Array, plan: Scanner) -> Array:
    """Return what `edge_linearity_px` leaves of each edge in its image [px], (n,).

    A step d of the ring moves a point by N.r d / (r.m) along the normal, and so does
    its edge by as many pixels as that is of the move with one. The blur is the median
    of a pair's edges, less the edges' own. NaN where the normal is.
    """
    lattice = np.full(len(cloud), np.nan)
    facing = np.abs(np.einsum("ij,ij->i", normals, cloud.rays))
    per_m = facing / np.abs(cloud.conditioning) / cloud.per_pixel(normals)
    for (p, c), pair in plan.pairs():
        rows = np.flatnonzero((cloud.projector == p) & (cloud.camera == c))
        if not len(rows):
            continue
        drawn = pair.projector.pixel_m(cloud.points[rows]) * per_m[rows]
        blurs = cloud.blur_px[rows] / drawn
        blurs = blurs[np.isfinite(blurs)]
        blur = float(np.median(blurs)) if len(blurs) else np.inf
        own = np.sqrt(max(blur**2 - EDGE_VARIANCE, 0.0))
        lattice[rows] = drawn * edge_linearity_px(np.array(own))
    return lattice
