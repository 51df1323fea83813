"""Devices that are moved: what of their frames stays what it was."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from support.factories import make_projector, make_rig

from planning.model.devices.device_poses import moved_to
from planning.report.entries.device_entries import rounded_projector


def _poses(n):
    rng = np.random.default_rng(8)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = Rotation.random(n, rng=rng).as_matrix()
    poses[:, :3, 3] = rng.normal(size=(n, 3))
    return poses


def test_a_ring_frame_that_is_the_devices_own_stays_so_to_the_last_bit():
    """However often it is moved, and as it is written: a code has no rings."""
    projector = make_projector(make_rig(), np.array([0.1]))
    projector = replace(projector, world_from_ring=projector.world_from_device)
    for pose in _poses(100):
        projector = moved_to(projector, pose)
        assert np.array_equal(projector.world_from_ring, projector.world_from_device)
        written = rounded_projector(projector, "P1")
        assert np.array_equal(written.world_from_ring, written.world_from_device)


def test_any_other_moves_along():
    projector = make_projector(make_rig(), np.array([0.1]))
    first, second, ring = _poses(3)
    aside = replace(moved_to(projector, first), world_from_ring=first @ ring)
    moved = moved_to(aside, second)
    assert np.allclose(moved.world_from_ring, second @ ring, atol=1e-12)
