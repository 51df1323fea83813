"""Whether a mesh is the surface that a plan speaks of."""

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.rays.proximity import closest_points

_MM = 1e3
_MESH_SAMPLES = 2000
# A mesh that is larger or smaller by more than this is another file or unit.
_MOST_RESIZED = 1.5


def compare_meshes(mesh: TriangleMesh, surface: TriangleMesh) -> list[str]:
    """Return why a mesh isn't the surface of a plan; nothing if it is.

    Random points of either must lie on the other within 1e-4 of its radius, and the
    areas agree to 1e-3: the same shape, though it be differently repaired or
    triangulated.
    """
    slack = 1e-4 * surface.radius
    if not np.allclose(mesh.bounds, surface.bounds, rtol=0.0, atol=slack):
        sizes = [np.round(_MM * np.ptp(m.bounds, axis=0), 2) for m in (mesh, surface)]
        return [
            f"mesh: its bounding box ({sizes[0].tolist()} mm) isn't that of "
            f"surface.npz ({sizes[1].tolist()} mm); check file, unit and axes"
        ]
    apart = max(_apart(mesh, surface), _apart(surface, mesh))
    if not apart <= slack:
        return [
            f"mesh: lies up to {_MM * apart:.3g} mm off surface.npz "
            f"(tolerance {_MM * slack:.2g} mm): another shape"
        ]
    if not abs(mesh.area - surface.area) <= 1e-3 * surface.area:
        return [
            f"mesh: area {mesh.area:.6g} m², of surface.npz {surface.area:.6g} m², "
            f"tolerance 0.1 %"
        ]
    return []


def comparable(mesh: TriangleMesh, surface: TriangleMesh) -> bool:
    """Whether a mesh may be the plan's object, changed: near it and of its size."""
    low, high = 1.0 / _MOST_RESIZED, _MOST_RESIZED
    apart = float(np.linalg.norm(mesh.centre - surface.centre))
    return low <= mesh.radius / surface.radius <= high and apart <= surface.radius


def _apart(mesh: TriangleMesh, other: TriangleMesh) -> float:
    """Largest distance of random points of one mesh from the other in [m]."""
    points = sample_surface(mesh, _MESH_SAMPLES, seed=0).points
    return float(np.abs(closest_points(other, points).distances).max())
