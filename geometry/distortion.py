"""Lens distortion of Brown and Conrady, k1, k2, p1, p2, k3 as in OpenCV.

With p = (x, y) = (X/Z, Y/Z), s = |p|^2 and a = (p2, p1), a pixel sees the p of::

    q(p) = p (1 + k1 s + k2 s^2 + k3 s^3) + s a + 2 (a.p) p
"""

import numpy as np

from .arrays import Array

# Beyond any lens; the roots of more may overflow.
_FINITE = 1e30
Terms = tuple[float, float, float, float, float]


def distorted(p: Array, terms: Terms) -> Array:
    """Return q of points p, shape (..., 2)."""
    k1, k2, p1, p2, k3 = terms
    x, y = p[..., 0], p[..., 1]
    s = x * x + y * y
    radial = 1.0 + s * (k1 + s * (k2 + s * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )


def slope(p: Array, terms: Terms) -> Array:
    """Return the derivative dq/dp, symmetric, shape (..., 2, 2)."""
    k1, k2, p1, p2, k3 = terms
    x, y = p[..., 0], p[..., 1]
    s = x * x + y * y
    radial = 1.0 + s * (k1 + s * (k2 + s * k3))
    slope = 2.0 * (k1 + s * (2.0 * k2 + 3.0 * s * k3))
    cross = x * y * slope + 2.0 * (p1 * x + p2 * y)
    rows = [
        [radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, cross],
        [cross, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def fold(terms: Terms) -> float:
    """Return the |p| from which on the model may fold the image; inf: it doesn't.

    Nearer to the axis dq/dp is positive definite, so that no two rays share a pixel,
    since there, with r = |p|::

        1 + 3 k1 r^2 + 5 k2 r^4 + 7 k3 r^6 > 7 |a| r
    """
    k1, k2, p1, p2, k3 = np.clip(terms, -_FINITE, _FINITE).tolist()
    aside = 7.0 * float(np.hypot(p1, p2))
    # In 1/r, of which the first coefficient is 1 whatever the lens.
    roots = np.roots([1.0, -aside, 3.0 * k1, 0.0, 5.0 * k2, 0.0, 7.0 * k3])
    nearest = float(roots.real[roots.imag == 0.0].max(initial=0.0))
    return 1.0 / nearest if nearest > 0.0 else float("inf")


def least_at(r: float, terms: Terms) -> float:
    """Return the least |q| of all p with |p| = r, or less than it."""
    k1, k2, p1, p2, k3 = terms
    s = r * r
    radial = 1.0 + s * (k1 + s * (k2 + s * k3))
    return r * radial - 3.0 * s * float(np.hypot(p1, p2))
