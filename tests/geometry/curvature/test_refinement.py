"""Long edges are cut, the surface stays."""

import numpy as np
import pytest
from support.plain_shapes import box, torus

from geometry.curvature.refinement import cut_for_curvature, cut_long_edges
from geometry.mesh.mesh import MeshSource, TriangleMesh
from geometry.mesh.topology import mesh_edges
from geometry.shapes.primitives import sphere


def edge_lengths(mesh: TriangleMesh) -> np.ndarray:
    ends = mesh.vertices[mesh_edges(mesh.faces).ends]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def cube() -> TriangleMesh:
    source = MeshSource("cube.stl", "0" * 64, "mm", 1e-3, 8, 12)
    plain = box((0.1, 0.1, 0.1))
    return TriangleMesh(plain.vertices, plain.faces, source)


@pytest.mark.parametrize("longest", [0.09, 0.011, 0.0037])
def test_no_edge_stays_long_and_the_surface_stays(longest: float) -> None:
    mesh = cube()
    cut, parent = cut_long_edges(mesh, longest)
    assert edge_lengths(cut).max() <= longest
    assert edge_lengths(cut).min() >= 0.4 * longest
    assert cut.source is mesh.source
    np.testing.assert_array_equal(cut.vertices[: len(mesh.vertices)], mesh.vertices)
    # Each part lies in its face's plane, turned the same way, and together they are it.
    np.testing.assert_allclose(
        cut.face_normals, mesh.face_normals[parent], rtol=0, atol=1e-12
    )
    areas = np.bincount(parent, cut.face_areas, len(mesh.faces))
    np.testing.assert_allclose(areas, mesh.face_areas, rtol=1e-12)
    lift = cut.face_centroids - mesh.corners[parent, 0]
    off = np.einsum("ij,ij->i", lift, mesh.face_normals[parent])
    np.testing.assert_allclose(off, 0.0, atol=1e-15)
    # No crack: still closed, and the same on every side of an edge.
    assert np.all(mesh_edges(cut.faces).n_faces == 2)
    assert np.all(np.diff(parent) >= 0)


def test_the_number_of_faces_is_bounded_and_the_longest_edges_go_first() -> None:
    mesh = cube()
    cut, parent = cut_long_edges(mesh, 1e-5)
    assert 50_000 < len(cut.faces) <= 100_000
    assert edge_lengths(cut).max() < 2.9 * edge_lengths(cut).min()
    assert set(parent) == set(range(12))


def test_a_fine_mesh_comes_through_as_it_is() -> None:
    for mesh in (
        sphere(0.1, subdivisions=4),
        torus(0.1, 0.04, around=160, about_tube=80),
    ):
        cut, parent = cut_for_curvature(mesh)
        assert cut is mesh
        np.testing.assert_array_equal(parent, np.arange(len(mesh.faces)))
    mesh = cube()
    assert cut_long_edges(mesh, 0.2)[0] is mesh


@pytest.mark.parametrize("subdivisions", [1, 2, 3])
def test_the_facets_of_a_coarse_ball_are_its_scale(subdivisions: int) -> None:
    ball = sphere(0.1, subdivisions=subdivisions)
    assert cut_for_curvature(ball)[0] is ball


def test_a_part_of_twelve_triangles_is_cut_to_the_scale_of_curvature() -> None:
    mesh = cube()
    cut, _ = cut_for_curvature(mesh)
    assert edge_lengths(cut).max() <= 1.25 * 0.02 * mesh.size
    wide, _ = cut_for_curvature(mesh, 0.03)
    assert edge_lengths(wide).max() <= 1.25 * 0.03
    assert len(wide.faces) < len(cut.faces)


@pytest.mark.parametrize("longest", [0.0, -1.0, float("nan")])
def test_a_length_must_be_positive(longest: float) -> None:
    with pytest.raises(ValueError, match="longest must be a positive number of metres"):
        cut_long_edges(cube(), longest)
