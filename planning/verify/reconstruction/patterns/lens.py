"""The Brown-Conrady lens of the checker, written apart from `geometry.devices`.

With p = (x, y) in normalised coordinates and s = |p|^2::

    x (1 + k1 s + k2 s^2 + k3 s^3) + 2 p1 x y + p2 (s + 2 x^2)
    y (1 + k1 s + k2 s^2 + k3 s^3) + p1 (s + 2 y^2) + 2 p2 x y
"""

import numpy as np

from planning.verify.reconstruction.arrays import Array

_STEPS = 60
_TOLERANCE = 1e-13


def bent(flat: Array, distortion: tuple[float, ...]) -> Array:
    """Return where a lens k1, k2, p1, p2, k3 images normalised points, (n, 2)."""
    x, y = flat.T
    radial, shift_x, shift_y = _terms(x, y, distortion)
    return np.column_stack([x * radial + shift_x, y * radial + shift_y])


def unbent(flat: Array, distortion: tuple[float, ...]) -> Array:
    """Return the normalised points that a lens images at these, shape (n, 2).

    By the fixed point ``p = (q - tangential(p)) / radial(p)``; NaN where that doesn't
    settle: no point of the scene is imaged there.
    """
    qx, qy = flat.T
    x, y = qx, qy
    change = np.full_like(qx, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            radial, shift_x, shift_y = _terms(x, y, distortion)
            new_x, new_y = (qx - shift_x) / radial, (qy - shift_y) / radial
            change = np.abs(new_x - x) + np.abs(new_y - y)
            x, y = new_x, new_y
            if np.all(change < _TOLERANCE):
                break
    settled = change < 1e3 * _TOLERANCE
    return np.column_stack([np.where(settled, x, np.nan), np.where(settled, y, np.nan)])


def _terms(
    x: Array, y: Array, distortion: tuple[float, ...]
) -> tuple[Array, Array, Array]:
    """Radial factor and the two tangential shifts."""
    k1, k2, p1, p2, k3 = distortion
    xx, xy, yy = x * x, x * y, y * y
    s = xx + yy
    radial = 1.0 + k1 * s + k2 * s**2 + k3 * s**3
    return (
        radial,
        2.0 * p1 * xy + p2 * (s + 2.0 * xx),
        p1 * (s + 2.0 * yy) + (2.0 * p2 * xy),
    )
