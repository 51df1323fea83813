"""What errors of a calibration do to a measured point, and with it to its accuracy.

An error of a camera moves its viewing ray at P by dX, one of a projector its surface of
equal code by dY. With v = r x (N x m) the point so moves along the normal by::

    e_N = (v.dX + (N.r) (m.dY)) / (r.m)

A turn by d moves by d x (P - O), pixels off by p by t J_r p: the principal point all by
the same, the focal length, as a share e, by e times what they are off the principal
point. With g = J_r^T v and v.(P - O) = 0 these are t |v|, t |g| and t g.(u - u_0). For
surfaces of equal code `codes.surfaces` has the same three.
"""

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.calibration_errors import CalibrationErrors

from .camera_limits import ViewedSamples

_Array = NDArray[np.float64]


def surface_deviation(errors: CalibrationErrors, levers: _Array) -> _Array:
    """Return the standard deviation along m of surfaces of equal code in [m], (...)."""
    each = np.array([errors.about_axis, errors.focal, errors.along_line_px])
    # Column by column: sums over rows of three are slow.
    turned, longer, shifted = np.moveaxis(np.square(levers * each), -1, 0)
    return np.sqrt(errors.along_axis_m**2 + (turned + longer + shifted))


def ray_deviation(
    errors: CalibrationErrors, seen: ViewedSamples, v: _Array, g: _Array
) -> _Array:
    """Return the standard deviation of v.dX of viewing rays in [m], (n,); g is (n, 2).

    With ``s_a`` and ``s_x`` of a turn and a displacement, ``s_f`` and ``s_u``::

        (s_x^2 + s_a^2 t^2) |v|^2 + t^2 (s_f^2 (g.(u - u_0))^2 + s_u^2 |g|^2)
    """
    t = seen.distances
    moved = errors.along_axis_m**2 + np.square(errors.about_axis * t)
    longer = errors.focal * np.einsum("ij,ij->i", g, seen.off_centre)
    shifted = errors.along_line_px**2 * np.einsum("ij,ij->i", g, g)
    image = np.square(t) * (np.square(longer) + shifted)
    return np.sqrt(moved * np.einsum("ij,ij->i", v, v) + image)


def calibration_px(errors: CalibrationErrors, t: _Array, per_px: _Array) -> _Array:
    """Return the edge noise that does to a point what a camera's errors do [px], (...).

    For programs, which propose: at distances t [m], where a pixel turns the ray by
    `per_px` [rad] in every direction, and without the focal length.
    """
    turn = np.hypot(errors.about_axis, errors.along_axis_m / t)
    return np.hypot(turn / per_px, errors.along_line_px)
