"""How much of an object a device has in its field: the ball about it, or a rectangle.

An object *overflows* a field if the ball about it does: of radius R, at the working
distance s + R (standoff s), the ball shows within asin(R / (s + R)) of the middle of
the image. In parallel light its shadow is a disc of radius R.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel

Device = PinholeModel | ParallelModel


def overflows(device: Device, object_radius: float, standoff: float) -> bool:
    """Return whether the ball about an object is wider than a device's field.

    Args:
        device: Optics.
        object_radius: Radius R of the sphere that holds the object [m].
        standoff: From the device to that sphere [m].
    """
    if isinstance(device, ParallelModel):
        reach = min(float(device.half_panel.min()), device.beam_radius or np.inf)
        return not object_radius <= reach
    return not holds_ball(device, object_radius, standoff + object_radius)


def holds_ball(device: PinholeModel, radius: float, distance: float) -> bool:
    """Return whether a sphere about the aim lies inside the image.

    Args:
        device: Optics.
        radius: Of the sphere [m].
        distance: From the device to its centre [m].
    """
    width, height = device.resolution
    x, y = (width - 1) / 2, (height - 1) / 2
    edges = np.array([[-0.5, y], [x, -0.5], [width - 0.5, y], [x, height - 0.5]])
    half_angle = np.arccos(np.clip(device.rays(edges) @ middle_ray(device), -1.0, 1.0))
    return bool(radius < distance and np.arcsin(radius / distance) <= half_angle.min())


def middle_ray(device: Device) -> NDArray[np.float64]:
    """Return the direction in which the middle of the image looks, unit, shape (3,)."""
    if isinstance(device, ParallelModel):
        return np.array([0.0, 0.0, 1.0])
    return device.rays(0.5 * (np.array(device.resolution) - 1.0))


def half_rectangle(device: Device, distance: float) -> NDArray[np.float64]:
    """Return half the sides of a rectangle that the field holds, in [m], shape (2,).

    It is across the line of sight, sides along the image's, its middle on the aim. In
    a round beam, of the rectangles inside, the one that is nearest to a square.

    Args:
        device: Optics.
        distance: From the device to the rectangle [m]; in parallel light it is nothing.
    """
    if isinstance(device, ParallelModel):
        half, beam = device.half_panel, device.beam_radius
        if beam is None or beam >= np.hypot(*half):
            return half
        short = min(float(half.min()), beam / np.sqrt(2.0))
        return np.minimum(half, max(short, np.sqrt(beam**2 - short**2)))
    width, height = device.resolution
    u, v = np.array([-0.5, width - 0.5]), np.array([-0.5, height - 0.5])
    corners = device.rays(np.stack(np.meshgrid(u, v), axis=-1).reshape(4, 2))
    across = corners @ turned_to(middle_ray(device)).T
    # With lens shift the image is a trapezoid across the line of sight.
    return distance * np.min(np.abs(across[:, :2] / across[:, 2:]), axis=0)


def turned_to(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the smallest rotation that takes a unit direction to +z (Rodrigues)."""
    axis = np.cross(direction, [0.0, 0.0, 1.0])
    skew = np.array(
        [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]
    )
    return np.eye(3) + (skew + skew @ skew / (1.0 + direction[2]))
