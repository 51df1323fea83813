import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.poses import (
    fibonacci_cap,
    horizontal_axes,
    inverse,
    look_at,
    pan_tilt_roll,
    transform,
    turns_of,
)

UP = np.array([0.0, 0.0, 1.0])


def test_the_axis_points_at_the_target_and_up_is_up_in_the_image() -> None:
    rng = np.random.default_rng(0)
    positions, targets = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    world_from_device = look_at(positions, targets, UP)
    rotation = world_from_device[:, :3, :3]
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, 1, 2),
        np.tile(np.eye(3), (50, 1, 1)),
        atol=1e-12,
    )
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0, rtol=1e-12)
    np.testing.assert_array_equal(world_from_device[:, :3, 3], positions)
    towards = targets - positions
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    np.testing.assert_allclose(rotation[:, :, 2], towards, atol=1e-12)
    # +x stays level, and -y (up in the image) has an upward part.
    np.testing.assert_allclose(rotation[:, :, 0] @ UP, 0.0, atol=1e-12)
    assert np.all(rotation[:, :, 1] @ UP < 0)


def test_one_device_and_common_targets_broadcast() -> None:
    one = look_at(np.array([1.0, 0, 0]), np.zeros(3), UP)
    assert one.shape == (4, 4)
    np.testing.assert_allclose(
        one[:3, :3], [[0, 0, -1], [1, 0, 0], [0, -1, 0]], atol=1e-15
    )
    several = look_at(np.array([[1.0, 0, 0], [0, 1, 0]]), np.zeros(3), UP)
    np.testing.assert_array_equal(several[0], one)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_looking_straight_along_up_still_gives_a_rotation(side: float) -> None:
    pose = look_at(np.array([0.0, 0, side]), np.zeros(3), UP)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(pose[:3, 2], [0, 0, -side], atol=1e-15)


def test_roll_turns_x_towards_y_about_the_axis() -> None:
    position, target = np.array([1.0, 2, 3]), np.array([0.0, 0.5, 0])
    level = look_at(position, target, UP)
    rolled = look_at(position, target, UP, roll=0.3)
    level_from_rolled = level[:3, :3].T @ rolled[:3, :3]
    expected = Rotation.from_rotvec([0, 0, 0.3]).as_matrix()
    np.testing.assert_allclose(level_from_rolled, expected, atol=1e-12)


def test_a_target_at_the_position_is_refused() -> None:
    with pytest.raises(ValueError, match="no viewing direction"):
        look_at(np.zeros(3), np.zeros(3), UP)
    with pytest.raises(ValueError, match="no viewing direction"):
        look_at(np.full(3, np.nan), np.zeros(3), UP)


def test_products_cancel_and_inverses_undo() -> None:
    rng = np.random.default_rng(1)
    b_from_a = look_at(rng.normal(size=(4, 3)), rng.normal(size=(4, 3)), UP)
    product = inverse(b_from_a) @ b_from_a
    np.testing.assert_allclose(product, np.tile(np.eye(4), (4, 1, 1)), atol=1e-12)
    points = rng.normal(size=(20, 3))
    there = transform(b_from_a[0], points)
    homogeneous = np.column_stack([points, np.ones(20)]) @ b_from_a[0].T
    np.testing.assert_allclose(there, homogeneous[:, :3], atol=1e-12)
    np.testing.assert_allclose(
        transform(inverse(b_from_a[0]), there), points, atol=1e-12
    )


def test_a_cap_is_evenly_filled_and_starts_at_its_axis() -> None:
    axis = np.array([1.0, 2.0, -2.0])
    half_angle = 0.7
    cap = fibonacci_cap(4000, axis, half_angle)
    np.testing.assert_allclose(np.linalg.norm(cap, axis=1), 1.0, rtol=1e-12)
    angle = np.arccos(np.clip(cap @ axis / 3.0, -1, 1))
    assert angle.max() < half_angle
    assert np.all(np.diff(angle) > 0)
    # Area of a cap grows as 1 - cos: the share within every angle is known.
    for part in (0.2, 0.4, 0.6):
        share = (1 - np.cos(part)) / (1 - np.cos(half_angle))
        assert (angle < part).mean() == pytest.approx(share, abs=1e-3)
    expected = axis / 3.0 * (1 + np.cos(half_angle)) / 2
    np.testing.assert_allclose(cap.mean(axis=0), expected, atol=1e-3)


def test_a_full_cap_is_the_sphere() -> None:
    sphere = fibonacci_cap(2000, UP, np.pi)
    np.testing.assert_allclose(sphere.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(sphere.T @ sphere / 2000, np.eye(3) / 3, atol=1e-3)
    assert fibonacci_cap(1, UP, 0.1).shape == (1, 3)


AXES = [np.array(v, dtype=float) for v in ([0, 0, 1], [0, 1, 0], [-1, 0, 0])]


@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("degrees", [-170.0, -30.0, 0.0, 90.0])
def test_pan_tilt_and_roll_turn_a_device_that_looks_along_the_first_axis(up, degrees):
    """About up, then about its level x, then clockwise about its own axis."""
    first, second = horizontal_axes(up)
    level = look_at(np.zeros(3), first, up)[:3, :3]
    assert pan_tilt_roll(level, up) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    pan, tilt, roll = 0.7, -0.4, np.radians(degrees)
    x = np.sin(pan) * first - np.cos(pan) * second
    turns = [
        Rotation.from_rotvec(pan * up),
        Rotation.from_rotvec(tilt * x),
    ]
    aimed = (turns[1] * turns[0]).as_matrix() @ level
    turn = Rotation.from_rotvec(roll * aimed[:, 2]).as_matrix() @ aimed
    assert pan_tilt_roll(turn, up) == pytest.approx([pan, tilt, roll])


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_device_that_looks_along_up_has_all_its_turn_in_the_pan(side):
    nearly, upright = (
        look_at(np.zeros(3), np.array([c * 0.6, c * 0.8, side]), UP)[:3, :3]
        for c in (1e-4, 0.0)
    )
    # The same turn about up, in small and in the limit.
    x = nearly[:, 0] * [1.0, 1.0, 0.0]
    upright = np.column_stack([x, np.cross([0.0, 0.0, side], x), [0.0, 0.0, side]])
    expected = [np.arctan2(0.8, 0.6), side * np.pi / 2, 0.0]
    assert pan_tilt_roll(upright, UP) == pytest.approx(expected)
    assert pan_tilt_roll(nearly, UP) == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize("up", AXES)
def test_turns_are_those_of_their_angles(up):
    rng = np.random.default_rng(5)
    half = np.array([np.pi, np.pi / 2, np.pi])
    angles = rng.uniform(-half, half, size=(40, 3))
    turns = turns_of(angles, up)
    assert pan_tilt_roll(turns, up) == pytest.approx(angles)
    identity = np.broadcast_to(np.eye(3), turns.shape)
    assert turns @ np.swapaxes(turns, 1, 2) == pytest.approx(identity)
    assert np.linalg.det(turns) == pytest.approx(1.0)
