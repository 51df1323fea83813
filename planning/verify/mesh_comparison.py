"""Whether a mesh is the surface that a plan speaks of."""

from itertools import product

import numpy as np

from geometry.arrays import Array, Mask
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from planning.model.plan import RigPlan

from .audit.audit_findings import AuditFindings
from .audit.audit_samples import draw_points, generator_of, points_on

_MM = 1e3
_MESH_SAMPLES = 50_000
# A mesh that is larger or smaller by more than this is another file or unit.
_MOST_RESIZED = 1.5
# Of two normals that look the other way, minus their product; and how much may, in
# faces so narrow that theirs are noise.
_OPPOSITE, _MOST_TURNED = 0.5, 1e-4


def compare_meshes(mesh: TriangleMesh, surface: TriangleMesh, seed: int) -> list[str]:
    """Return why a mesh isn't the surface of a plan; nothing if it is.

    Random points of either, one on each face and more by area, must lie on the other
    within 1e-4 of its radius, on faces that look the same way, and the areas agree to
    1e-3: the same shape, though it be differently repaired or triangulated. Both meshes
    decide where the points lie, so that no surface can be made to differ only beside
    them.
    """
    same = np.array_equal(mesh.vertices, surface.vertices)
    if same and np.array_equal(mesh.faces, surface.faces):
        return []
    slack = 1e-4 * surface.radius
    if not np.allclose(mesh.bounds, surface.bounds, rtol=0.0, atol=slack):
        sizes = [np.round(_MM * np.ptp(m.bounds, axis=0), 2) for m in (mesh, surface)]
        return [
            f"mesh: its bounding box ({sizes[0].tolist()} mm) isn't that of "
            f"surface.npz ({sizes[1].tolist()} mm); check file, unit and axes"
        ]
    ways = [_beside(m, o, seed, slack) for m, o in ((mesh, surface), (surface, mesh))]
    apart, turned = (max(figures) for figures in zip(*ways, strict=True))
    if not apart <= slack:
        return [
            f"mesh: lies up to {_MM * apart:.3g} mm off surface.npz "
            f"(tolerance {_MM * slack:.2g} mm): another shape"
        ]
    if not turned <= _MOST_TURNED:
        return [
            f"mesh: {100.0 * turned:.1f} % of it looks the other way in surface.npz "
            f"(tolerance {100.0 * _MOST_TURNED:g} %), and light and view go by that"
        ]
    if not abs(mesh.area - surface.area) <= 1e-3 * surface.area:
        return [
            f"mesh: area {mesh.area:.6g} m², of surface.npz {surface.area:.6g} m², "
            f"tolerance 0.1 %"
        ]
    return []


def compare_records(mesh: TriangleMesh, plan: RigPlan) -> list[str]:
    """Return what a plan says falsely of the file that it was made from, if this is it.

    A scale that follows from a size is that of a surface which is rounded.
    """
    record, source = plan.document.meshes[0], mesh.source
    if source is None or source.sha256 != record.sha256:
        return []
    findings = AuditFindings()
    for name in ("unit", "n_vertices", "n_faces"):
        of_file = getattr(source, name)
        findings.same(f"meshes.0.{name}", getattr(record, name), of_file, "of the file")
    claimed, made = (
        [f"{repair.count} {repair.kind}" for repair in told.repairs]
        for told in (record, source)
    )
    findings.same("meshes.0.repairs", claimed, made, "of the file")
    scale = source.scale_to_m
    key = "meshes.0.scale_to_m"
    findings.number(key, record.scale_to_m, scale, 1e-6 * scale, "m")
    return list(findings.failures)


def comparable(mesh: TriangleMesh, surface: TriangleMesh) -> bool:
    """Whether a mesh may be the plan's object, changed: near it and of its size."""
    low, high = 1.0 / _MOST_RESIZED, _MOST_RESIZED
    apart = float(np.linalg.norm(mesh.centre - surface.centre))
    return low <= mesh.radius / surface.radius <= high and apart <= surface.radius


def _beside(
    mesh: TriangleMesh, other: TriangleMesh, seed: int, slack: float
) -> tuple[float, float]:
    """How random points of one mesh lie on the other.

    Their largest distance [m], and the share of its area on faces whose own points lie
    on none that looks the same way.
    """
    both = mesh.vertices, mesh.faces, other.vertices, other.faces
    rng = generator_of(both, seed)
    by_area, _ = draw_points(mesh, mesh.face_areas, _MESH_SAMPLES, rng)
    # A lid on a narrow mouth is too small for these, and a fold hides in a draw.
    own = points_on(mesh, np.arange(len(mesh.faces)), rng)
    nearest = closest_points(other, own)
    distances = nearest.distances, closest_points(other, by_area).distances
    along = np.einsum("ij,ij->i", mesh.face_normals, other.face_normals[nearest.faces])
    turned = np.flatnonzero(along < -_OPPOSITE)
    turned = turned[~_is_faced(other, own[turned], mesh.face_normals[turned], slack)]
    share = float(mesh.face_areas[turned].sum() / mesh.area)
    return float(np.abs(np.concatenate(distances)).max()), share


def _is_faced(mesh: TriangleMesh, points: Array, normals: Array, slack: float) -> Mask:
    """Whether a face that looks a point's way is as near, (n,).

    Of sheets without thickness either side is the nearest.
    """
    faced = np.zeros(len(points), dtype=bool)
    axes = np.argmax(np.abs(normals), axis=1)
    for axis, sign in product(range(3), (-1.0, 1.0)):
        asked = np.flatnonzero((axes == axis) & (sign * normals[:, axis] > 0.0))
        same = sign * mesh.face_normals[:, axis] > 0.0
        if len(asked) and same.any():
            side = TriangleMesh(mesh.vertices, mesh.faces[same])
            distances = closest_points(side, points[asked]).distances
            faced[asked] = np.abs(distances) <= slack
    return faced
