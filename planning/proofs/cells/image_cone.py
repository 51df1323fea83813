"""What holds for a whole image, wherever in it a point appears.

The cone about one axis that holds every viewing ray, and the least that turning the ray
by a little moves the pixel. With p = (x/z, y/z), rho = |p| and q(p) the distorted p::

    J_r = dr/dp (dq/dp)^-1 diag(1/fx, 1/fy),    dr/dp stretches by cos^2 or more

so for v across the ray, |J_r^T v| >= |v| cos^2(off axis) / (max(fx, fy) |dq/dp|).

With lens distortion, what counts as inside the image is every point that the lens model
puts there before it folds. All of them have::

    rho (1 + k1 rho^2 + k2 rho^4 + k3 rho^6) - 3 (|p1| + |p2|) rho^2 <= R

where R reaches the image's farthest corner, and up to the largest such rho::

    |dq/dp| <= 1 + 3 |k1| rho^2 + 5 |k2| rho^4 + 7 |k3| rho^6 + 7 (|p1| + |p2|) rho
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel

_ROUNDING = 1e-9
# Roots of the polynomials are exact to this, with much to spare.
_ROOTS = 1e-5


@dataclass(frozen=True, eq=False)
class ImageCone:
    """Bounds that hold for every point in the image of a camera.

    Attributes:
        axis: Unit axis of a cone in the device frame, shape (3,).
        half_angle: No viewing ray is farther from the axis [rad].
        off_axis: Nor from the optical axis [rad], at most pi/2.
        least_turn: |J_r^T v| >= least_turn |v| for v across the ray [1/px].
    """

    axis: NDArray[np.float64]
    half_angle: float
    off_axis: float
    least_turn: float


def image_cone(device: PinholeModel) -> ImageCone:
    """Return the bounds for a camera's image."""
    if any(device.distortion):
        return _distorted_cone(device)
    axis, corners = device.middle_ray, device.rays(device.corners)
    if not np.all(corners @ axis > 0.0):
        axis = np.array([0.0, 0.0, 1.0])
    # The image is a convex polygon of rays in one half space of the axis: none of them
    # is farther from it than the farthest corner.
    half = float(np.arccos(np.clip(corners @ axis, -1.0, 1.0)).max())
    off = float(np.arccos(np.clip(corners[:, 2], -1.0, 1.0)).max())
    return _cone(device, axis, half, off, 1.0)


def _cone(
    device: PinholeModel,
    axis: NDArray[np.float64],
    half_angle: float,
    off_axis: float,
    stretch: float,
) -> ImageCone:
    focal = float(max(device.camera_matrix[0, 0], device.camera_matrix[1, 1]))
    least = np.cos(off_axis) ** 2 / (focal * stretch)
    return ImageCone(
        axis, half_angle + _ROUNDING, off_axis, float(least) * (1.0 - _ROUNDING)
    )


def _distorted_cone(device: PinholeModel) -> ImageCone:
    reach = float(np.hypot(*np.abs(device.sides()).max(axis=0)))
    rho = _farthest(device, reach)
    axis = np.array([0.0, 0.0, 1.0])
    k1, k2, p1, p2, k3 = np.abs(device.distortion)
    s = rho * rho
    stretch = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3))
    stretch += 7.0 * (p1 + p2) * rho
    off = float(np.arctan(rho))
    return _cone(device, axis, off, off, float(stretch))


def _farthest(device: PinholeModel, reach: float) -> float:
    """Return the largest rho that the lens model may put into the image."""
    k1, k2, p1, p2, k3 = device.distortion
    aside = 3.0 * (abs(p1) + abs(p2))
    beyond_reach = np.array([k3, 0.0, k2, 0.0, k1, -aside, 1.0, -reach])
    roots = np.roots(beyond_reach)
    real = roots.real[np.abs(roots.imag) <= _ROOTS * (1.0 + np.abs(roots))]
    rho = float(real.max(initial=reach)) * (1.0 + _ROOTS) + _ROOTS
    # From the largest root on all are beyond, or none.
    leaves = np.polyval(beyond_reach, 2.0 * rho + 1.0) > 0.0
    return min(rho, device.fold) if leaves else device.fold
