"""Samples that were promised and have no point: where they lie, and why.

Where light falls, by ray casting, also tells what two projectors light at once.
"""

from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from geometry.mesh.sampling import SurfaceSamples
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import CAUSES, Pairs
from planning.verify.reconstruction.render.occluders import Occluder
from planning.verify.reconstruction.render.rendered_light import SHADOW_SLACK
from planning.verify.reconstruction.scanner import Scanner

from .supposed import GRAZING, Evidence, Supposed, places

_MM = 1e3
_MOST_REGIONS = 3
# A hole between two cameras is looked at this far about a sample, in tau.
_REACH_TAU = 10.0
# A camera measured on one side only if at most this share of its points lie beyond.
_ONE_SIDED = 0.05
_NEIGHBOURS = 60
# An explanation must hold for this share of the missing samples.
_MOST = 0.5
# Light met more obliquely isn't told from none (docs/reference/semantics.md) [cosine].
_GLANCING = np.cos(np.deg2rad(89.0))


def missing_where(
    plan: Scanner, samples: SurfaceSamples, predicted: Mask, missing: Mask
) -> str:
    """Return the regions that most of the missing samples lie in, with their shares."""
    region = plan.region[samples.faces]
    ids, place = np.unique(region, return_inverse=True)
    promised = np.bincount(place[predicted], minlength=len(ids))
    lost = np.bincount(place[missing], minlength=len(ids))
    worst = np.argsort(-lost, kind="stable")[:_MOST_REGIONS]
    names = [
        f"{100 * lost[k] / promised[k]:.1f} % of what is promised "
        + ("outside the regions" if ids[k] < 0 else f"of region {ids[k]}")
        for k in worst.tolist()
        if lost[k]
    ]
    centre = _MM * np.median(samples.points[missing], axis=0)
    return (
        f"missing: {', '.join(names)}, about ({centre[0]:.0f}, {centre[1]:.0f}, "
        f"{centre[2]:.0f}) mm"
    )


def hole_between(
    plan: Scanner, cloud: Cloud, samples: SurfaceSamples, missing: Mask
) -> str | None:
    """Return the pair of cameras between whose measured parts most missing samples lie.

    A sample lies between two cameras if the points of either about it lie on one side,
    opposite to the other's: neither camera's image reaches across.

    Args:
        plan: Of the rig.
        cloud: All points.
        samples: Of the target.
        missing: Which of them have no point, shape (n,).
    """
    points = samples.points[missing]
    reach = _REACH_TAU * plan.limits.check.tau_m
    sides = {
        c: _side(cloud.points[cloud.camera == c], points, reach)
        for c in np.unique(cloud.camera).tolist()
    }
    for one, other in combinations(sides, 2):
        (a, near), (b, far) = sides[one], sides[other]
        between = np.einsum("ij,ij->i", a, b) < -0.5
        if np.mean(between) < _MOST:
            continue
        width = float(np.median((near + far)[between]))
        centres = [plan.cameras[k].centre for k in (one, other)]
        d = float(np.linalg.norm(centres[1] - centres[0]))
        names = f"{plan.cameras[one].id} and {plan.cameras[other].id}"
        return (
            f"they lie between what {names} measured, a hole about "
            f"{_MM * width:.1f} mm wide: the baseline of {names}, {_MM * d:.1f} mm, is "
            f"too wide for their images to meet"
        )
    return None


def _side(measured: Array, points: Array, reach: float) -> tuple[Array, Array]:
    """Return the direction of a camera's points about others, and how near they are.

    Zero directions where it has none within reach, or has them on all sides.
    """
    nearby: Any = [*range(1, min(_NEIGHBOURS, len(measured)) + 1)]
    distance, nearest = KDTree(measured).query(points, k=nearby)
    near = distance <= reach
    away = measured[np.where(near, nearest, 0)] - points[:, None]
    away = np.where(near[:, :, None], away / np.maximum(distance, 1e-12)[:, :, None], 0)
    mean = away.sum(axis=1)
    side = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    beyond = np.einsum("ijk,ik->ij", away, side) < -0.1
    share = beyond.sum(axis=1) / np.maximum(near.sum(axis=1), 1)
    sound = near[:, 0] & (share <= _ONE_SIDED)
    return np.where(sound[:, None], side, 0.0), distance[:, 0]


def left_out_nearby(
    plan: Scanner, decoded: Pairs, samples: SurfaceSamples, missing: Mask
) -> tuple[str, float] | None:
    """Return why most edges on missing samples gave no point, and for which share.

    Args:
        plan: Of the rig.
        decoded: What each pair gave.
        samples: Of the target.
        missing: Which of them have no point, shape (n,).

    Returns:
        A name of `decode.CAUSES` and the share of the missing samples that have such an
        edge within tau; None where most of them have none.
    """
    supposed = Supposed.of(plan)
    points = samples.points[missing]
    tau = plan.limits.check.tau_m
    reached = np.zeros((len(CAUSES), len(points)), dtype=bool)
    for (p, c), pair in decoded:
        for cause in np.unique(pair.outcomes[pair.outcomes >= 0]).tolist():
            own = pair.outcomes == cause
            evidence = Evidence.at(plan, pair.edges.pixels[own], p, c)
            lie, _ = places(evidence, supposed)
            lie = lie[np.isfinite(lie[:, 0])]
            if len(lie):
                reached[cause] |= KDTree(lie).query(points)[0] <= tau
    shares = reached.mean(axis=1)
    cause = int(np.argmax(shares))
    if not shares[cause] >= _MOST:
        return None
    return CAUSES[cause], float(shares[cause])


def no_edges(plan: Scanner, points: Array, normals: Array) -> str:
    """Say why there is no edge about missing samples, by the plan's own geometry.

    Args:
        plan: Of the rig.
        points: Of the samples [m], shape (n, 3).
        normals: Unit normals there, shape (n, 3).
    """
    supposed = Supposed.of(plan)
    cosines = np.full((len(supposed.projectors), len(points)), -1.0)
    for p, projector in enumerate(supposed.projectors):
        lit = light_falls(projector, supposed.body.caster, points, normals)
        cosines[p, lit] = projector.incidence_cosine(points, normals)[lit]
    best, projector = cosines.max(axis=0), cosines.argmax(axis=0)
    if np.mean(best > 0.0) < _MOST:
        return "no edge was found there: no projector's light falls on most of them"
    angle = float(np.median(np.arccos(best[best > 0.0])))
    if angle < GRAZING:
        return "no edge was found there: dark, hidden or outside the images"
    squarest = np.bincount(projector[best > 0.0], minlength=len(cosines))
    name = plan.projectors[int(np.argmax(squarest))].id
    return (
        f"no edge was found there: {name} meets them at {np.rad2deg(angle):.0f} "
        f"degrees (median), at grazing incidence"
    )


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
    points, normals = places(Evidence.at(plan, pixels, p, c), supposed)
    known = np.isfinite(points[:, 0])
    if not known.any():
        return ()
    spot = supposed.body.caster, points[known], normals[known]
    lit: list[str] = []
    for q, projector in enumerate(supposed.projectors):
        if q != p and np.mean(light_falls(projector, *spot)) > 0.5:
            lit.append(projector.id)
    return tuple(lit)
