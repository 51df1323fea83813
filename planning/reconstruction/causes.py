"""What the errors of a reconstruction point at, in words."""

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import TriangleMesh
from geometry.proximity import closest_points

from ..requirements import CheckLimits
from .cloud import Cloud
from .result import PairCount

_MM = 1e3
# Incidence of light beyond which edges smear: formulation.md section 2 [rad].
_GRAZING = np.deg2rad(70.0)
# Points of each pair that the search for a cause looks at.
_POINTS_A_PAIR = 1000


_WORDS = {
    "labels": "the codes contradict the patterns: frames out of order or of another "
    "projector",
    "unconfirmed": "neither the mesh nor another pair confirms the points",
    "no_intersection": "the rays miss the rings: a pose isn't that of the plan",
    "root": "the root disc was drawn for another place of the camera",
    "conditioning": "the rays run along the rings' cones",
    "outside_panel": "the points lie outside the projector's image",
    "isolated": "the edges are scattered: little light, or nearly hidden",
    "depth_step": "the edges hang between surfaces, or the surface is too slanted",
}


def rejection(pairs: tuple[PairCount, ...]) -> str | None:
    """Return in words what most edges of pairs were left out for, None without any."""
    count: dict[str, int] = {}
    for pair in pairs:
        for cause, n in pair.rejected.items():
            count[cause] = count.get(cause, 0) + n
    cause = max(count, key=lambda name: count[name], default="labels")
    n_edges = sum(pair.n_edges for pair in pairs)
    if not count.get(cause, 0):
        return None
    return f"{count[cause]} of {n_edges} edges left out as `{cause}`, {_WORDS[cause]}"


def likely_cause(
    cloud: Cloud,
    mesh: TriangleMesh,
    limits: CheckLimits,
    pairs: tuple[PairCount, ...],
    *,
    projectors: tuple[str, ...],
    cameras: tuple[str, ...],
) -> str:
    """Return the likely cause of a failed check.

    In this order: pairs whose labels contradict each other; devices that gave no point;
    devices whose every pair is off while others are not; grazing light; the object.

    Args:
        cloud: All points, before redundancy was removed.
        mesh: The mesh of the plan.
        limits: Of the check.
        pairs: What each pair gave.
        projectors: Ids, in the order of the cloud's indices.
        cameras: Likewise.
    """
    unordered = tuple(p for p in pairs if 2 * p.rejected.get("labels", 0) > p.n_edges)
    if unordered:
        names = ", ".join(f"{pair.projector} with {pair.camera}" for pair in unordered)
        return f"{names}: {rejection(unordered)}"
    silent = [
        name
        for names, index in ((projectors, cloud.projector), (cameras, cloud.camera))
        for i, name in enumerate(names)
        if not np.any(index == i)
    ]
    if silent:
        own = (p for p in pairs if p.projector in silent or p.camera in silent)
        why = rejection(tuple(own)) or "dark, covered, blocked or aimed elsewhere"
        return f"{' and '.join(silent)} gave no point: {why}"
    few = cloud.take(_some_of_each_pair(cloud))
    nearest = closest_points(mesh, few.points)
    error = np.abs(nearest.distances)
    medians = _pair_medians(few, error, len(projectors), len(cameras))
    off = medians > limits.max_rms_m
    if not off.any():
        far = error > limits.max_rms_m
        cosine = -np.einsum("ij,ij->i", few.beams, mesh.face_normals[nearest.faces])
        if far.any() and float(np.median(cosine[far])) < np.cos(_GRAZING):
            return "most of the points that are off were lit at grazing incidence"
        return (
            "most points of every pair are accurate: the rest, or the surface that is "
            "missing, lies where few rings reach"
        )
    known = np.isfinite(medians)
    if np.all(off[known]):
        return (
            f"every pair of devices is off (median error "
            f"{_MM * np.nanmin(medians):.3f} to "
            f"{_MM * np.nanmax(medians):.3f} mm): the object isn't the mesh of the "
            f"plan, or most devices differ from it"
        )
    return _name_devices(off, known, medians, projectors, cameras)


def _some_of_each_pair(cloud: Cloud) -> NDArray[np.int64]:
    chosen: list[NDArray[np.int64]] = []
    pair = cloud.projector.astype(np.int64) << 16 | cloud.camera
    for key in np.unique(pair):
        rows = np.flatnonzero(pair == key)
        chosen.append(rows[:: -(-len(rows) // _POINTS_A_PAIR)])
    return np.concatenate(chosen)


def _pair_medians(
    cloud: Cloud, error: NDArray[np.float64], n_projectors: int, n_cameras: int
) -> NDArray[np.float64]:
    """Median error of each pair [m], NaN where it has no point."""
    medians = np.full((n_projectors, n_cameras), np.nan)
    for p in range(n_projectors):
        for c in range(n_cameras):
            own = (cloud.projector == p) & (cloud.camera == c)
            if own.any():
                medians[p, c] = np.median(error[own])
    return medians


def _name_devices(
    off: NDArray[np.bool_],
    known: NDArray[np.bool_],
    medians: NDArray[np.float64],
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
    explanations: tuple[tuple[list[str], NDArray[np.bool_]], ...] = (
        (projectors_off, by_projector),
        (cameras_off, by_camera),
        (projectors_off + cameras_off, by_camera | by_projector),
    )
    for names, blamed in explanations:
        if names and not np.any(off & ~blamed):
            rest = known & ~blamed
            verb = "differs" if len(names) == 1 else "differ"
            return (
                f"{' and '.join(names)} {verb} from the plan in pose or optics: median "
                f"error {_MM * np.median(medians[off]):.3f} mm, of the other pairs "
                f"{_MM * np.median(medians[rest]):.3f} mm"
            )
    pairs = ", ".join(f"{projectors[p]} with {cameras[c]}" for p, c in np.argwhere(off))
    return f"some pairs of devices are off and others aren't: {pairs}"
