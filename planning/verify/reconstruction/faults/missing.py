"""Samples that were promised and have no point: where they lie, and why.

Where light falls, by ray casting, also tells what two projectors light at once.
"""

from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.decode.decode import CAUSES
from planning.verify.reconstruction.render.rendered_light import SHADOW_SLACK

from .measured_clouds import REJECTED, MeasuredClouds
from .supposed import GRAZING, Supposed

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


def where_missing(measured: MeasuredClouds, *, displaced: bool) -> list[str]:
    """Say where samples are missing, and why unless devices are to blame as a whole."""
    claimed, missing = measured.expected.measured, measured.missing
    if claimed is None or not missing.any():
        return []
    where = _regions(measured, claimed)
    if displaced:
        return [where]
    samples = measured.expected.samples
    points, normals = samples.points[missing], samples.normals[missing]
    why = _hole_between(measured, points) or _left_out(measured, points)
    return [where, why or _no_edges(measured.supposed, points, normals)]


def _regions(measured: MeasuredClouds, claimed: Mask) -> str:
    """Name the regions that most of the missing samples lie in, with their shares."""
    samples, missing = measured.expected.samples, measured.missing
    region = measured.plan.region[samples.faces]
    ids, place = np.unique(region, return_inverse=True)
    promised = np.bincount(place[claimed], minlength=len(ids))
    lost = np.bincount(place[missing], minlength=len(ids))
    worst = np.argsort(-lost, kind="stable")[:_MOST_REGIONS]
    names = [
        f"{100 * lost[k] / promised[k]:.1f} % of what is promised "
        + ("outside the regions" if ids[k] < 0 else f"of region {ids[k]}")
        for k in worst.tolist()
        if lost[k]
    ]
    x, y, z = _MM * np.median(samples.points[missing], axis=0)
    return f"missing: {', '.join(names)}, about ({x:.0f}, {y:.0f}, {z:.0f}) mm"


def _hole_between(measured: MeasuredClouds, points: Array) -> str | None:
    """Name two cameras between whose measured surface most missing points lie.

    A point lies between two cameras if the points of either about it lie on one side,
    opposite to the other's: neither camera's image reaches across.
    """
    plan, cloud = measured.plan, measured.cloud
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
        first, second = plan.cameras[one], plan.cameras[other]
        d = float(np.linalg.norm(second.centre - first.centre))
        names = f"{first.id} and {second.id}"
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


def _left_out(measured: MeasuredClouds, points: Array) -> str | None:
    """Say why most edges on missing points gave none; None where most have no edge."""
    tau = measured.plan.limits.check.tau_m
    reached = np.zeros((len(CAUSES), len(points)), dtype=bool)
    for (_, c), pair in measured.decoded:
        for cause in np.unique(pair.outcomes[pair.outcomes >= 0]).tolist():
            pixels = pair.edges.pixels[pair.outcomes == cause]
            edges, _ = measured.supposed.seen(c, pixels)
            edges = edges[np.isfinite(edges[:, 0])]
            if len(edges):
                reached[cause] |= KDTree(edges).query(points)[0] <= tau
    shares = reached.mean(axis=1)
    cause = int(np.argmax(shares))
    if not shares[cause] >= _MOST:
        return None
    name = CAUSES[cause]
    return (
        f"edges on {100 * shares[cause]:.0f} % of them were left out as `{name}`, "
        f"{REJECTED[name]}"
    )


def _no_edges(supposed: Supposed, points: Array, normals: Array) -> str:
    """Say why there is no edge about missing points, by the plan's own geometry."""
    cosines = np.full((len(supposed.projectors), len(points)), -1.0)
    for p, projector in enumerate(supposed.projectors):
        lit = light_falls(projector, supposed.objects[0].caster, points, normals)
        cosines[p, lit] = projector.incidence_cosine(points, normals)[lit]
    best, projector = cosines.max(axis=0), cosines.argmax(axis=0)
    if np.mean(best > 0.0) < _MOST:
        return "no edge was found there: no projector's light falls on most of them"
    angle = float(np.median(np.arccos(best[best > 0.0])))
    if angle < GRAZING:
        return "no edge was found there: dark, hidden or outside the images"
    squarest = np.bincount(projector[best > 0.0], minlength=len(cosines))
    name = supposed.projectors[int(np.argmax(squarest))].id
    return (
        f"no edge was found there: {name} meets them at {np.rad2deg(angle):.0f} "
        f"degrees (median), at grazing incidence"
    )


def light_falls(
    projector: ProjectorCalibration, caster: RayCaster, points: Array, normals: Array
) -> Mask:
    """Return whether a projector's pattern lights points [m] of the surface, (n,).

    By ray casting; points and unit normals have shape (n, 3).
    """
    pixels, depth = projector.panel(points)
    with np.errstate(invalid="ignore", divide="ignore"):
        lit = projector.in_panel(pixels) & (depth > 0.0)
        if projector.dense is None:
            rho = projector.ring_coordinate(points)
            lit &= rho <= projector.pattern.outer_radius
    lit &= projector.incidence_cosine(points, normals) > _GLANCING
    starts, beams, reach = projector.aim(points[lit])
    lit[lit] = ~caster.occluded(starts, beams, reach * (1.0 - SHADOW_SLACK))
    return lit


def lit_twice(supposed: Supposed, pixels: Array, p: int, c: int) -> tuple[str, ...]:
    """Return which other projectors than p light most of some pixels of camera c."""
    points, normals = supposed.seen(c, pixels)
    known = np.isfinite(points[:, 0])
    if not known.any():
        return ()
    spot = supposed.objects[0].caster, points[known], normals[known]
    return tuple(
        projector.id
        for q, projector in enumerate(supposed.projectors)
        if q != p and np.mean(light_falls(projector, *spot)) > 0.5
    )
