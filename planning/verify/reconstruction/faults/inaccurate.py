"""What points that are off the mesh have in common, no device being displaced."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.rays.proximity import closest_points
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.scanner import Scanner

from .supposed import GRAZING, Evidence, Supposed, mismatches, places

_MM = 1e3
# Points of each pair that are looked at.
_POINTS_A_PAIR = 1000
# A projector counts if so many of the points that are off are its own.
_MUCH = 0.25
# An edge lies on its ring on the mesh within this, its point lies this far from there:
# as shares of the limit on the rms distance.
_ON_RING_SHARE, _ELSEWHERE_SHARE = 1.0, 20.0
# Fewer wrong roots are what noise does near the border of a disc.
_LEAST_SHARE = 0.05


def where_inaccurate(plan: Scanner, cloud: Cloud) -> str:
    """Say what the points that are off have in common, nothing being displaced."""
    limit = plan.limits.check.max_rms_m
    key = cloud.projector.astype(np.int64) << 16 | cloud.camera
    by_pair = [cloud.take(key == k) for k in np.unique(key)]
    few = Cloud.join([one.thinned(_POINTS_A_PAIR) for one in by_pair])
    mesh = plan.mesh
    nearest = closest_points(mesh, few.points)
    error = np.abs(nearest.distances)
    far = error > limit
    cosine = -np.einsum("ij,ij->i", few.beams, mesh.face_normals[nearest.faces])
    grazing = _grazing(plan, few.projector[far], cosine[far])
    if grazing:
        return (
            f"the points that are off were lit at grazing incidence, where edges "
            f"smear: {', '.join(grazing)} (median)"
        )
    medians = _pair_medians(few, error, len(plan.projectors), len(plan.cameras))
    off = medians > limit
    if not off.any():
        return (
            "most points of every pair are accurate: the rest, or the surface that is "
            "missing, lies where few rings reach"
        )
    known = np.isfinite(medians)
    if np.all(off[known]):
        return (
            f"every pair of devices is off (median error "
            f"{_MM * np.nanmin(medians):.3f} to {_MM * np.nanmax(medians):.3f} mm), "
            f"and no change of one device, nor of the object's place or size, explains "
            f"it: the object isn't the mesh of the plan, or several devices differ"
        )
    ids = tuple(p.id for p in plan.projectors), tuple(c.id for c in plan.cameras)
    return _name_devices(off, known, medians, *ids)


def _grazing(plan: Scanner, projector: NDArray[np.int16], cosine: Array) -> list[str]:
    """Name projectors whose points among those that are off are lit at grazing light.

    Args:
        plan: Of the rig.
        projector: Of each point that is off, shape (n,).
        cosine: Of the incidence of its light, shape (n,).
    """
    names: list[str] = []
    for p, device in enumerate(plan.projectors):
        chosen = projector == p
        if len(chosen) and np.mean(chosen) > _MUCH:
            lit = float(np.median(cosine[chosen]))
            if lit < np.cos(GRAZING):
                angle = np.rad2deg(np.arccos(np.clip(lit, -1.0, 1.0)))
                names.append(f"{device.id} at {angle:.0f} degrees")
    return names


def _pair_medians(
    cloud: Cloud, error: Array, n_projectors: int, n_cameras: int
) -> Array:
    """Median error of each pair [m], NaN where it has no point."""
    medians = np.full((n_projectors, n_cameras), np.nan)
    for p in range(n_projectors):
        for c in range(n_cameras):
            chosen = (cloud.projector == p) & (cloud.camera == c)
            if chosen.any():
                medians[p, c] = np.median(error[chosen])
    return medians


def _name_devices(
    off: Mask,
    known: Mask,
    medians: Array,
    projectors: tuple[str, ...],
    cameras: tuple[str, ...],
) -> str:
    """Name the devices whose every pair is off, if they account for all that is."""
    bad_cameras = np.all(off | ~known, axis=0)
    bad_projectors = np.all(off | ~known, axis=1)
    cameras_off = [name for name, bad in zip(cameras, bad_cameras, strict=True) if bad]
    projectors_off = [
        name for name, bad in zip(projectors, bad_projectors, strict=True) if bad
    ]
    by_camera = np.tile(bad_cameras, (len(projectors), 1))
    by_projector = np.tile(bad_projectors[:, None], len(cameras))
    explanations: tuple[tuple[list[str], Mask], ...] = (
        (projectors_off, by_projector),
        (cameras_off, by_camera),
        (projectors_off + cameras_off, by_camera | by_projector),
    )
    for names, blamed in explanations:
        if names and not np.any(off & ~blamed):
            others = known & ~blamed
            verb = "differs" if len(names) == 1 else "differ"
            return (
                f"{' and '.join(names)} {verb} from the plan in pose or optics: median "
                f"error {_MM * np.median(medians[off]):.3f} mm, of the other pairs "
                f"{_MM * np.median(medians[others]):.3f} mm"
            )
    pairs = ", ".join(f"{projectors[p]} with {cameras[c]}" for p, c in np.argwhere(off))
    return f"some pairs of devices are off and others aren't: {pairs}"


def wrong_roots(plan: Scanner, decoded: Pairs) -> tuple[tuple[str, str, float], ...]:
    """Return pairs of projector and camera whose points often lie on the other root.

    The ray of such a point meets the mesh where its ring is drawn, but the point was
    put elsewhere on the ray: labels and poses are right, the root bit isn't.

    Args:
        plan: Of the rig.
        decoded: What each pair gave.

    Returns:
        Id of the projector and the camera, and the share of the pair's points.
    """
    limit = plan.limits.check.max_rms_m
    supposed = Supposed.of(plan)
    wrong_pairs: list[tuple[str, str, float]] = []
    for (p, c), pair in decoded:
        cloud = pair.cloud.thinned(_POINTS_A_PAIR)
        if len(cloud) == 0:
            continue
        radii = plan.projectors[p].pattern.radii[cloud.ring]
        evidence = replace(Evidence.at(plan, cloud.pixels, p, c), radii=radii)
        at = places(evidence, supposed)
        off = np.abs(mismatches(evidence, supposed, at))
        apart = np.linalg.norm(cloud.points - at[0], axis=1)
        wrong = (off < _ON_RING_SHARE * limit) & (apart > _ELSEWHERE_SHARE * limit)
        share = float(np.mean(wrong))
        if share > _LEAST_SHARE:
            wrong_pairs.append((plan.projectors[p].id, plan.cameras[c].id, share))
    return tuple(wrong_pairs)
