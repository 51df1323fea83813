"""Ring radii at equal steps of a density: fine where the surface bends, limited.

`docs/method/rings.md`, "Spacing": radii at equal steps of the integral of sqrt(kappa)
dR bound the largest interpolation error. Here the density of rings is::

    d(c) = clip(s sqrt(kappa(c)), 1/h_max(c), 1/h_min(c))

in rings per unit of the ring coordinate c, and s is such that as many rings result as
are wanted. Where h_min > h_max, h_min wins: what no camera separates are no rings.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

_HALVINGS = 60
_FLAT = 1e-300
# Logarithms of scales at which only h_max, or only h_min, decides.
_LEAST, _MOST = -60.0, 60.0


@dataclass(frozen=True, eq=False)
class GapLimits:
    """What bounds the gap of rings at each ring coordinate, shape (n,) each.

    Attributes:
        edges: Borders of equal cells of the ring coordinate, from 0 to the outermost
            ring, shape (n + 1,).
        kappa: Second derivative of the height along the beam, in [m] per squared unit
            of the ring coordinate; 0 where nothing is known.
        coarsest: h_max, positive.
        finest: h_min, positive.
        free: Where nothing is lit, so that any gap will do.
    """

    edges: NDArray[np.float64]
    kappa: NDArray[np.float64]
    coarsest: NDArray[np.float64]
    finest: NDArray[np.float64]
    free: NDArray[np.bool_]

    def density(self, scale: float) -> NDArray[np.float64]:
        """Return d(c) for a scale s of sqrt(kappa), shape (n,)."""
        wish = np.maximum(scale * np.sqrt(self.kappa), 1.0 / self.coarsest)
        return np.minimum(wish, 1.0 / self.finest)


def spaced_radii(
    limits: GapLimits, n_rings: int, tolerance: float = np.inf
) -> NDArray[np.float64]:
    """Return ring radii at equal steps of the integral of the density.

    As many as wanted; more where h_max asks for them, fewer where h_min doesn't let
    that many in. What is left of a gap then goes to the free cells.

    With e_tol the tolerance [m] of a chord along the beam, no gap is wider than sqrt(8
    e_tol / kappa).

    Returns:
        Rising, at least 2, the last the outermost ring.
    """
    gap = np.sqrt(8.0 * tolerance / np.maximum(limits.kappa, _FLAT))
    limits = replace(limits, coarsest=np.minimum(limits.coarsest, gap))
    cell = np.diff(limits.edges)
    density = limits.density(_scale(limits, float(n_rings)))
    total = float(np.sum(density * cell))
    number = max(2, int(np.ceil(total - 1e-6)))
    spare = float(cell[limits.free].sum())
    if spare > 0.0:
        density = density + np.where(limits.free, (number - total) / spare, 0.0)
    counted = np.concatenate([[0.0], np.cumsum(density * cell)])
    steps = np.arange(1, number + 1) * (counted[-1] / number)
    radii = np.interp(steps, counted, limits.edges)
    radii[-1] = limits.edges[-1]
    return _with_centre(radii, limits)


def _with_centre(radii: NDArray[np.float64], limits: GapLimits) -> NDArray[np.float64]:
    """Halve the innermost ring, or add one inside where a gap would be too wide."""
    half = 0.5 * radii[1]
    if radii[0] <= half:
        return radii
    begin, end = limits.edges[:-1], limits.edges[1:]
    held = ~limits.free & (end > half) & (begin < radii[1])
    if half <= limits.coarsest[held].min(initial=np.inf):
        return np.concatenate([[half], radii[1:]])
    return np.concatenate([[0.5 * radii[0]], radii])


def _scale(limits: GapLimits, wanted: float) -> float:
    """Return the s at which so many rings fit, by bisection of its logarithm.

    Where h_max asks for more or h_min for fewer, the end of the range.
    """
    cell = np.diff(limits.edges)
    low, high = _LEAST, _MOST
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if float(np.sum(limits.density(float(np.exp(middle))) * cell)) < wanted:
            low = middle
        else:
            high = middle
    return float(np.exp(low))
