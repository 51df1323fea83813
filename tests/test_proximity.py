import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.primitives import box, grid, sphere
from geometry.proximity import closest_points


def directions(n: int, seed: int = 0) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def box_distance(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Signed distance to a box, from its definition."""
    q = np.abs(points) - size / 2
    outside = np.linalg.norm(np.maximum(q, 0), axis=1)
    return outside + np.minimum(q.max(axis=1), 0)


def test_distance_to_a_box_is_exact_at_faces_edges_and_corners_and_inside() -> None:
    size = np.array([0.1, 0.2, 0.3])
    mesh = box(tuple(size), divisions=2)
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (4000, 3))
    found = closest_points(mesh, points)
    np.testing.assert_allclose(found.distances, box_distance(points, size), atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(points - found.points, axis=1),
        np.abs(found.distances),
        atol=1e-12,
    )


def test_closest_points_lie_in_the_face_that_is_named() -> None:
    mesh = sphere(0.1, subdivisions=3)
    found = closest_points(mesh, 0.13 * directions(500))
    a, b, c = np.moveaxis(mesh.corners[found.faces], 1, 0)
    whole = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    p = found.points
    parts = sum(
        np.linalg.norm(np.cross(s - p, t - p), axis=1)
        for s, t in ((a, b), (b, c), (c, a))
    )
    np.testing.assert_allclose(parts, whole, rtol=1e-6)


def test_the_sign_holds_at_edges_sharper_than_a_right_angle() -> None:
    # A thin wedge: beyond its edge, one face's normal alone says inside.
    x = np.array([[0.0, 0, 0], [0, 1, 0], [-1, 0, 0.1], [-1, 1, 0.1], [-1, 0, -0.1]])
    vertices = np.vstack([x, [[-1, 1, -0.1]]])
    top, bottom = [[0, 1, 3], [0, 3, 2]], [[0, 5, 1], [0, 4, 5]]
    mesh = TriangleMesh(vertices, np.array(top + bottom))
    assert np.all(mesh.face_normals[:2, 2] > 0)
    points = np.array([[0.1, 0.5, 0.3], [0.1, 0.5, -0.3], [0.2, 0.5, 0.0]])
    expected = np.hypot(points[:, 0], points[:, 2])
    np.testing.assert_allclose(closest_points(mesh, points).distances[2], expected[2])
    assert np.all(closest_points(mesh, points).distances > 0)
    inside = np.array([[-0.5, 0.5, 0.0]])
    assert closest_points(mesh, inside).distances[0] < 0


def test_far_from_the_origin_it_is_as_precise_and_threads_change_nothing() -> None:
    mesh = sphere(0.1, subdivisions=3)
    away = TriangleMesh(mesh.vertices + 1e3, mesh.faces)
    points = 0.11 * directions(40_000)
    here = closest_points(mesh, points, threads=1)
    there = closest_points(away, points + 1e3, threads=2)
    np.testing.assert_allclose(there.distances, here.distances, atol=1e-12)
    again = closest_points(mesh, points, threads=2)
    np.testing.assert_array_equal(again.faces, here.faces)
    np.testing.assert_array_equal(again.distances, here.distances)


def test_no_points_give_no_answers() -> None:
    found = closest_points(grid(1.0, 1.0, divisions=(1, 1)), np.empty((0, 3)))
    assert found.faces.shape == (0,)
    assert found.points.shape == (0, 3)


@pytest.mark.parametrize(
    ("points", "threads", "message"),
    [
        (np.zeros(3), 1, r"points must be \(n, 3\), got \(3,\)"),
        (np.full((1, 3), np.nan), 1, "finite"),
        (np.zeros((1, 3)), 0, "threads must be at least 1, got 0"),
    ],
)
def test_bad_queries_are_refused(
    points: np.ndarray, threads: int, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        closest_points(grid(1.0, 1.0, divisions=(1, 1)), points, threads=threads)
