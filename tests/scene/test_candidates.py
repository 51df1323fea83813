"""Candidates fill the workspace, look at the object, and carry their rings along."""

import numpy as np
import pytest

from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import inverse, transform
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import TriangulationLimits, Workspace
from planning.rings.ring_radii import ring_gap, uniform_radii
from planning.scene.lights import light_of, ring_frame
from planning.scene.workspace.candidates import Candidates, aimed_poses
from planning.scene.workspace.shell_positions import shell_positions

CENTRE = (0.1, -0.2, 0.3)
SHIFTED = PinholeModel(
    np.array([[1500.0, 0, 511.5], [0, 1500.0, 880.0], [0, 0, 1]]),
    (1024, 768),
    (0.9, 2.0),
)
CAMERA = PinholeModel(
    np.array([[3478.0, 0, 1023.5], [0, 3478.0, 767.5], [0, 0, 1]]),
    (2048, 1536),
    (0.9, 2),
)
BEAM = ParallelModel((1024, 768), 8e-4, (0.4, 2.5))


def workspace(half_angle=np.pi, floor=None, axis=(0.0, -1.0, 0.0), radius=0.2):
    shell = (0.95 + radius, 1.05 + radius)
    return Workspace(
        CENTRE,
        radius,
        (0.0, 0.0, 1.0),
        axis,
        half_angle,
        shell,
        shell,
        floor,
        1,
        1,
        0.5,
    )


@pytest.mark.parametrize("half_angle", [np.pi, np.radians(40), np.radians(10)])
@pytest.mark.parametrize("floor", [None, -0.1, 0.5])
def test_positions_are_admissible_and_as_many_as_wanted(half_angle, floor):
    space = workspace(half_angle, floor)
    found = shell_positions(space, space.projector_radius_m, 300)
    offset = found - CENTRE
    if floor == 0.5 and half_angle < np.radians(15):
        assert len(found) == 0
        return
    assert len(found) >= 300
    assert np.allclose(np.linalg.norm(offset, axis=1), 1.2)
    angle = np.arccos(np.clip(-offset[:, 1] / 1.2, -1, 1))
    assert angle.max() <= half_angle + 1e-9
    if floor is not None:
        assert offset[:, 2].min() >= floor


def test_positions_leave_no_gap_in_the_shell():
    """640 directions: none is farther than 6 degrees from the nearest."""
    found = shell_positions(workspace(), (1.0, 1.0), 640) - CENTRE
    probes = np.random.default_rng(0).normal(size=(4000, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    nearest = np.arccos(np.clip(probes @ found.T, -1, 1)).min(axis=1)
    assert np.degrees(nearest.max()) < 6.0


@pytest.mark.parametrize("roll", [0.0, np.pi / 2])
@pytest.mark.parametrize("device", [SHIFTED, CAMERA, BEAM])
def test_the_middle_of_the_image_meets_the_aim(device, roll):
    positions = shell_positions(workspace(), (1.2, 1.2), 50)
    poses = aimed_poses(
        positions, np.array(CENTRE), np.array([0, 0, 1.0]), device, roll=roll
    )
    for pose, position in zip(poses, positions, strict=True):
        assert np.allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-12)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
        assert np.allclose(pose[:3, 3], position)
        local = transform(inverse(pose), np.array([CENTRE]))
        if device is BEAM:
            assert np.allclose(local[0, :2], 0.0, atol=1e-12)
        else:
            middle = (np.array(device.resolution) - 1) / 2
            assert np.allclose(device.project(local)[0], middle, atol=1e-6)


def test_up_is_up_in_the_image_also_with_lens_shift():
    positions = np.array([[0.1, -1.4, 0.3]])
    pose = aimed_poses(positions, np.array(CENTRE), np.array([0, 0, 1.0]), SHIFTED)[0]
    above = transform(inverse(pose), np.array([CENTRE]) + [0, 0, 0.01])
    below = transform(inverse(pose), np.array([CENTRE]))
    assert SHIFTED.project(above)[0, 1] < SHIFTED.project(below)[0, 1] - 1


def test_a_device_lies_on_its_side_only_where_the_object_overflows():
    def rolls(template, radius):
        return Candidates(template, workspace(radius=radius)).rolls

    camera = PlannedCamera("", np.eye(4), CAMERA)
    assert rolls(camera, 0.2) == (0.0,)
    assert rolls(camera, 0.4) == (0.0, np.pi / 2)
    beam = PlannedProjector("", "parallel", np.eye(4), np.eye(4), BEAM, np.ones(2))
    assert rolls(beam, 0.3) == (0.0,)
    assert rolls(beam, 0.35) == (0.0, np.pi / 2)


def test_candidates_are_as_many_as_wanted_whatever_their_roll():
    space = workspace(radius=0.4)
    camera = PlannedCamera("", np.eye(4), CAMERA)
    assert len(Candidates(camera, space).over(401)) >= 401
    projector = PlannedProjector(
        "", "diverging", np.eye(4), np.eye(4), SHIFTED, np.array([0.1, 0.2])
    )
    found = Candidates(projector, space).over(601)
    assert len(found) >= 601
    for candidate in found[:5]:
        device, ring = candidate.world_from_device, candidate.world_from_ring
        assert np.allclose(device[:3, 3], ring[:3, 3])


@pytest.mark.parametrize("azimuth", [0.0, 1.0, 3.0, -np.pi / 2])
def test_ring_axis_is_tilted_against_the_middle_of_the_image(azimuth):
    device_from_ring = ring_frame(np.eye(4), SHIFTED, 0.14, azimuth)
    turn = device_from_ring[:3, :3]
    assert np.allclose(turn.T @ turn, np.eye(3))
    assert np.linalg.det(turn) == pytest.approx(1.0)
    middle = SHIFTED.rays(np.array([511.5, 383.5]))
    assert np.arccos(turn[:, 2] @ middle) == pytest.approx(0.14)
    assert np.allclose(device_from_ring[:3, 3], 0.0)


def test_parallel_ring_axis_is_shifted_in_the_panel():
    shifted = ring_frame(np.eye(4), BEAM, 0.14, np.pi / 2)
    assert np.allclose(shifted[:3, :3], np.eye(3))
    assert np.allclose(shifted[:3, 3], [0.0, 0.14, 0.0])


@pytest.mark.parametrize("device", [SHIFTED, BEAM])
def test_outermost_ring_holds_the_object(device):
    """No point of the object's ball lies beyond it, whatever the azimuth."""
    tilt, radius, distance = 0.14, 0.2, 1.15
    outer = light_of(device).object_ring(tilt, radius, distance)
    ball = np.random.default_rng(1).normal(size=(4000, 3))
    ball *= radius / np.linalg.norm(ball, axis=1, keepdims=True)
    middle = (
        np.array([0, 0, 1.0])
        if device is BEAM
        else device.rays(np.array([511.5, 383.5]))
    )
    largest = 0.0
    for azimuth in np.linspace(0, 2 * np.pi, 12):
        frame = inverse(ring_frame(np.eye(4), device, tilt, azimuth))
        ring = transform(frame, ball + distance * middle)
        rho = np.hypot(ring[:, 0], ring[:, 1])
        largest = max(largest, (rho if device is BEAM else rho / ring[:, 2]).max())
    assert largest <= outer
    assert largest == pytest.approx(outer, rel=0.02)


def test_ring_gap_is_what_camera_and_projector_can_separate():
    limits = TriangulationLimits(0.1, 0.1, min_ring_pitch_px=6.0)
    assert ring_gap(SHIFTED, CAMERA, limits, 1.0) == pytest.approx(6 / (3478 * 0.5))
    sharper = PinholeModel(CAMERA.camera_matrix * 4, (8192, 6144), (0.9, 2))
    assert ring_gap(SHIFTED, sharper, limits, 1.0) == pytest.approx(3 / 1500)
    assert ring_gap(BEAM, sharper, limits, 1.0) == pytest.approx(3 * 8e-4)


def test_uniform_radii_end_at_the_outermost_in_equal_steps_no_wider_than_the_gap():
    radii = uniform_radii(0.31, 0.02)
    assert radii[-1] == pytest.approx(0.31)
    steps = np.diff(radii, prepend=0.0)
    assert np.allclose(steps, steps[0])
    assert 0.019 < steps[0] <= 0.02


def _offer(space):
    ring = ring_frame(np.eye(4), SHIFTED, 0.14, -np.pi / 2)
    template = PlannedProjector(
        "", "diverging", np.eye(4), ring, SHIFTED, np.linspace(0.01, 0.4, 40)
    )
    return Candidates(template, space)


def test_candidates_around_a_chosen_one_fill_the_gap_of_the_lattice():
    space = workspace()
    chosen = _offer(space).over(640)[200]
    found = _offer(space).around([chosen], 640, far=True)
    before, *after = (p.world_from_device[:3, 3] - CENTRE for p in (chosen, *found))
    # In the middle of the shell and at its far end by turns, each over the whole cap.
    radii = np.linalg.norm(after, axis=1)
    far = space.projector_radius_m[1]
    assert np.sum(np.abs(radii - 1.2) < 1e-9) == len(after) / 2
    assert np.sum((radii > far - 2e-4) & (radii < far)) == len(after) / 2
    after = 1.2 * np.array(after) / radii[:, None]
    angles = np.arccos(np.clip(np.array(after) @ before / 1.2**2, -1, 1))
    # 640 on a sphere: 4 pi / 640 sr each.
    assert np.degrees(angles.max()) == pytest.approx(8.0, abs=0.3)
    for half in (radii < 1.2 + 1e-9, radii > 1.2 + 1e-9):
        assert np.degrees(angles[half].max()) > 7.5
    probes = np.random.default_rng(1).normal(size=(20_000, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    probes = probes[probes @ before > 1.2 * np.cos(np.radians(7.5))]
    nearest = np.arccos(np.clip(probes @ np.array(after).T / 1.2, -1, 1)).min(axis=1)
    assert np.degrees(nearest.max()) < 1.5
    for projector in found[:5]:
        local = transform(inverse(projector.world_from_device), np.array([CENTRE]))
        middle = [[511.5, 383.5]]
        assert SHIFTED.project(local) == pytest.approx(np.array(middle), abs=1e-6)
        assert np.allclose(
            projector.world_from_ring,
            ring_frame(projector.world_from_device, SHIFTED, 0.14, -np.pi / 2),
        )


@pytest.mark.parametrize("floor", [None, 0.3])
def test_candidates_around_stay_in_cone_and_over_the_floor(floor):
    space = workspace(np.radians(40), floor)
    chosen = _offer(space).over(60)
    found = _offer(space).around(chosen, 60)
    offset = np.array([p.world_from_device[:3, 3] for p in found]) - CENTRE
    assert np.arccos(np.clip(-offset[:, 1] / 1.2, -1, 1)).max() <= np.radians(40) + 1e-9
    if floor is not None:
        assert offset[:, 2].min() >= floor
    assert 60 * len(chosen) * 0.5 < len(found) < 60 * len(chosen)


def test_nothing_chosen_offers_nothing_around():
    assert _offer(workspace()).around([], 640) == ()
