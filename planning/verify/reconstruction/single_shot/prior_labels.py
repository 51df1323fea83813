"""Labels for one image of rings, from a mesh that the object is known to lie near."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Columns, Indices, Mask
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.decode.edges import ImageEdges
from planning.verify.reconstruction.decode.triangulate import intersect_rings

# Places on a ray at which its depth in the prior is looked at.
_STEPS = 12
_ROOTS = (1, -1)


def label_by_prior(
    lines: ImageEdges,
    pair: PairCalibration,
    prior: TriangleMesh,
    *,
    tolerance_m: float,
) -> tuple[ImageEdges, dict[str, int]]:
    """Label points on lines with ring and root, where the prior leaves one choice.

    Each ray meets every ring surface in up to two points. A point is labelled if
    exactly one of them lies within the tolerance of the prior, where the object itself
    can't hide it from either device. So no label of a ring is wrong while the surfaces
    of object and prior lie within the tolerance of each other;
    neighbouring candidates are dR / |r.m| apart along the ray, which bounds how far off
    a prior may be: a depth range dZ <= dR / |r.m|.

    Args:
        lines: Points of lines in the camera's image.
        pair: Calibration of both devices.
        prior: What the object is known to lie near.
        tolerance_m: How near.

    Returns:
        The lines, ring -1 and root 0 where none is sure; and how many of these are
        `off_prior`, no ring meeting the ray near the prior, or `ambiguous`, several.

    Raises:
        ValueError: If the tolerance isn't positive.
    """
    if not (tolerance_m > 0.0 and np.isfinite(tolerance_m)):
        raise ValueError(f"tolerance_m must be positive, got {tolerance_m} m")
    rays = pair.camera.rays(lines.pixels)
    met = _candidates(rays, pair, prior, tolerance_m)
    near = _possible(met, rays, pair, prior, tolerance_m)
    count = np.bincount(near.ray, minlength=len(lines))
    sure = near.take(count[near.ray] == 1)
    rings = np.full(len(lines), -1, dtype=np.int64)
    roots = np.zeros(len(lines), dtype=np.int8)
    rings[sure.ray], roots[sure.ray] = sure.rings, sure.roots
    return replace(lines, rings=rings, roots=roots), {
        "off_prior": int(np.count_nonzero(count == 0)),
        "ambiguous": int(np.count_nonzero(count > 1)),
    }


@dataclass(frozen=True, eq=False)
class _Crossings(Columns):
    """Where rays meet ring surfaces: ray, ring, root and point of each."""

    ray: Indices
    rings: Indices
    roots: NDArray[np.int8]
    points: Array


def _candidates(
    rays: Array,
    pair: PairCalibration,
    prior: TriangleMesh,
    tolerance_m: float,
) -> _Crossings:
    """Intersections of every ray with every ring in the prior's box."""
    low, high = prior.bounds[0] - tolerance_m, prior.bounds[1] + tolerance_m
    n, parts = len(rays), list[_Crossings]()
    for ring, radius in enumerate(pair.projector.pattern.radii):
        for root in _ROOTS:
            side, on_ring = np.full(n, root, np.int8), np.full(n, radius)
            hits = intersect_rings(
                pair.camera.centre, rays, on_ring, side, pair.projector
            )
            # NaN, where a ray misses the ring, is in no box.
            inside = np.all((hits.points >= low) & (hits.points <= high), axis=1)
            number = np.full(n, ring, dtype=np.int64)
            every = _Crossings(np.arange(n), number, side, hits.points)
            parts.append(every.take(inside))
    return _Crossings.join(parts)


def _possible(
    met: _Crossings,
    rays: Array,
    pair: PairCalibration,
    prior: TriangleMesh,
    tolerance_m: float,
) -> _Crossings:
    """Those near the prior, in the panel, that the object leaves seen and lit."""
    if len(met) == 0:
        return met
    projector = pair.projector
    near = np.abs(closest_points(prior, met.points).distances) <= tolerance_m
    pixels, _ = projector.panel(met.points)
    met = met.take(near & projector.in_panel(pixels))
    caster = RayCaster(prior, threads=1)
    reach = np.linalg.norm(met.points - pair.camera.centre, axis=1)
    hidden = _behind_prior(met.points, rays[met.ray], reach, caster, tolerance_m)
    _, beams, length = projector.aim(met.points)
    hidden |= _behind_prior(met.points, beams, length, caster, tolerance_m)
    return met.take(~hidden)


def _behind_prior(
    points: Array, towards: Array, away: Array, caster: RayCaster, tolerance_m: float
) -> Mask:
    """Whether rays that end at points ran deeper in the prior than it may be off, (n,).

    Then the object itself stands in the way. Whether the prior's own surface does, or
    is turned away, says nothing so surely.
    """
    faces, first = caster.first_hits(points - away[:, None] * towards, towards)
    deep = np.flatnonzero((faces >= 0) & (away > first + 2.0 * tolerance_m))
    blocked = np.zeros(len(points), dtype=bool)
    for share in (np.arange(_STEPS) + 0.5) / _STEPS:
        clear = deep[~blocked[deep]]
        if len(clear) == 0:
            break
        back = (1.0 - share) * (first[clear] - away[clear])
        inner = points[clear] + back[:, None] * towards[clear]
        depth = closest_points(caster.mesh, inner).distances
        blocked[clear] = depth < -tolerance_m
    return blocked
