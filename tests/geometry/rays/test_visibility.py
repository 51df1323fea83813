"""The visibility engine against float64, and the matrix of bits against its meaning."""

import tracemalloc
from functools import lru_cache

import igl
import numpy as np
import pytest
from support.plain_shapes import grid

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples, sample_surface
from geometry.rays.visibility import Visibility, morton_order
from geometry.rays.visibility_matrix import visibility_matrix
from geometry.shapes.primitives import sphere


def bumpy(radius: float, *, centre: float = 0.0, subdivisions: int = 5) -> TriangleMesh:
    """A ball with hills that hide each other."""
    ball = sphere(1.0, subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    height = 1.0 + 0.08 * np.sin(7 * x) * np.sin(6 * y) * np.cos(5 * z)
    return TriangleMesh(radius * ball.vertices * height[:, None] + centre, ball.faces)


def interior(mesh: TriangleMesh, n: int) -> SurfaceSamples:
    """Samples well inside their faces."""
    drawn = sample_surface(mesh, n, seed=3)
    inner = 0.9 * drawn.points + 0.1 * mesh.face_centroids[drawn.faces]
    return SurfaceSamples(inner, drawn.normals, drawn.faces, drawn.weight)


def devices(mesh: TriangleMesh, distance: float, n: int = 6) -> np.ndarray:
    along = np.random.default_rng(8).normal(size=(n, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return mesh.bounds.mean(axis=0) + distance * along


@lru_cache(maxsize=1)
def reference(mesh: TriangleMesh):
    """The mesh for libigl, which takes triangles whose determinant is under 1e-6 for
    edge-on: so a million units large."""
    middle = mesh.bounds.mean(axis=0)
    scale = 1e6 / np.linalg.norm(np.ptp(mesh.bounds, axis=0))
    vertices = np.ascontiguousarray((mesh.vertices - middle) * scale)
    faces = np.ascontiguousarray(mesh.faces)
    tree = igl.AABB()
    tree.init(vertices, faces)
    return tree, vertices, faces, middle, scale


def truly_blocked(mesh: TriangleMesh, samples: SurfaceSamples, sources) -> np.ndarray:
    """Float64 first hits; a sample is free if its own face is the first."""
    tree, vertices, faces, middle, scale = reference(mesh)
    points = (samples.points - middle) * scale
    rays = points - (sources - middle) * scale
    length = np.linalg.norm(rays, axis=1)
    rays /= length[:, None]
    back = np.minimum(length, 1.1e6)
    starts = np.ascontiguousarray(points - back[:, None] * rays)
    face, distance, _ = tree.intersect_ray_first(vertices, faces, starts, rays)
    squarely = np.abs(np.einsum("ij,ij->i", samples.normals, rays))
    nearer = distance < back - 1e-5 / np.maximum(squarely, 1e-9)
    return (face >= 0) & (face != samples.faces) & nearer


@pytest.mark.parametrize(
    ("radius", "centre", "distance"),
    [
        (1.0, 0.0, 3.0),
        (1.0, 0.0, 1.12),
        (0.0025, 0.0, 2.0),
        (0.0025, 1e3, 2.0),
        (0.0025, 1e6, 2.0),
        (1e-6, 0.0, 3e-6),
        (1e3, 0.0, 3e3),
        (1e3, 0.0, 1e7),
    ],
)
def test_no_face_interior_is_judged_falsely_at_any_scale(radius, centre, distance):
    mesh = bumpy(radius, centre=centre)
    visibility, samples = Visibility(mesh), interior(mesh, 4000)
    total = grazing = 0
    for origin in devices(mesh, distance):
        rays = origin - samples.points
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        cosine = np.einsum("ij,ij->i", samples.normals, rays)
        front = samples.take(cosine > 0.002)
        truth = truly_blocked(mesh, front, origin)
        found = visibility.blocked(origin, front.points, front.normals)
        np.testing.assert_array_equal(found, truth)
        total += int(truth.sum())
        grazing += int((cosine[cosine > 0.002] < 0.1).sum())
    assert total > 20
    assert grazing > 300


@pytest.mark.parametrize("gap", [1e-3, 1e-4, 1e-5])
def test_a_wall_far_thinner_than_any_edge_hides_what_is_behind(gap):
    """Plates of 1 m with edges of 0.5 m; the mean edge would say nothing of the gap."""
    lower, upper = grid(1.0, 1.0, divisions=(2, 2)), grid(0.5, 0.5, divisions=(1, 1))
    mesh = TriangleMesh(
        np.concatenate([lower.vertices, upper.vertices + [0.0, 0.0, gap]]),
        np.concatenate([lower.faces, upper.faces + len(lower.vertices)]),
    )
    points = sample_surface(lower, 4000, seed=1).points
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    found = Visibility(mesh).blocked(np.array([0.0, 0.0, 2.0]), points, normals)
    reach = np.abs(points[:, :2]).max(axis=1) * (1.0 - gap / 2.0)
    sure = np.abs(reach - 0.25) > 1e-6
    np.testing.assert_array_equal(found[sure], (reach < 0.25)[sure])


def test_parallel_light_leaves_a_plane_and_only_what_lies_before_it_blocks():
    ball = bumpy(0.1)
    visibility, samples = Visibility(ball), interior(ball, 4000)
    along = np.array([0.6, 0.0, -0.8])
    front = samples.take(samples.normals @ along < -0.002)
    plane = ball.bounds.mean(axis=0) - 3.0 * along
    depth = (front.points - plane) @ along
    truth = truly_blocked(ball, front, front.points - depth[:, None] * along)
    beside = plane + 7.0 * np.array([0.0, 1.0, 0.0])
    for point in (plane, beside):
        found = visibility.blocked(point, front.points, front.normals, along=along)
        np.testing.assert_array_equal(found, truth)
    assert 10 < truth.sum() < 2000
    # From a plane through the middle, hills on the near side block nothing.
    inside = samples.take(samples.normals @ along > 0.2)
    free = visibility.blocked(np.zeros(3), inside.points, inside.normals, along=along)
    assert not free[(inside.points @ along) > 0.06].any()


def test_sorted_samples_answer_in_the_callers_order_with_any_number_of_threads():
    mesh = bumpy(0.1)
    samples, origins = interior(mesh, 9000), devices(mesh, 0.4)
    one, two = Visibility(mesh, threads=1), Visibility(mesh, threads=2)
    points, normals = samples.points, samples.normals
    matrices = [visibility_matrix(v, origins, points, normals) for v in (one, two)]
    np.testing.assert_array_equal(matrices[0], matrices[1])
    dense = matrices[0]
    for row, origin in enumerate(origins):
        facing = np.einsum("ij,ij->i", normals, origin - points) > 0
        free = ~two.blocked(origin, points, normals)
        np.testing.assert_array_equal(dense[row], facing & free)
    assert 0.2 < dense.mean() < 0.5


def test_only_candidates_are_seen():
    mesh = bumpy(0.1)
    visibility, samples = Visibility(mesh), interior(mesh, 1003)
    origins = devices(mesh, 0.4, 5)
    every = visibility_matrix(visibility, origins, samples.points, samples.normals)
    wanted = np.random.default_rng(0).random((5, 1003)) < 0.3
    some = visibility_matrix(
        visibility, origins, samples.points, samples.normals, candidates=wanted
    )
    np.testing.assert_array_equal(some, every & wanted)


def test_a_matrix_in_parallel_light_is_its_rows():
    mesh = bumpy(0.1)
    visibility, samples = Visibility(mesh), interior(mesh, 2000)
    origins = devices(mesh, 0.5, 4)
    along = -origins / np.linalg.norm(origins, axis=1, keepdims=True)
    matrix = visibility_matrix(
        visibility, origins, samples.points, samples.normals, along=along
    )
    for row in range(4):
        blocked = visibility.blocked(
            origins[row], samples.points, samples.normals, along=along[row]
        )
        facing = samples.normals @ along[row] < 0
        np.testing.assert_array_equal(matrix[row], facing & ~blocked)


@pytest.mark.long
def test_a_large_matrix_takes_a_byte_a_pair():
    mesh = sphere(0.1, subdivisions=2)
    samples = sample_surface(mesh, 300_000, seed=0)
    visibility = Visibility(mesh)
    origins = devices(mesh, 0.4, 96)
    tracemalloc.start()
    matrix = visibility_matrix(visibility, origins, samples.points, samples.normals)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    prepared, rays = 80 * 300_000, 3 << 20
    assert peak < matrix.nbytes + prepared + 2 * rays
    assert matrix.shape == (96, 300_000)


def test_morton_order_walks_the_octants_one_by_one():
    points = np.random.default_rng(2).random((4096, 3)).astype(np.float32)
    points[:2] = [[0, 0, 0], [1, 1, 1]]
    order = morton_order(points)
    np.testing.assert_array_equal(np.sort(order), np.arange(4096))
    octant = (points >= 0.5) @ np.array([1, 2, 4])
    cells = np.floor(points * 1023).astype(int) >= 512
    octant = cells @ np.array([1, 2, 4])
    assert np.all(np.diff(octant[order]) >= 0)
    assert morton_order(points[:0]).shape == (0,)
    assert morton_order(np.ones((3, 3), np.float32)).tolist() == [0, 1, 2]


ONE = np.array([[0.0, 0.0, 0.1]])
UP = np.array([[0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("origin", "points", "normals", "along", "message"),
    [
        ([0, 0, np.nan], ONE, UP, None, "origin must be 3 finite metres"),
        ([0, 0, 1e30], ONE, UP, None, "at most 1e.15 times the mesh away"),
        ([[0, 0, 1]], ONE, UP, None, "origin must be 3 finite metres"),
        ([0, 0, 1], ONE * np.nan, UP, None, "points must be finite"),
        ([0, 0, 1], ONE, UP * np.nan, None, "normals must be finite"),
        ([0, 0, 1], ONE, np.tile(UP, (2, 1)), None, r"must both be \(n, 3\)"),
        ([0, 0, 1], ONE[0], UP[0], None, r"must both be \(n, 3\)"),
        ([0, 0, 1], ONE, UP, [0, 0, -2.0], "along must be a unit vector"),
        ([0, 0, 1], ONE, UP, [0, 0, np.nan], "along must be a unit vector"),
    ],
)
def test_what_embree_would_swallow_is_refused(origin, points, normals, along, message):
    visibility = Visibility(sphere(0.1, subdivisions=1))
    with pytest.raises(ValueError, match=message):
        visibility.blocked(origin, points, normals, along=along)


def test_a_matrix_refuses_shapes_that_disagree():
    visibility = Visibility(sphere(0.1, subdivisions=1))
    origins = np.ones((2, 3))
    with pytest.raises(ValueError, match=r"candidates must be \(2, 1\), got \(1, 1\)"):
        visibility_matrix(
            visibility, origins, ONE, UP, candidates=np.ones((1, 1), dtype=bool)
        )
    with pytest.raises(ValueError, match=r"origins and along must be \(m, 3\)"):
        visibility_matrix(visibility, origins, ONE, UP, along=UP)


def test_no_samples_are_no_error():
    visibility = Visibility(sphere(0.1, subdivisions=1))
    none = np.empty((0, 3))
    assert visibility.blocked(np.ones(3), none, none).shape == (0,)
    assert visibility_matrix(visibility, np.ones((2, 3)), none, none).shape == (2, 0)
