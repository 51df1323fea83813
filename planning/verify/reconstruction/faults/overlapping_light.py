"""Which projectors' light falls on points of the surface, by ray casting."""

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.render.occluders import Occluder

from .supposed import Evidence, Supposed, places

# Light met more obliquely isn't told from none (docs/reference/semantics.md) [cosine].
_GLANCING = np.cos(np.deg2rad(89.0))
# Shadow rays stop this share of their length before the point they ask about.
_SHADOW_SLACK = 2e-5


def light_falls(
    projector: ProjectorCalibration,
    outer_radius: float,
    caster: Occluder,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return whether a projector's rings light points of the surface, by ray casting.

    Args:
        projector: As it stands.
        outer_radius: Where the last annulus ends, in its units.
        caster: What stands in the way.
        points: On the surface in [m], shape (n, 3).
        normals: Unit normals there, shape (n, 3).
    """
    pixels, depth = projector.panel(points)
    if projector.light == "diverging":
        beams = points - projector.centre
        reach = np.linalg.norm(beams, axis=1)
        beams, starts = beams / reach[:, None], projector.centre
    else:
        beams, reach = np.broadcast_to(projector.axis, points.shape), depth
        starts = points - reach[:, None] * beams
    ring = projector.to_ring(points)
    with np.errstate(invalid="ignore", divide="ignore"):
        rho = np.hypot(ring[:, 0], ring[:, 1])
        rho = rho / ring[:, 2] if projector.light == "diverging" else rho
        lit = projector.in_panel(pixels) & (depth > 0.0) & (rho <= outer_radius)
    lit &= -np.einsum("ij,ij->i", beams, normals) > _GLANCING
    rows = np.flatnonzero(lit)
    starts = np.broadcast_to(starts, points.shape)[rows]
    stop = reach[rows] * (1.0 - _SHADOW_SLACK)
    lit[rows] = ~caster.occluded(np.ascontiguousarray(starts), beams[rows], stop)
    return lit


def outer_radius(radii: NDArray[np.float64]) -> float:
    """Return where the last annulus ends: as wide as the one before, (n_rings,)."""
    return float(2.0 * radii[-1] - radii[-2])


def lit_twice(
    plan: RigPlan, pixels: NDArray[np.float64], p: int, c: int
) -> tuple[str, ...]:
    """Return which other projectors light most of some pixels, by the plan's geometry.

    Args:
        plan: Of the rig.
        pixels: In the image of camera `c`, shape (n, 2).
        p: Index of the projector that lights them anyway.
        c: Index of the camera.
    """
    supposed = Supposed.of(plan)
    at = places(Evidence.at(plan, pixels, p, c), supposed)
    known = np.isfinite(at.points[:, 0])
    if not known.any():
        return ()
    spot = supposed.body.caster, at.points[known], at.normals[known]
    lit: list[str] = []
    for q, projector in enumerate(supposed.projectors):
        outer = outer_radius(plan.projectors[q].ring_radii)
        if q != p and np.mean(light_falls(projector, outer, *spot)) > 0.5:
            lit.append(projector.id)
    return tuple(lit)
