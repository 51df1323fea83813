import igl
import numpy as np
import pytest
from support.plain_shapes import box, grid

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from geometry.shapes.primitives import sphere


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


def convex_inside(mesh: TriangleMesh, points: np.ndarray) -> np.ndarray:
    away = points[:, None] - mesh.corners[None, :, 0]
    return np.all(np.einsum("ijk,jk->ij", away, mesh.face_normals) <= 0, axis=1)


def spike() -> TriangleMesh:
    """A sharp pyramid; one side is a fan of slivers that would outvote the others."""
    base = np.array([[-0.03, -0.03, 0.0], [0.03, -0.03, 0], [0.03, 0.03, 0]])
    base = np.vstack([base, [[-0.03, 0.03, 0]], [[0, 0, 0.3]]])
    t = np.linspace(0, 1, 41)[1:-1, None]
    vertices = np.vstack([base, base[0] + t * (base[1] - base[0])])
    chain = np.array([0, *range(5, 44), 1])
    fan = np.column_stack([chain[:-1], chain[1:], np.full(40, 4)])
    floor = np.column_stack([chain[1:], chain[:-1], np.full(40, 2)])
    sides = [[1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 3, 2]]
    return TriangleMesh(vertices, np.vstack([fan, floor, sides]))


def test_the_sign_holds_at_edges_and_corners_sharper_than_a_right_angle() -> None:
    mesh = spike()
    rng = np.random.default_rng(0)
    centres = np.array([[0, 0, 0.3], [0, 0, 0.15], [0, 0, 0]])
    points = centres[:, None] + rng.uniform(-0.1, 0.1, (3, 4000, 3))
    points = points.reshape(-1, 3)
    distances = closest_points(mesh, points).distances
    sure = np.abs(distances) > 1e-9
    np.testing.assert_array_equal(
        distances[sure] < 0, convex_inside(mesh, points)[sure]
    )


def test_far_from_the_origin_it_is_as_precise_and_the_same_again() -> None:
    mesh = sphere(0.1, subdivisions=3)
    away = TriangleMesh(mesh.vertices + 1e3, mesh.faces)
    points = 0.11 * directions(40_000)
    here = closest_points(mesh, points)
    there = closest_points(away, points + 1e3)
    np.testing.assert_allclose(there.distances, here.distances, atol=1e-12)
    again = closest_points(mesh, points)
    np.testing.assert_array_equal(again.faces, here.faces)
    np.testing.assert_array_equal(again.distances, here.distances)


def test_no_points_give_no_answers() -> None:
    found = closest_points(grid(1.0, 1.0, divisions=(1, 1)), np.empty((0, 3)))
    assert found.faces.shape == (0,)
    assert found.points.shape == (0, 3)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros(3), r"points must be \(n, 3\), got \(3,\)"),
        (np.full((1, 3), np.nan), "finite"),
    ],
)
def test_bad_queries_are_refused(points: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        closest_points(grid(1.0, 1.0, divisions=(1, 1)), points)


def test_distances_are_those_of_libigl_to_the_last_digit_on_a_crumpled_body() -> None:
    rng, ball = np.random.default_rng(3), sphere(0.1, subdivisions=3)
    vertices = ball.vertices * rng.uniform(0.6, 1.4, (len(ball.vertices), 1))
    mesh = TriangleMesh(vertices, ball.faces)
    points = np.concatenate([vertices, 0.5 * vertices, 1.5 * vertices])
    points = points + rng.normal(0.0, 0.01, points.shape)
    found = closest_points(mesh, points)
    distances, faces, feet, _ = igl.signed_distance(
        points - mesh.centre,
        mesh.vertices - mesh.centre,
        mesh.faces,
        sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
    )
    np.testing.assert_array_equal(found.distances, distances)
    np.testing.assert_array_equal(found.faces, faces)
    np.testing.assert_array_equal(found.points, np.add(feet, mesh.centre))
