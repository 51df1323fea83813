"""Whoever writes a surface doesn't know where it will be looked at, seed or no seed."""

from dataclasses import replace

import numpy as np
from support.plain_shapes import box, grid

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from planning.model.surface import Surface
from planning.verify.audit.audit_samples import draw_samples
from planning.verify.mesh_comparison import compare_meshes


def in_order(surface: Surface, order: np.ndarray) -> Surface:
    """The same surface, its faces in another order."""
    return replace(
        surface,
        mesh=TriangleMesh(surface.mesh.vertices, surface.mesh.faces[order]),
        **{name: getattr(surface, name)[order] for name in ("member", "region")},
        steep=surface.steep[order],
    )


def test_a_surface_that_differs_beside_known_draws_is_another_shape():
    """All of a box but the fifth of its faces that 2000 even draws of the seed meet."""
    mesh = box((1.0, 1.0, 1.0), divisions=30)
    kept = np.isin(np.arange(len(mesh.faces)), sample_surface(mesh, 2000, seed=0).faces)
    sunk = np.where(kept, 0.0, 0.01)[:, None, None] * mesh.face_normals[:, None]
    corners = (mesh.corners - sunk).reshape(-1, 3)
    other = TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))
    (why,) = compare_meshes(mesh, other, 0)
    assert "another shape" in why


def test_faces_in_an_order_made_for_the_draws_are_drawn_otherwise(handmade):
    """All draws of the seed would fall to the left; faces are equally large."""
    mesh, n = grid(1.0, 1.0, divisions=(40, 40)), 3200
    whole = np.zeros(n, dtype=np.int64)
    planned = handmade.build_plan().surface
    beside = {"member": whole, "region": whole, "steep": np.zeros((n, 3))}
    surface = replace(planned, mesh=mesh, **beside)
    drawn = np.isin(np.arange(n), draw_samples(surface, "surface", 600, seed=0).faces)
    order, left = np.empty(n, dtype=np.int64), np.argsort(mesh.face_centroids[:, 0])
    order[np.flatnonzero(drawn)] = left[: drawn.sum()]
    order[np.flatnonzero(~drawn)] = left[drawn.sum() :]
    made_for_it = in_order(surface, order)
    x = draw_samples(made_for_it, "surface", 600, seed=0).points[:, 0]
    assert 0.4 < np.mean(x > np.median(mesh.face_centroids[:, 0])) < 0.6
