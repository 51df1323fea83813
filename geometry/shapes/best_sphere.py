"""The sphere through measured points, and how well they fix it.

With c the centre, rho the radius, n_i = (X_i - c)/|X_i - c| and S_i the covariance of a
point::

    minimise  sum_i (|X_i - c| - rho)^2 / v_i,      v_i = n_i^T S_i n_i + tau^2

tau is how far the body itself strays from a sphere: the least tau >= 0 at which the sum
is no more than its degrees of freedom, n - 4 (Paule and Mandel, 1982). So a body that
isn't round makes centre and radius uncertain, as it should.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.optimize import brentq

from geometry.arrays import Array

_UNKNOWNS = 4
_ROUNDS = 200
_SETTLED = 1e-12
# Beyond this no digit of tau matters [m].
_TAU = 1e-15
# Spread of the points about their best plane, as a share of their extent, below which
# rounding decides on which side of it the centre lies.
_FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class BestSphere:
    """A least-squares sphere.

    Attributes:
        centre: c in [m], shape (3,).
        radius: rho in [m].
        covariance: Of (c, rho) to first order in [m^2], shape (4, 4).
        shape_sigma: tau, standard deviation of the body from the sphere in [m].
        residuals: |X_i - c| - rho in [m], shape (n,).
        chi_square: The sum of squares at tau.
    """

    centre: Array
    radius: float
    covariance: Array
    shape_sigma: float
    residuals: Array
    chi_square: float

    def point_covariances(self, outward: Array) -> Array:
        """Return [I u] C [I u]^T + tau^2 u u^T of points c + rho u, (n, 3, 3) [m^2]."""
        jacobian = np.empty((len(outward), 3, _UNKNOWNS))
        jacobian[:, :, :3], jacobian[:, :, 3] = np.eye(3), outward
        of_fit = np.einsum("nij,jk,nlk->nil", jacobian, self.covariance, jacobian)
        bumps = self.shape_sigma**2 * np.einsum("ni,nj->nij", outward, outward)
        return of_fit + bumps


def fit_sphere(points: Array, covariances: Array) -> BestSphere:
    """Return the sphere through points, weighted by what is known of each.

    Args:
        points: In [m], shape (n, 3); at least 5, so that one is left to judge by.
        covariances: Of each in [m^2], shape (n, 3, 3).

    Raises:
        ValueError: If there are too few points, they lie in a plane, or the iteration
            doesn't settle on a sphere.
    """
    if not len(points) > _UNKNOWNS:
        raise ValueError(f"{len(points)} points; a sphere takes {_UNKNOWNS + 1}")
    start = _algebraic(points)
    n_free = len(points) - _UNKNOWNS
    fitted = _weighted(points, covariances, start, 0.0)
    if fitted.chi_square <= n_free:
        return fitted

    def excess(shape_sigma: float) -> float:
        return _weighted(points, covariances, start, shape_sigma).chi_square - n_free

    high = float(np.abs(fitted.residuals).max())
    while excess(high) > 0.0:
        high *= 2.0
    shape_sigma = cast(float, brentq(excess, 0.0, high, xtol=_TAU))
    return _weighted(points, covariances, start, shape_sigma)


def _algebraic(points: Array) -> Array:
    """Centre and radius from |X|^2 = 2 c.X + rho^2 - |c|^2, which is linear, (4,)."""
    mean = points.mean(axis=0)
    offsets = points - mean
    spread = np.linalg.svd(offsets, compute_uv=False)
    if not spread[2] > _FLAT * spread[0]:
        raise ValueError("the points lie in a plane, which fixes no sphere")
    scale = float(np.linalg.norm(offsets, axis=1).max())
    unit = offsets / scale
    rows = np.column_stack([2.0 * unit, np.ones(len(unit))])
    solution = np.linalg.lstsq(rows, np.sum(unit**2, axis=1), rcond=None)[0]
    radius = np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0))
    return np.append(mean + scale * solution[:3], scale * radius)


def _weighted(
    points: Array, covariances: Array, start: Array, shape_sigma: float
) -> BestSphere:
    """The least-squares sphere for one tau, by Gauss-Newton."""
    state = start.copy()
    for _ in range(_ROUNDS):
        jacobian, residuals, weights = _linear(points, covariances, state, shape_sigma)
        information = jacobian.T @ (weights[:, None] * jacobian)
        step = np.linalg.solve(information, jacobian.T @ (weights * residuals))
        state = state - step
        if not (np.all(np.isfinite(state)) and state[3] > 0.0):
            break
        if np.abs(step).max() <= _SETTLED * state[3]:
            _, residuals, weights = _linear(points, covariances, state, shape_sigma)
            return BestSphere(
                state[:3],
                float(state[3]),
                np.asarray(np.linalg.inv(information), dtype=np.float64),
                shape_sigma,
                residuals,
                float(np.sum(weights * residuals**2)),
            )
    raise ValueError("no sphere fits the points: they show too little of it")


def _linear(
    points: Array, covariances: Array, state: Array, shape_sigma: float
) -> tuple[Array, Array, Array]:
    """Jacobian by (c, rho), residuals and weights at a state."""
    offsets = points - state[:3]
    reach = np.linalg.norm(offsets, axis=1)
    outward = offsets / reach[:, None]
    variance = np.einsum("ni,nij,nj->n", outward, covariances, outward)
    jacobian = np.column_stack([-outward, -np.ones(len(points))])
    return jacobian, reach - state[3], 1.0 / (variance + shape_sigma**2)
