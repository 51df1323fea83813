import numpy as np
import pytest
from support.plain_shapes import box, grid

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.shapes.primitives import sphere


def test_every_sample_stands_for_the_same_area_and_lies_in_its_face() -> None:
    mesh = sphere(0.1, subdivisions=3)
    samples = sample_surface(mesh, 3000, seed=4)
    assert len(samples) == 3000
    assert samples.weight * len(samples) == pytest.approx(mesh.area, rel=1e-12)
    np.testing.assert_array_equal(samples.normals, mesh.face_normals[samples.faces])
    away = samples.points - mesh.face_centroids[samples.faces]
    assert np.abs(np.einsum("ij,ij->i", away, samples.normals)).max() < 1e-15
    a, b, c = np.moveaxis(mesh.corners[samples.faces], 1, 0)
    for p, q in ((a, b), (b, c), (c, a)):
        turn = np.cross(q - p, samples.points - p)
        assert np.einsum("ij,ij->i", turn, samples.normals).min() > -1e-15


def test_a_face_gets_its_share_of_samples_within_two() -> None:
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(200, 3, 3)) * rng.uniform(0.01, 1.0, (200, 1, 1))
    mesh = TriangleMesh(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
    n = 5000
    counts = np.bincount(sample_surface(mesh, n, seed=1).faces, minlength=200)
    expected = n * mesh.face_areas / mesh.area
    assert np.all(np.abs(counts - expected) < 2)


def test_faces_in_rows_are_not_sampled_in_columns() -> None:
    """Height maps come in rows of faces; equal steps would fall on few columns."""
    mesh = grid(1.0, 1.0, divisions=(64, 64))
    for n in (64, 256, 512):
        points = sample_surface(mesh, n, seed=1).points[:, :2]
        for column in points.T:
            counts = np.histogram(column, bins=8, range=(-0.5, 0.5))[0]
            assert counts.min() >= n / 24, n


def test_samples_are_uniform_inside_a_face() -> None:
    mesh = TriangleMesh(
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    )
    n = 40_000
    points = sample_surface(mesh, n, seed=2).points
    # Mean and second moments of the uniform law on the triangle.
    np.testing.assert_allclose(points.mean(axis=0), [1 / 3, 1 / 3, 0], atol=5e-3)
    np.testing.assert_allclose((points**2).mean(axis=0), [1 / 6, 1 / 6, 0], atol=5e-3)
    assert (points[:, 0] * points[:, 1]).mean() == pytest.approx(1 / 12, abs=3e-3)


def test_within_restricts_faces_and_weight() -> None:
    mesh = box((0.1, 0.2, 0.3), divisions=2)
    top = mesh.face_normals[:, 2] > 0.5
    samples = sample_surface(mesh, 100, seed=0, within=top)
    assert top[samples.faces].all()
    assert samples.weight == pytest.approx(0.02 / 100, rel=1e-12)


def test_the_seed_decides() -> None:
    mesh = grid(1.0, 1.0, divisions=(3, 3))
    one, same, other = (sample_surface(mesh, 50, seed=s) for s in (7, 7, 8))
    np.testing.assert_array_equal(one.points, same.points)
    assert not np.array_equal(one.points, other.points)


def test_taking_some_keeps_them_aligned_and_their_weight() -> None:
    samples = sample_surface(sphere(1.0, subdivisions=1), 40, seed=0)
    odd = samples.take(np.arange(1, 40, 2))
    np.testing.assert_array_equal(odd.points, samples.points[1::2])
    np.testing.assert_array_equal(odd.normals, samples.normals[1::2])
    np.testing.assert_array_equal(odd.faces, samples.faces[1::2])
    assert odd.weight == samples.weight


def test_nothing_to_sample_is_refused() -> None:
    mesh = grid(1.0, 1.0, divisions=(1, 1))
    with pytest.raises(ValueError, match="n must be at least 1, got 0"):
        sample_surface(mesh, 0, seed=0)
    with pytest.raises(ValueError, match="no area"):
        sample_surface(mesh, 5, seed=0, within=np.zeros(2, dtype=bool))
