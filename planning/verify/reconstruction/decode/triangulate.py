"""Ray meets ring surface: a cylinder in parallel light, a cone in diverging light."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.light_laws import LightLaw


@dataclass(frozen=True, eq=False)
class RingHits:
    """Where rays meet the ring surfaces that they were labelled with.

    Attributes:
        points: In the world [m], shape (n, 3); NaN where there is no intersection.
        distances: Along the rays [m], shape (n,).
        normals: Unit normals m of the ring surfaces in the world, shape (n, 3).
        conditioning: r.m, shape (n,).
    """

    points: Array
    distances: Array
    normals: Array
    conditioning: Array


def intersect_rings(
    origin: Array,
    rays: Array,
    radii: Array,
    roots: NDArray[np.int8],
    projector: ProjectorCalibration,
) -> RingHits:
    """Intersect viewing rays with ring surfaces, taking the root that the disc told.

    In ring coordinates, o the origin and q the direction, b = sign(r.m) the root bit::

        A = qx^2 + qy^2 - k qz^2,  B = ox qx + oy qy - k oz qz
        C = ox^2 + oy^2 - k oz^2 - c,   t = (-B + b sqrt(B^2 - A C)) / A

    with k = 0, c = R^2 for the cylinder and k = R^2, c = 0 for the cone. Of the two
    forms of t the one that doesn't subtract nearly equal numbers is used.

    All is NaN where a ray misses, and where the point lies behind the camera or, for a
    cone, behind the projector.

    Args:
        origin: Optical centre in the world [m], shape (3,).
        rays: Unit directions in the world, shape (n, 3).
        radii: R of each ray's ring: [m], or a tangent in diverging light, shape (n,).
        roots: Sign of r.m for each ray, shape (n,).
        projector: Whose rings they are.
    """
    o = projector.to_ring(origin[None])[0]
    q = rays @ projector.ring_axes
    t = _distance(o, q, radii, roots.astype(np.float64), projector.light)
    with np.errstate(invalid="ignore"):
        bad = ~(t > 0.0)
        bad |= ~projector.light.reaches(o[2] + t * q[:, 2])
    t = np.where(bad, np.nan, t)
    local = o + t[:, None] * q
    with np.errstate(invalid="ignore", divide="ignore"):
        outward = local[:, :2] / np.hypot(local[:, 0], local[:, 1])[:, None]
    local_normals = projector.light.ring_normals(outward, radii)
    normals = local_normals @ projector.ring_axes.T
    size = 1.0
    if projector.drawn_for is not None:
        size = lengths(normals)
        normals /= size[:, None]
    return RingHits(
        points=origin + t[:, None] * rays,
        distances=t,
        normals=normals,
        conditioning=np.einsum("ij,ij->i", q, local_normals) / size,
    )


def _distance(o: Array, q: Array, radii: Array, root: Array, light: LightLaw) -> Array:
    k, c = light.quadric(radii)
    qx, qy, qz = q.T
    a = qx * qx + qy * qy - k * qz * qz
    b = o[0] * qx + o[1] * qy - k * o[2] * qz
    constant = o[0] ** 2 + o[1] ** 2 - k * o[2] ** 2 - c
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = np.sqrt(b * b - a * constant)
        sign = np.where(b < 0.0, -1.0, 1.0)
        e = -(b + sign * spread)
        return np.where(root == sign, constant / e, e / a)
