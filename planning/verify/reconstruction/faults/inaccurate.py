"""What points that are off the mesh have in common, no device being displaced."""

from dataclasses import replace

import numpy as np

from geometry.rays.proximity import closest_points
from planning.verify.reconstruction.arrays import Indices, Mask
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.scanner import Scanner

from .supposed import GRAZING, Evidence, Supposed, mismatches, places

_MM = 1e3
# Points of each pair that are looked at.
_POINTS_A_PAIR = 1000
# A projector counts if it lit so many of the points that are off.
_MUCH = 0.25
# An edge lies on its ring on the mesh within this, its point lies this far from there:
# as shares of the limit on the rms distance.
_ON_RING_SHARE, _ELSEWHERE_SHARE = 1.0, 20.0
# Fewer wrong roots are what noise does near the border of a disc.
_LEAST_SHARE = 0.05


def where_inaccurate(plan: Scanner, cloud: Cloud) -> str:
    """Say what the points that are off have in common, nothing being displaced."""
    limit, mesh = plan.limits.check.max_rms_m, plan.mesh
    each = {
        (p, c): cloud.take((cloud.projector == p) & (cloud.camera == c))
        for p in range(len(plan.projectors))
        for c in range(len(plan.cameras))
    }
    each = {pair: one.thinned(_POINTS_A_PAIR) for pair, one in each.items() if len(one)}
    few = Cloud.join([*each.values()])
    nearest = closest_points(mesh, few.points)
    error = np.abs(nearest.distances)
    ends = np.cumsum([len(one) for one in each.values()])[:-1]
    split = zip(each, np.split(error, ends), strict=True)
    medians = {pair: float(np.median(own)) for pair, own in split}
    off = [pair for pair, median in medians.items() if median > limit]
    if len(off) == len(medians):
        return (
            f"every pair of devices is off (median error "
            f"{_MM * min(medians.values()):.3f} to {_MM * max(medians.values()):.3f} "
            f"mm), and no change of one device, nor of the object's place or size, "
            f"explains it: the object isn't the mesh of the plan, or several devices "
            f"differ"
        )
    grazing = _grazing(plan, few, nearest.faces, error > limit)
    if grazing:
        return (
            f"the points that are off were lit at grazing incidence, where edges "
            f"smear: {', '.join(grazing)} (median)"
        )
    if not off:
        return (
            "most points of every pair are accurate: the rest, or the surface that is "
            "missing, lies where few rings reach"
        )
    names = ", ".join(f"{plan.name(pair)} {_MM * medians[pair]:.3f} mm" for pair in off)
    return f"some pairs of devices are off and others aren't (median error): {names}"


def _grazing(plan: Scanner, cloud: Cloud, faces: Indices, far: Mask) -> list[str]:
    """Name projectors that lit many of the points that are off at grazing incidence."""
    cosine = -np.einsum("ij,ij->i", cloud.beams, plan.mesh.face_normals[faces])
    names: list[str] = []
    for p, device in enumerate(plan.projectors):
        lit_by = cloud.projector[far] == p
        if len(lit_by) and np.mean(lit_by) > _MUCH:
            lit = float(np.median(cosine[far][lit_by]))
            if lit < np.cos(GRAZING):
                angle = np.rad2deg(np.arccos(np.clip(lit, -1.0, 1.0)))
                names.append(f"{device.id} at {angle:.0f} degrees")
    return names


def wrong_roots(plan: Scanner, decoded: Pairs) -> list[str]:
    """Name pairs of projector and camera whose points often lie on the other root.

    The ray of such a point meets the mesh where its ring is drawn, but the point was
    put elsewhere on the ray: labels and poses are right, the root bit isn't.
    """
    limit, supposed = plan.limits.check.max_rms_m, Supposed.of(plan)
    words: list[str] = []
    for (p, c), pair in decoded:
        cloud = pair.cloud.thinned(_POINTS_A_PAIR)
        if len(cloud) == 0 or plan.projectors[p].dense is not None:
            continue
        radii = plan.projectors[p].pattern.radii[cloud.ring]
        evidence = replace(Evidence.at(cloud.pixels, p, c), radii=radii)
        at = places(evidence, supposed)
        off = np.abs(mismatches(evidence, supposed, at)[1])
        apart = np.linalg.norm(cloud.points - at[0], axis=1)
        wrong = (off < _ON_RING_SHARE * limit) & (apart > _ELSEWHERE_SHARE * limit)
        if np.mean(wrong) > _LEAST_SHARE:
            words.append(
                f"{plan.name((p, c))}: {100 * np.mean(wrong):.0f} % of the points took "
                f"the wrong one of the two roots; the root disc isn't the one drawn "
                f"for {plan.cameras[c].id}"
            )
    return words
