"""Which projectors' light falls on points of the surface, by ray casting."""

import numpy as np

from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.render.occluders import Occluder
from planning.verify.reconstruction.render.rendered_light import SHADOW_SLACK
from planning.verify.reconstruction.scanner import Scanner

from .supposed import Evidence, Supposed, places

# Light met more obliquely isn't told from none (docs/reference/semantics.md) [cosine].
_GLANCING = np.cos(np.deg2rad(89.0))


def light_falls(
    projector: ProjectorCalibration, caster: Occluder, points: Array, normals: Array
) -> Mask:
    """Return whether a projector's rings light points of the surface, by ray casting.

    Args:
        projector: As it stands.
        caster: What stands in the way.
        points: On the surface in [m], shape (n, 3).
        normals: Unit normals there, shape (n, 3).
    """
    pixels, depth = projector.panel(points)
    starts, beams, reach = projector.aim(points)
    with np.errstate(invalid="ignore", divide="ignore"):
        drawn = projector.ring_coordinate(points) <= projector.pattern.outer_radius
        lit = projector.in_panel(pixels) & (depth > 0.0) & drawn
    lit &= -np.einsum("ij,ij->i", beams, normals) > _GLANCING
    rows = np.flatnonzero(lit)
    starts = np.broadcast_to(starts, points.shape)[rows]
    stop = reach[rows] * (1.0 - SHADOW_SLACK)
    lit[rows] = ~caster.occluded(np.ascontiguousarray(starts), beams[rows], stop)
    return lit


def lit_twice(plan: Scanner, pixels: Array, p: int, c: int) -> tuple[str, ...]:
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
        if q != p and np.mean(light_falls(projector, *spot)) > 0.5:
            lit.append(projector.id)
    return tuple(lit)
