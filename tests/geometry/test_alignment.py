"""Meshes laid over the first: known motions come back, and nothing is mirrored."""

import numpy as np
import pytest

from geometry.alignment.alignment import aligned
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
SHIFT = np.array([0.2, -0.1, 0.05])


@pytest.fixture(scope="module")
def egg():
    """Three different axes, and no symmetry: one end of each is blunter."""
    p = sphere(0.05, subdivisions=4).vertices
    stretched = p * [1.0, 1.4, 1.9] + 4.0 * p**2 * [1.0, 1.5, 2.0]
    return TriangleMesh(stretched, sphere(0.05, subdivisions=4).faces)


def moved(mesh, turn=TURN, shift=SHIFT):
    return TriangleMesh(mesh.vertices @ turn.T + shift, mesh.faces)


@pytest.mark.parametrize("how", ["axes", "icp"])
def test_a_known_motion_comes_back(egg, how):
    first, second = aligned([egg, moved(egg)], how)
    assert first.mesh is egg
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = TURN.T, -TURN.T @ SHIFT
    tolerance = 1e-9 if how == "axes" else 1e-4
    assert np.abs(second.world_from_file - back).max() < tolerance
    assert second.rms_before_m > 0.05
    assert second.rms_m < 1e-5


def test_given_stays(egg):
    other = moved(egg)
    _, second = aligned([egg, other], "given")
    assert second.mesh is other
    assert np.array_equal(second.world_from_file, np.eye(4))
    assert second.rms_m is None


@pytest.mark.parametrize("how", ["axes", "icp"])
def test_nothing_is_mirrored_or_scaled(egg, how):
    mirror = TriangleMesh(egg.vertices * [-1.0, 1.0, 1.0], egg.faces[:, ::-1])
    _, second = aligned([egg, mirror], how)
    turn = second.world_from_file[:3, :3]
    assert np.linalg.det(turn) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(turn @ turn.T - np.eye(3)).max() < 1e-9
    assert second.rms_m > 1e-4


def test_icp_comes_nearer_than_axes_to_what_isnt_the_same(egg):
    bump = egg.vertices.copy()
    bump[bump[:, 2] > 0.08] *= 1.3
    other = moved(TriangleMesh(bump, egg.faces), TURN, 0.0 * SHIFT)
    axes, icp = (aligned([egg, other], how)[1].rms_m for how in ("axes", "icp"))
    assert icp <= axes


def test_axes_that_are_alike_leave_the_turn():
    ball, other = sphere(0.05), moved(sphere(0.05))
    _, second = aligned([ball, other], "axes")
    assert np.array_equal(second.world_from_file[:3, :3], np.eye(3))
    assert np.abs(second.world_from_file[:3, 3] + SHIFT).max() < 1e-9


def test_it_is_the_same_every_time(egg):
    once, again = (aligned([egg, moved(egg)], "icp")[1] for _ in range(2))
    assert np.array_equal(once.world_from_file, again.world_from_file)
