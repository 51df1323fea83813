import numpy as np
import pytest
from support.plain_shapes import box, cylinder, grid, torus

from geometry.mesh.mesh import MeshError, TriangleMesh
from geometry.shapes.primitives import sphere

TRIANGLE = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]])
ONE = np.array([[0, 1, 2]])


def signed_volume(mesh: TriangleMesh) -> float:
    a, b, c = (mesh.corners[:, k] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def test_a_right_triangle_has_the_quantities_of_school_geometry() -> None:
    mesh = TriangleMesh(TRIANGLE, ONE)
    assert mesh.area == pytest.approx(6.0, rel=1e-15)
    np.testing.assert_array_equal(mesh.face_normals, [[0, 0, 1]])
    np.testing.assert_allclose(mesh.face_centroids, [[1, 4 / 3, 0]], rtol=1e-15)
    np.testing.assert_array_equal(mesh.bounds, [[0, 0, 0], [3, 4, 0]])
    np.testing.assert_array_equal(mesh.centre, [1.5, 2, 0])
    assert mesh.radius == pytest.approx(2.5)
    assert mesh.mean_edge == pytest.approx(4.0)


def test_bounds_and_radius_ignore_vertices_that_no_face_uses() -> None:
    mesh = TriangleMesh(np.vstack([TRIANGLE, [[99.0, 99, 99]]]), ONE)
    np.testing.assert_array_equal(mesh.bounds[1], [3, 4, 0])
    assert mesh.radius == pytest.approx(2.5)


def test_a_face_without_area_has_a_zero_normal_not_nan() -> None:
    mesh = TriangleMesh(TRIANGLE, np.array([[0, 1, 1], [0, 1, 2]]))
    np.testing.assert_array_equal(mesh.face_normals, [[0, 0, 0], [0, 0, 1]])


def test_arrays_are_copies_and_cannot_be_written() -> None:
    vertices = TRIANGLE.copy()
    mesh = TriangleMesh(vertices, ONE)
    vertices[0] = 7.0
    np.testing.assert_array_equal(mesh.vertices, TRIANGLE)
    for values in (mesh.vertices, mesh.faces, mesh.face_normals, mesh.corners):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (TRIANGLE[:, :2], ONE, r"vertices must be \(n, 3\), got \(3, 2\)"),
        (TRIANGLE, ONE[:, :2], r"faces must be \(n, 3\) .* got \(1, 2\)"),
        (TRIANGLE, ONE[:0], r"with n >= 1, got \(0, 3\)"),
        (TRIANGLE * [1, np.nan, 1], ONE, "vertex 0 is .*finite"),
        (TRIANGLE + np.array([np.inf, 0, 0]), ONE, "vertex 0 is .*finite"),
        (TRIANGLE, ONE + 1, r"indices span 1\.\.3, must lie in 0\.\.2"),
        (TRIANGLE, ONE - 1, r"indices span -1\.\.1"),
    ],
)
def test_what_is_no_mesh_is_refused(
    vertices: np.ndarray, faces: np.ndarray, message: str
) -> None:
    with pytest.raises(MeshError, match=message):
        TriangleMesh(vertices, faces)


def test_primitives_have_their_area_volume_and_outward_normals() -> None:
    ball = sphere(0.2, subdivisions=5)
    np.testing.assert_allclose(np.linalg.norm(ball.vertices, axis=1), 0.2, rtol=1e-12)
    assert len(ball.faces) == 20 * 4**5
    assert ball.area == pytest.approx(4 * np.pi * 0.04, rel=2e-3)
    assert signed_volume(ball) == pytest.approx(4 / 3 * np.pi * 0.008, rel=3e-3)
    assert np.all(np.einsum("ij,ij->i", ball.face_normals, ball.face_centroids) > 0)

    brick = box((0.1, 0.2, 0.3), divisions=3)
    assert brick.area == pytest.approx(0.22, rel=1e-12)
    assert signed_volume(brick) == pytest.approx(0.006, rel=1e-12)

    can = cylinder(0.05, 0.2, around=360)
    assert can.area == pytest.approx(2 * np.pi * 0.05 * 0.25, rel=1e-3)
    assert signed_volume(can) == pytest.approx(np.pi * 0.0025 * 0.2, rel=1e-3)

    ring = torus(0.1, 0.03, around=200, about_tube=100)
    assert ring.area == pytest.approx(4 * np.pi**2 * 0.003, rel=2e-3)
    assert signed_volume(ring) == pytest.approx(2 * np.pi**2 * 0.1 * 0.0009, rel=2e-3)

    sheet = grid(0.3, 0.2, divisions=(3, 5))
    assert sheet.area == pytest.approx(0.06, rel=1e-12)
    np.testing.assert_array_equal(sheet.face_normals, np.tile([0.0, 0, 1], (30, 1)))


@pytest.mark.parametrize(
    ("mesh", "euler"),
    [
        (sphere(1.0, subdivisions=2), 2),
        (box((1, 2, 3), divisions=4), 2),
        (cylinder(1.0, 1.0), 2),
        (torus(2.0, 1.0), 0),
        (cylinder(1.0, 1.0, capped=False), 0),
        (grid(1.0, 1.0, divisions=(4, 3)), 1),
    ],
    ids=["sphere", "box", "cylinder", "torus", "tube", "grid"],
)
def test_primitives_are_welded_and_wound_alike(mesh: TriangleMesh, euler: int) -> None:
    directed = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) == len(directed)
    n_edges = len(np.unique(np.sort(directed, axis=1), axis=0))
    assert len(mesh.vertices) - n_edges + len(mesh.faces) == euler


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sphere(0.0), "radius must be a positive"),
        (lambda: sphere(float("nan")), "radius must be a positive"),
        (lambda: sphere(1.0, subdivisions=-1), "subdivisions must be at least 0"),
    ],
)
def test_impossible_primitives_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
