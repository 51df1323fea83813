"""Rigs of coded pixels that a calibration left off, and where they put points."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.dense_rigs import camera_at, dense_scanner, projector_at

from geometry.shapes.primitives import sphere
from planning.experiments.acceptance.rigs_off import displaced
from planning.verify.reconstruction.reconstruct import reconstruct


@pytest.fixture(scope="module")
def scanner():
    return dense_scanner(
        sphere(0.05, subdivisions=4),
        [projector_at("P1", (0.2, -0.6, 0.1))],
        [camera_at("C1", (-0.05, -0.7, 0.05)), camera_at("C2", (0.1, -0.65, 0.25))],
        min_angle=0.05,
        max_angle=1.5,
    )


@pytest.fixture(scope="module")
def cloud(scanner):
    found = reconstruct(scanner, seed=1, threads=1).everything
    assert np.any(found.ring < -1)
    return found


def moved(device, motion):
    pose = motion @ device.world_from_device
    if hasattr(device, "world_from_ring"):
        return replace(device, world_from_device=pose, world_from_ring=pose)
    return replace(device, world_from_device=pose)


def test_a_rig_that_is_moved_as_a_whole_takes_its_points_along(scanner, cloud):
    """Points by projector and camera, and those by two cameras."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix()
    motion[:3, 3] = [1e-3, -2e-3, 5e-4]
    taken = replace(
        scanner,
        projectors=tuple(moved(one, motion) for one in scanner.projectors),
        cameras=tuple(moved(one, motion) for one in scanner.cameras),
    )
    there = cloud.points @ motion[:3, :3].T + motion[:3, 3]
    shift = displaced(cloud, scanner, taken)
    assert shift == pytest.approx(there - cloud.points, abs=1e-9)


def test_a_projector_that_is_off_moves_only_what_it_measured(scanner, cloud):
    """Along the camera's ray, by its displacement over the sine of the angle."""
    aside = np.eye(4)
    aside[:3, 3] = [2e-5, 0.0, 0.0]
    (projector,) = scanner.projectors
    taken = replace(scanner, projectors=(moved(projector, aside),))
    shift = displaced(cloud, scanner, taken)
    by_cameras = cloud.ring < -1
    assert np.all(shift[by_cameras] == 0.0)
    rays, beams = cloud.rays[~by_cameras], cloud.beams[~by_cameras]
    across = rays - np.einsum("ij,ij->i", rays, beams)[:, None] * beams
    along = (across @ aside[:3, 3]) / np.einsum("ij,ij->i", across, across)
    off = shift[~by_cameras] - along[:, None] * rays
    assert np.linalg.norm(off, axis=1).max() < 0.05 * np.abs(along).max()
