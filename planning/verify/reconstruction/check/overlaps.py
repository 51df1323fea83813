"""Where two projectors light the same pixels, and whether their light agrees there.

A pixel that is bright under either projector alone is of both I_j and I_j+1, so that
``I_j and I_j+1 != 0`` (section V). It shows one point, whatever the object is: what one
projector's ring measured there must lie in the annulus that the other one's code names,
and on the other one's ring where that crosses it.
"""

from collections.abc import Mapping

import numpy as np

from geometry.arrays import lengths
from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import PairIndex
from planning.verify.reconstruction.decode.lit_image import LitImage
from planning.verify.reconstruction.scanner import Scanner

# A ring may pass this far beside a pixel that shows both its sides [px]; slanted
# surface stretches that.
_BESIDE_PX = 2.5
_SIGMAS = 4.0


def compare_overlaps(
    cloud: Cloud, plan: Scanner, lit: Mapping[PairIndex, LitImage]
) -> tuple[Mask, Mask, Mask]:
    """Hold points against the light of the other projectors in their pixels.

    Returns:
        Which points lie in the light of two projectors; which of them on an edge in
        that of another, too; and which another's light contradicts, shape (n,) each.
    """
    shared, crossed, differs = (np.zeros(len(cloud), dtype=bool) for _ in range(3))
    size = pixel_sizes(cloud, plan)
    noise = lengths(cloud.shift) * cloud.noise_px
    for (q, c), image in lit.items():
        doubt_px = _noise_px(cloud, q, c)
        others = np.flatnonzero((cloud.camera == c) & (cloud.projector != q))
        if doubt_px is None or len(others) == 0:
            continue
        low, high = image.around(cloud.pixels[others])
        known = low >= 0
        others, low, high = others[known], low[known], high[known]
        shared[others] = True
        projector, points = plan.projectors[q], cloud.points[others]
        depth = projector.to_ring(points)[:, 2]
        away = projector.ring_coordinate(points)
        slack = (_BESIDE_PX + _SIGMAS * doubt_px) * size[others]
        slack += _SIGMAS * noise[others]
        slack *= projector.light.shrink(depth)
        radii = projector.pattern.radii
        outside = _beyond(away, radii, low, high) > slack
        crossing = high == low + 1
        ring = radii[np.minimum(low, len(radii) - 1)]
        beside = crossing & (np.abs(away - ring) > slack)
        differs[others] |= outside | beside
        crossed[others] |= high > low
    return shared, crossed, differs


def pixel_sizes(cloud: Cloud, plan: Scanner) -> Array:
    """Return how large a pixel is at each point, across the viewing ray [m], (n,)."""
    centres = np.array([camera.centre for camera in plan.cameras])
    focal = np.array([camera.focal_px for camera in plan.cameras])
    away = cloud.points - centres[cloud.camera]
    reach = np.sqrt(np.einsum("ij,ij->i", away, away))
    return reach / focal[cloud.camera]


def ring_pitch_px(cloud: Cloud, plan: Scanner) -> float:
    """Median distance of neighbouring rings in images [px]."""
    cloud = cloud.take(cloud.ring >= 0)
    if len(cloud) == 0:
        return 1.0
    gaps = np.empty(len(cloud))
    for p, projector in enumerate(plan.projectors):
        chosen = cloud.projector == p
        rings, depth = cloud.ring[chosen], projector.to_ring(cloud.points[chosen])[:, 2]
        gaps[chosen] = projector.pattern.gaps_m(rings, depth)
    return float(np.median(gaps / pixel_sizes(cloud, plan)))


def _noise_px(cloud: Cloud, projector: int, camera: int) -> float | None:
    """Median noise of a pair's edges, doubt included; None: it measured nothing."""
    of_pair = (cloud.projector == projector) & (cloud.camera == camera)
    return float(np.median(cloud.noise_px[of_pair])) if of_pair.any() else None


def _beyond(away: Array, radii: Array, low: Indices, high: Indices) -> Array:
    """How far |p| is outside annuli from the least to the largest; negative inside."""
    borders = np.concatenate([[-np.inf], radii, [np.inf]])
    return np.maximum(borders[low] - away, away - borders[high + 1])
