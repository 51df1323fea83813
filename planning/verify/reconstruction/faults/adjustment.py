"""The bundle adjustment: what changes bring all edges onto their rings.

Edges' distances from their rings in units of their noise, and changes in units of what
is expected of them; outliers among the edges hardly count::

    min  sum_i log(1 + (e_i(x) / sigma_i)^2)  +  sum_j (x_j / s_j)^2

from where the same sum with 2 sqrt(1 + u^2) - 2, which is convex, is least.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from planning.model.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array, Mask

from .bundle import CENTRE, SHIFT, TURN, ZOOM, Bundle
from .supposed import Role, Supposed

# An edge that misses the object counts for so many deviations.
_MISSED = 200.0
_MOST_STEPS = 40
# Relative changes of cost and unknowns at which the first and second search end.
_NEAR, _SETTLED = 1e-4, 1e-7
_Loss = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Adjusted:
    """What an adjustment found.

    Attributes:
        bundle: Edges, and how everything was supposed to stand.
        free: Unknowns that might change, shape (k,).
        expected: What was expected of each unknown's change, shape (k,).
        x: Their changes, shape (k,).
        cost: What edges and changes still cost, about one for each edge.
        unit: Noise of the edges in units of sigma by which it is counted.
    """

    bundle: Bundle
    free: Mask
    expected: Array
    x: Array
    cost: float
    unit: float

    @cached_property
    def supposed(self) -> Supposed:
        """How everything stands after the changes."""
        return self.bundle.moved(self.x)

    @cached_property
    def offsets(self) -> Array:
        """Distances of edges from their rings after it, as of `Bundle.offsets`."""
        return self.bundle.offsets(self.x)

    @property
    def scatter(self) -> float:
        """Deviation of the edges from their rings in units of sigma, by the median."""
        off = self.bundle.apart_from_relief(np.nan_to_num(self.offsets))
        return 1.4826 * float(np.median(np.abs(off)))

    @cached_property
    def weighed(self) -> tuple[Array, Array]:
        """Slopes of the edges by the unknowns (n, k) and offsets (n,), both weighed.

        Each by the square root of what the loss makes of its square.
        """
        known = np.isfinite(self.offsets)
        slopes = np.nan_to_num(self.bundle.slopes(self.x), posinf=0.0, neginf=0.0)
        off = self.bundle.apart_from_relief(np.where(known, self.offsets, 0.0))
        slopes = self.bundle.apart_from_relief(slopes)[known] / self.unit
        off = off[known] / self.unit
        weight = (1.0 + off**2) ** -0.5
        return weight[:, None] * slopes, weight * off

    @cached_property
    def covariance(self) -> Array:
        """Of the changes' errors, (k, k); zero for what isn't free."""
        slopes, _ = self.weighed
        scaled = (slopes * self.expected)[:, self.free]
        inverse = np.linalg.inv(scaled.T @ scaled + np.eye(scaled.shape[1]))
        covariance = np.zeros((len(self.x),) * 2)
        covariance[np.ix_(self.free, self.free)] = inverse
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
    free = expected > 0.0
    scale, n = expected[free], len(bundle.evidence)

    def whole(z: Array) -> Array:
        x = np.zeros(len(expected))
        x[free] = scale * z
        return x

    def residuals(z: Array) -> Array:
        off = bundle.offsets(whole(z)) / unit
        off = bundle.apart_from_relief(np.where(np.isfinite(off), off, _MISSED))
        return np.concatenate([off, z])

    def slopes(z: Array) -> Array:
        by_edge = bundle.slopes(whole(z))[:, free] * scale / unit
        by_edge[~np.isfinite(by_edge)] = 0.0
        return np.vstack([bundle.apart_from_relief(by_edge), np.eye(len(z))])

    def robust(loss: _Loss) -> _Loss:
        def of_edges(u: Array) -> Array:
            rho = np.stack([u, np.ones_like(u), np.zeros_like(u)])
            rho[:, :n] = loss(u[:n])
            return rho

        return of_edges

    z = np.zeros(len(scale)) if start is None else start[free] / scale
    rounds = ((_soft_l1, _NEAR), (_cauchy, _SETTLED))
    for loss, settled in rounds if len(z) else ():
        if start is not None and loss is _soft_l1:
            continue
        options: dict[str, Any] = {"loss": robust(loss), "max_nfev": _MOST_STEPS}
        options |= dict.fromkeys(("xtol", "ftol"), settled)
        # scipy's annotation knows its three names only.
        found = least_squares(residuals, z, slopes, **options)  # pyright: ignore[reportArgumentType]
        z = found.x
    cost = float(robust(_cauchy)(residuals(z) ** 2)[0].sum())
    return Adjusted(bundle, free, expected, whole(z), cost, unit)


def _soft_l1(u: Array) -> Array:
    root = np.sqrt(1.0 + u)
    return np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])


def _cauchy(u: Array) -> Array:
    return np.stack([np.log1p(u), 1.0 / (1.0 + u), -1.0 / (1.0 + u) ** 2])


def expected_of(
    bundle: Bundle, devices: CalibrationErrors, body: tuple[float, float, float]
) -> Array:
    """Return what is expected of each unknown, (n_unknowns,).

    Args:
        bundle: Whose unknowns.
        devices: Errors of every device.
        body: Those of the object: turn [rad] and displacement [m] about and along any
            axis, and size as a share.
    """
    expected = np.zeros(bundle.n_unknowns)
    sizes: dict[Role, int] = {
        "cameras": len(bundle.supposed.cameras),
        "projectors": len(bundle.supposed.projectors),
    }
    for role, size in sizes.items():
        for index in range(size):
            for part, value in (
                (TURN, devices.about_axis),
                (SHIFT, devices.along_axis_m),
                (ZOOM, devices.focal),
                (CENTRE, devices.along_line_px),
            ):
                expected[bundle.columns(role, index, part)] = value
    for part, value in zip((TURN, SHIFT, ZOOM), body, strict=True):
        expected[bundle.columns("objects", 0, part)] = value
    return expected
