"""Poses as 4 x 4 matrices named ``b_from_a``, so that products cancel.

A matrix named ``b_from_a`` maps coordinates in frame ``a`` to frame ``b``::

    c_from_a = c_from_b @ b_from_a

Device frames are right-handed with +x right, +y down and +z along the optical axis
(OpenCV, COLMAP; the ``_optical`` frames of ROS REP 103).
"""

import numpy as np

from .arrays import Array, lengths


def look_at(positions: Array, targets: Array, up: Array, *, roll: float = 0.0) -> Array:
    """Return ``world_from_device`` for devices that look at targets.

    Where a device looks straight along ``up``, the world axis least along it takes
    the place of ``up``.

    Args:
        positions: Optical centres in [m], shape (n, 3) or (3,).
        targets: Points on the optical axes in [m], broadcast against positions.
        up: World direction that appears upwards (-y) in the image, shape (3,).
        roll: Turn of the device about its own axis, from +x towards +y, in [rad].

    Raises:
        ValueError: If a target is at its position.
    """
    positions, targets = np.broadcast_arrays(
        np.asarray(positions, dtype=np.float64), np.asarray(targets, dtype=np.float64)
    )
    z = targets - positions
    length = lengths(z)[..., None]
    if not np.all(length > 0):
        raise ValueError("a target coincides with its position: no viewing direction")
    z = z / length
    up = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    spare = np.eye(3)[np.argmin(np.abs(up))]
    along = np.abs(z @ up)[..., None] > 1.0 - 1e-9
    x = np.cross(z, np.where(along, spare, up))
    x = x / lengths(x)[..., None]
    y = np.cross(z, x)
    c, s = np.cos(roll), np.sin(roll)
    poses = np.zeros((*z.shape[:-1], 4, 4))
    poses[..., :3, 0] = c * x + s * y
    poses[..., :3, 1] = c * y - s * x
    poses[..., :3, 2] = z
    poses[..., :3, 3] = positions
    poses[..., 3, 3] = 1.0
    return poses


def inverse(b_from_a: Array) -> Array:
    """Return ``a_from_b`` of rigid matrices, shape (..., 4, 4)."""
    turned = np.swapaxes(b_from_a[..., :3, :3], -1, -2)
    result = np.zeros_like(b_from_a)
    result[..., :3, :3] = turned
    result[..., :3, 3] = -(turned @ b_from_a[..., :3, 3:])[..., 0]
    result[..., 3, 3] = 1.0
    return result


def transform(b_from_a: Array, points: Array) -> Array:
    """Return points (n, 3) of frame a in frame b."""
    return points @ b_from_a[:3, :3].T + b_from_a[:3, 3]


def fibonacci_cap(
    n: int, axis: Array, half_angle: float, *, start: Array | None = None
) -> Array:
    """Return n unit vectors spread evenly over a spherical cap, from the axis outwards.

    Args:
        n: Number of directions, at least 1.
        axis: Centre of the cap, shape (3,).
        half_angle: Opening of the cap in [rad]; pi is the whole sphere.
        start: Unit direction across the axis from which azimuth counts, shape (3,);
            default one that a world axis gives.
    """
    axis = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    e1 = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]) if start is None else start
    e1 = e1 / np.linalg.norm(e1)
    e2 = np.cross(axis, e1)
    i = np.arange(n)
    height = 1.0 - (1.0 - np.cos(half_angle)) * (i + 0.5) / n
    around = i * (np.pi * (3.0 - np.sqrt(5.0)))
    radius = np.sqrt(np.clip(1.0 - height * height, 0.0, None))[:, None]
    return (
        height[:, None] * axis
        + radius * np.cos(around)[:, None] * e1
        + radius * np.sin(around)[:, None] * e2
    )


def horizontal_axes(up: Array) -> tuple[Array, Array]:
    """Return the world axis after that of `up`, from which pan counts, and up x it."""
    first = np.eye(3)[(int(np.argmax(np.abs(up))) + 1) % 3]
    return first, np.asarray(np.cross(up, first), dtype=np.float64)


def pan_tilt_roll(turns: Array, up: Array) -> Array:
    """Return the angles of devices about a world axis `up`, (..., 3, 3) to (..., 3).

    With e1, e2 the `horizontal_axes` and x, z columns of the rotation::

        pan = atan2(z.e2, z.e1),   tilt = asin(z.up)
        roll = atan2(x.(z x level), x.level),   level = sin(pan) e1 - cos(pan) e2

    in [rad]: pan turns about up, tilt raises the axis over the horizon, roll turns the
    device clockwise as it looks. One that looks along up has roll 0.
    """
    first, second = horizontal_axes(up)
    x, z = turns[..., :, 0], turns[..., :, 2]
    sine: Array = np.clip(z @ up, -1.0, 1.0)
    upright = np.abs(sine) > 1.0 - 1e-12
    pan = np.where(
        upright,
        np.arctan2(x @ first, -(x @ second)),
        np.arctan2(z @ second, z @ first),
    )
    level = np.sin(pan)[..., None] * first - np.cos(pan)[..., None] * second
    aside = np.einsum("...i,...i->...", x, np.cross(z, level))
    roll = np.arctan2(aside, np.einsum("...i,...i->...", x, level))
    angles: Array = np.stack(
        [pan, np.arcsin(sine), np.where(upright, 0.0, roll)], axis=-1
    )
    return angles + 0.0


def turns_of(angles: Array, up: Array) -> Array:
    """Return the rotations of devices of a pan, tilt and roll, (..., 3) to (..., 3, 3).

    The inverse of `pan_tilt_roll`.
    """
    first, second = horizontal_axes(up)
    pan, tilt, roll = (angles[..., k, None] for k in range(3))
    level = np.sin(pan) * first - np.cos(pan) * second
    heading = np.cos(pan) * first + np.sin(pan) * second
    z = np.cos(tilt) * heading + np.sin(tilt) * up
    x = np.cos(roll) * level + np.sin(roll) * np.cross(z, level)
    return np.stack([x, np.cross(z, x), z], axis=-1)
