"""Quadrics fitted to two rings, and that cores change no digit of what is made."""

import numpy as np
import pytest

from geometry import parallel
from geometry.curvature import quadric
from geometry.curvature.curvature import principal_curvatures
from geometry.curvature.quadric import fit_quadrics
from geometry.mesh.diffusion import diffused, surface_laplacian
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import mesh_edges
from geometry.shapes.primitives import sphere


def test_too_few_neighbours_arent_fitted() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    tensors, _, fitted, sensible = fit_quadrics(points, faces)
    assert not np.any(fitted | sensible)
    assert not tensors.any()


def test_what_no_mesh_can_carry_is_taken_from_around_it() -> None:
    ball = sphere(1.0, subdivisions=4)
    vertices = np.array(ball.vertices)
    spike = int(np.argmax(vertices[:, 2]))
    ball = TriangleMesh(vertices, ball.faces)
    clean = principal_curvatures(ball, radius=0.5 * ball.mean_edge)
    vertices[spike] *= 1.0 + 10.0 * ball.mean_edge
    spiky = TriangleMesh(vertices, ball.faces)
    found = principal_curvatures(spiky, radius=0.5 * ball.mean_edge)
    _, _, fitted, sensible = fit_quadrics(vertices / ball.mean_edge, ball.faces)
    assert fitted.all()
    assert not sensible[spike]
    assert found.valid.all()
    # Nothing turns by more than half a turn over an edge, the spike itself neither.
    shortest = ball.mean_edge * 0.8
    largest = np.maximum(np.abs(found.k_max), np.abs(found.k_min))
    assert (largest * shortest).max() <= np.pi
    away = np.linalg.norm(ball.vertices - ball.vertices[spike], axis=1)
    far = away > 8.0 * ball.mean_edge
    np.testing.assert_allclose(found.k_max[far], clean.k_max[far], rtol=1e-3)


@pytest.mark.parametrize("at_once", [100, 700])
def test_fits_in_parts_are_the_same_to_the_last_digit(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a rough shape that bends back on itself, with holes and an odd vertex."""
    ball = sphere(1.0, subdivisions=4)
    rng = np.random.default_rng(3)
    x, y, z = ball.vertices.T
    bent = np.column_stack([x + 0.8 * z * z, 0.4 * y, z])
    bent = (bent + 0.01 * rng.normal(size=bent.shape)) / ball.mean_edge
    faces = ball.faces[rng.random(len(ball.faces)) > 0.02]
    whole = fit_quadrics(bent, faces)
    monkeypatch.setattr(quadric, "_AT_ONCE", at_once)
    for one, other in zip(whole, fit_quadrics(bent, faces), strict=True):
        np.testing.assert_array_equal(one, other)
    assert 2000 < np.count_nonzero(whole[2])


@pytest.mark.parametrize("cores", [2, 3])
def test_cores_change_no_digit(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    ball = sphere(1.0, subdivisions=5)
    vertices, faces = np.array(ball.vertices), np.array(ball.faces)
    mass = ball.vertex_areas / ball.mean_edge**2
    laplacian = surface_laplacian(vertices, faces, mesh_edges(faces))
    values = np.random.default_rng(0).normal(size=(len(vertices), 30))

    def made() -> list[np.ndarray]:
        return [diffused(values, mass, laplacian, 4.0)]

    monkeypatch.setattr(parallel, "n_threads", lambda: 1)
    alone = made()
    monkeypatch.setattr(parallel, "n_threads", lambda: cores)
    for one, many in zip(alone, made(), strict=True):
        np.testing.assert_array_equal(one, many)


@pytest.mark.parametrize("count", [0, 1, 2, 7])
def test_results_come_in_the_order_of_the_items(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parallel, "n_threads", lambda: 3)
    assert parallel.mapped(lambda i: i * i, range(count)) == [
        i * i for i in range(count)
    ]


def test_a_failure_in_a_thread_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "n_threads", lambda: 2)
    with pytest.raises(ZeroDivisionError):
        parallel.mapped(lambda i: 1 // i, [1, 0, 2])
