"""Where the large regions are seen from a side, and from where the others are."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from geometry.rays.rays import RayCaster
from planning.model.plan import RigPlan

# A region of which a view shows less isn't told in it.
_SHOWN = 0.1
_Vector = NDArray[np.float64]


def region_spots(plan: RigPlan, caster: RayCaster, back: _Vector) -> dict[int, _Vector]:
    """Return where large regions are in view, by their numbers.

    Centroids (n, 3) of their faces in view, those near the middle of these first.

    Args:
        plan: With the mesh and its regions.
        caster: Over that mesh.
        back: Direction from the mesh to a viewer far away, shape (3,).
    """
    mesh, surface = plan.surface.mesh, plan.surface
    back = back / np.linalg.norm(back)
    spots: dict[int, _Vector] = {}
    for region in plan.large_regions:
        faces = np.flatnonzero(surface.region == region.id)
        whole = mesh.face_areas[faces].sum()
        faces = faces[mesh.face_normals[faces] @ back > 0.0]
        starts = mesh.face_centroids[faces] + 1e-4 * mesh.radius * back
        rays = np.broadcast_to(back, starts.shape)
        hidden = caster.occluded(starts, rays, np.full(len(starts), 4.0 * mesh.reach))
        faces = faces[~hidden]
        points, areas = mesh.face_centroids[faces], mesh.face_areas[faces]
        if areas.sum() > _SHOWN * whole:
            away = np.linalg.norm(points - areas @ points / areas.sum(), axis=1)
            spots[region.id] = points[np.argsort(away, kind="stable")]
    return spots


def direction_of_unseen(plan: RigPlan, seen: Iterable[int]) -> _Vector | None:
    """Return the mean normal of large regions that no view shows; None: all are seen.

    None as well where they face all ways.
    """
    told = set(seen)
    normals = [
        region.area_m2 * np.array(region.mean_normal)
        for region in plan.large_regions
        if region.id not in told
    ]
    total = np.sum(normals, axis=0) if normals else np.zeros(3)
    return total if np.linalg.norm(total) > 1e-9 * plan.surface.mesh.area else None
