"""The bundle adjustment: what changes bring all edges onto their rings.

Edges' distances from their rings in units of their noise, and changes in units of what
is expected of them; outliers among the edges hardly count::

    min  sum_i e_i(x)^2 / (1 + (e_i(x) / c)^2)  +  sum_j (x_j / s_j)^2

from where it is least with a c beyond what most edges are off. The derivatives are
written by hand and as exact as CasADi's.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array, Indices

from .bundle import Bundle
from .supposed import Supposed

# Deviations whose square is the most that an edge costs; 91 % efficient where noise
# is normal.
_OUTLYING = 3.0
# An edge that misses the object counts for so many deviations.
_MISSED = 200.0
# The first search is for so many of the edges, and ends sooner.
_MOST_EDGES, _NEAR, _SETTLED, _MOST_STEPS = 0.85, 1e-4, 1e-7, 40


@dataclass(frozen=True, eq=False)
class Adjusted:
    """What an adjustment found.

    Attributes:
        bundle: Edges, and how everything was supposed to stand.
        expected: What was expected of each unknown's change, 0: none, shape (k,).
        unit: Noise of the edges in units of sigma by which it is counted.
        x: The changes, shape (k,).
    """

    bundle: Bundle
    expected: Array
    unit: float
    x: Array

    @cached_property
    def free(self) -> Indices:
        """Unknowns that might change; shape (m,)."""
        return np.flatnonzero(self.expected)

    def changes(self, z: Array) -> Array:
        """Return changes (k,) of so many times the expected, (m,)."""
        x = np.zeros(len(self.expected))
        x[self.free] = self.expected[self.free] * z
        return x

    def residuals(self, z: Array, c: float = _OUTLYING) -> Array:
        """Return the roots of what edges, and then changes z, cost, (n + m,)."""
        return np.concatenate([_curbed(self._offsets(z), c)[0], z])

    def slopes(self, z: Array, c: float = _OUTLYING) -> Array:
        """Return their derivatives by z, (n + m, m)."""
        slopes = self.bundle.slopes(self.changes(z))[:, self.free]
        slopes *= self.expected[self.free] / self.unit
        slopes[~np.isfinite(slopes)] = 0.0
        weights = _curbed(self._offsets(z), c)[1]
        slopes = weights[:, None] * self.bundle.apart_from_relief(slopes)
        return np.vstack([slopes, np.eye(len(z))])

    def _offsets(self, z: Array) -> Array:
        off = self.bundle.offsets(self.changes(z)) / self.unit
        return self.bundle.apart_from_relief(np.where(np.isfinite(off), off, _MISSED))

    @property
    def z(self) -> Array:
        """The changes in units of what was expected, (m,)."""
        return self.x[self.free] / self.expected[self.free]

    @cached_property
    def cost(self) -> float:
        """What edges and changes still cost, about one for each edge."""
        return float(np.sum(self.residuals(self.z) ** 2))

    @cached_property
    def supposed(self) -> Supposed:
        """How everything stands after the changes."""
        return self.bundle.moved(self.x)

    @cached_property
    def offsets(self) -> Array:
        """Distances of edges from their rings after it, as of `Bundle.offsets`."""
        return self.bundle.offsets(self.x)

    @cached_property
    def scatter(self) -> float:
        """Deviation of the edges from their rings in units of sigma, by the median."""
        off = self.bundle.apart_from_relief(np.nan_to_num(self.offsets))
        return 1.4826 * float(np.median(np.abs(off)))

    @cached_property
    def covariance(self) -> Array:
        """Of the changes' errors, (k, k); zero for what isn't free."""
        covariance, slopes = np.zeros((len(self.x),) * 2), self.slopes(self.z)
        covariance[np.ix_(self.free, self.free)] = np.linalg.inv(slopes.T @ slopes)
        return self.expected[:, None] * covariance * self.expected


def adjust(
    bundle: Bundle,
    expected: Array,
    *,
    start: Array | None = None,
    unit: float = 1.0,
) -> Adjusted:
    """Return the changes that bring edges onto their rings.

    Args:
        bundle: Edges, and how everything is supposed to stand.
        expected: What is expected of each unknown's change, 0: none, (n_unknowns,).
        start: Changes near the best ones, (n_unknowns,); None: nobody knows.
        unit: Noise of the edges in units of sigma.
    """
    begin = np.zeros(len(expected)) if start is None else start
    found, rounds = Adjusted(bundle, expected, unit, begin), [(_OUTLYING, _SETTLED)]
    z = found.z
    if start is None and len(bundle.evidence):
        off = np.nan_to_num(np.abs(found.offsets) / unit, nan=_MISSED)
        most = float(np.quantile(off, _MOST_EDGES))
        rounds.insert(0, (max(_OUTLYING, most), _NEAR))
    for c, near in rounds if len(z) else ():
        options: dict[str, Any] = {"method": "lm", "max_nfev": _MOST_STEPS}
        options |= {"xtol": near, "ftol": near, "jac": found.slopes, "args": (c,)}
        z = least_squares(found.residuals, z, **options).x
    return Adjusted(bundle, expected, unit, found.changes(z))


def _curbed(off: Array, c: float) -> tuple[Array, Array]:
    """Return the root of what offsets cost, with their sign, and its derivative."""
    root = np.hypot(1.0, off / c)
    return off / root, root**-3


def expected_of(bundle: Bundle, errors: CalibrationErrors) -> Array:
    """Return what errors of every device are expected of each unknown, (n_unknowns,).

    Of the object as of a device, its size as a focal length.
    """
    of_each = (errors.about_axis, errors.along_axis_m, errors.focal)
    of_body = np.repeat((*of_each, errors.along_line_px), (3, 3, 1, 2))
    return np.resize(of_body, bundle.n_unknowns)
