"""Projection and lens distortion, written anew for the audit.

Where the planner differentiates by hand, this module differentiates its own projection
numerically: an error of sign or of order shows as a difference of areas.
"""

from functools import cache

import numpy as np

from geometry.arrays import Array, Mask, cross, lengths
from geometry.devices import PinholeModel

_STEP = 1e-5
_INVERSIONS = 30
_ANGLES = 90_001


def dot(a: Array, b: Array) -> Array:
    """Return the scalar products of vectors (n, 3), shape (n,)."""
    return np.einsum("ij,ij->i", a, b)


def towards(points: Array, origin: Array) -> tuple[Array, Array]:
    """Return unit directions from an origin to points (n, 3), and distances (n,)."""
    offset = points - origin
    length = lengths(offset)
    with np.errstate(invalid="ignore"):
        return offset / length[:, None], length


def in_frame(world_from_frame: Array, points: Array) -> Array:
    """Return world points (n, 3) in a frame: R^T (P - t)."""
    return (points - world_from_frame[:3, 3]) @ world_from_frame[:3, :3]


def in_world(world_from_frame: Array, directions: Array) -> Array:
    """Return directions (n, 3) of a frame in the world: R d."""
    return directions @ world_from_frame[:3, :3].T


def pixels_of(device: PinholeModel, local: Array) -> Array:
    """Return where points in front of a device appear, (n, 3) to (n, 2) [px].

    OpenCV's model: x' = x/z, s = x'^2 + y'^2, radial factor 1 + k1 s + k2 s^2 + k3 s^3,
    tangential p1, p2, then K.
    """
    k1, k2, p1, p2, k3 = device.distortion
    x = local[:, 0] / local[:, 2]
    y = local[:, 1] / local[:, 2]
    bent_x, bent_y = x, y
    if any(device.distortion):
        s = x**2 + y**2
        radial = 1 + k1 * s + k2 * s**2 + k3 * s**3
        bent_x = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x**2)
        bent_y = y * radial + p1 * (s + 2 * y**2) + 2 * p2 * x * y
    (fx, skew, cx), (_, fy, cy) = device.camera_matrix[:2]
    return np.column_stack([fx * bent_x + skew * bent_y + cx, fy * bent_y + cy])


def rays_of(device: PinholeModel, pixels: Array) -> Array:
    """Return unit directions (n, 3) in the device's frame of pixels (n, 2).

    By fixed point: what `pixels_of` misses a pixel by is taken off, until it settles.
    """
    focal = np.diag(device.camera_matrix)[:2]
    local = np.ones((len(pixels), 3))
    local[:, :2] = (pixels - device.camera_matrix[:2, 2]) / focal
    for _ in range(_INVERSIONS):
        local[:, :2] += (pixels - pixels_of(device, local)) / focal
    return local / lengths(local)[:, None]


def in_image(device: PinholeModel, local: Array) -> Mask:
    """Return whether points (n, 3) appear in a device's image, shape (n,).

    In front of it, before its lens folds; pixel centres are integers.
    """
    ahead = local[:, 2] > 0
    some, (width, height) = local[ahead], device.resolution
    u, v = pixels_of(device, some).T
    inside = (u >= -0.5) & (u <= width - 0.5) & (v >= -0.5) & (v <= height - 0.5)
    if any(device.distortion):
        off_axis = np.arctan2(np.hypot(some[:, 0], some[:, 1]), some[:, 2])
        inside &= off_axis < _fold(tuple(device.distortion))
    ahead[ahead] = inside
    return ahead


@cache
def _fold(distortion: tuple[float, ...]) -> float:
    """Angle to the axis from which on a lens model folds the image [rad].

    To a thousandth of a degree: where the pixel of a ray that is turned outwards first
    stops to move outwards, at the least whichever way it is turned.
    """
    k1, k2, p1, p2, k3 = distortion
    angles = np.linspace(0.0, 0.5 * np.pi, _ANGLES, endpoint=False)
    r = np.tan(angles)
    outwards = 1 + 3 * k1 * r**2 + 5 * k2 * r**4 + 7 * k3 * r**6
    folds = outwards <= 7 * np.hypot(p1, p2) * r
    return float(angles[np.argmax(folds)]) if folds.any() else float(np.pi / 2)


def pixel_gradient(device: PinholeModel, local: Array, across: Array) -> Array:
    """Return g = J_r^T v [1/px], (n, 2), of vectors v (n, 3) across the viewing rays.

    The image shifts by A = d pixel / d(turn of the ray about the optical centre) along
    two directions e1, e2 perpendicular to the ray r, taken by central differences; then
    J_r = E A^-1 with E = [e1 e2], and g = A^-T E^T v. All in the camera's own frame.
    """
    r = local / lengths(local)[:, None]
    (x, y, z), zero = r.T, np.zeros(len(r))
    # Across the first axis, or where it is too near to the ray across the second.
    e1 = np.where(np.abs(x) < 0.7, [zero, z, -y], [-z, zero, x]).T
    e1 /= lengths(e1)[:, None]
    e2 = cross(r, e1)
    a, b = (
        (pixels_of(device, r + _STEP * e) - pixels_of(device, r - _STEP * e))
        / (2 * _STEP)
        for e in (e1, e2)
    )
    determinant = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    p, q = dot(e1, across), dot(e2, across)
    g_u = (p * b[:, 1] - q * a[:, 1]) / determinant
    g_v = (q * a[:, 0] - p * b[:, 0]) / determinant
    return np.column_stack([g_u, g_v])


def lens_shifts(
    device: PinholeModel, local: Array, gradient: Array
) -> tuple[Array, Array]:
    """Return what a focal length twice as long, and 1 px, move rays by [m], (n,) each.

    Along the vectors of a `pixel_gradient` at points (n, 3) in the device's frame.
    """
    off_centre = pixels_of(device, local) - device.camera_matrix[:2, 2]
    reach = lengths(local)
    return reach * dot(gradient, off_centre), reach * np.hypot(*gradient.T)
