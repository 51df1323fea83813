"""What squares of a projector's panel, and their blur, do to edges in images."""

from dataclasses import dataclass

import numpy as np

from planning.model.devices.planned import EDGE_VARIANCE, edge_linearity_px
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

# Of a drawn edge the ramp of two pixels lies across it, and doesn't blur along it.
_ALONG = EDGE_VARIANCE - 4.0 / 12.0


@dataclass(frozen=True, eq=False)
class PanelEffects:
    """Edges of points under the blur of their pair of devices, shape (n,) each.

    Attributes:
        lattice_px: What `edge_linearity_px` leaves of each in its image [px].
        inwards: How far along its ray each point lies off since edges are curved [m].
    """

    lattice_px: Array
    inwards: Array

    @classmethod
    def of(cls, cloud: Cloud, normals: Array, plan: Scanner) -> "PanelEffects":
        """Return them for points whose normals are known; 0 elsewhere.

        A step d of the ring moves a point by N.r d / (r.m) along the normal, and so
        does its edge by as many pixels as that is of the move with one: so blurs are
        known in pixels of the projector, of a pair their median. A blur b draws an edge
        of radius R inwards by b^2 / (2 R).
        """
        lattice, inwards = np.zeros((2, len(cloud)))
        facing = np.abs(np.einsum("ij,ij->i", normals, cloud.rays))
        per_m = facing / np.abs(cloud.conditioning) / cloud.per_pixel(normals)
        for (p, c), pair in plan.pairs():
            own = (cloud.projector == p) & (cloud.camera == c) & np.isfinite(per_m)
            rows = np.flatnonzero(own)
            pixel_m = pair.projector.pixel_m(cloud.points[rows])
            drawn = pixel_m * per_m[rows]
            blurs = cloud.blur_px[rows] / drawn
            if not np.isfinite(blurs).any():
                continue
            square = float(np.nanmedian(blurs)) ** 2 - EDGE_VARIANCE
            blur = np.array(np.sqrt(max(square, 0.0)))
            lattice[rows] = drawn * edge_linearity_px(blur)
            radii = pair.projector.pattern.radii[cloud.ring[rows]]
            radii_px = radii * np.sqrt(np.prod(np.diag(pair.projector.matrix)[:2]))
            off = (blur**2 + _ALONG) / (2.0 * radii_px) * pixel_m
            inwards[rows] = off / cloud.conditioning[rows]
        return cls(lattice, inwards)
