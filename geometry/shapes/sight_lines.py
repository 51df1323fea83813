"""A point from the directions in which it was seen, and from measured distances.

With O_i a viewpoint, r_i the unit direction in which the point X was seen from there,
s_i the standard deviation of that direction and t_i = |X - O_i|::

    minimise  sum_i |(I - r_i r_i^T)(X - O_i)|^2 / (t_i s_i)^2
            + sum_k (r_k.(X - O_k) - l_k)^2 / q_k^2

where l_k are distances measured along r_k, with standard deviations q_k. Without
weights and distances this is the closed form with which it starts::

    X = [sum (I - r r^T)]^-1 sum (I - r r^T) O

Source: Lee and Krim, 2014, section VI, the case without prior ranges.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array

_ROUNDS = 100
_SETTLED = 1e-12
# Least eigenvalue of the mean of I - r r^T at which two lines count as crossing.
_PARALLEL = 1e-12


@dataclass(frozen=True, eq=False)
class SightLines:
    """n observations of one point.

    Attributes:
        origins: O, viewpoints in [m], shape (n, 3).
        directions: r, unit directions, shape (n, 3).
        sigmas: s, standard deviation of a direction about either axis across it [rad],
            shape (n,).
        ranges: l, measured distances in [m]; NaN where none was, shape (n,).
        range_sigmas: q, their standard deviations in [m]; NaN likewise, shape (n,).
    """

    origins: Array
    directions: Array
    sigmas: Array
    ranges: Array
    range_sigmas: Array

    def __len__(self) -> int:
        return len(self.origins)


@dataclass(frozen=True, eq=False)
class SightedPoint:
    """Where the observations say that the point is.

    Attributes:
        position: X in [m], shape (3,).
        covariance: Of X, to first order, in [m^2], shape (3, 3).
        chi_square: The least sum of squares.
        n_free: Degrees of freedom: 2 a direction, 1 a distance, less 3.
    """

    position: Array
    covariance: Array
    chi_square: float
    n_free: int


def locate(lines: SightLines) -> SightedPoint:
    """Return the point that observations agree on best.

    Raises:
        ValueError: If the lines are parallel, or the point lies behind a viewpoint.
    """
    ranged = np.isfinite(lines.ranges)
    across = np.eye(3) - np.einsum("ni,nj->nij", lines.directions, lines.directions)
    along = np.where(ranged[:, None, None], np.eye(3) - across, 0.0)
    feet = lines.origins + np.where(ranged, lines.ranges, 0.0)[:, None] * (
        lines.directions
    )
    whole = (across + along).sum(axis=0)
    if not np.linalg.eigvalsh(whole)[0] > _PARALLEL * len(lines):
        raise ValueError("the sight lines are parallel and hold no distance")
    point = np.linalg.solve(whole, _pulled(across, along, lines, feet))
    information = whole
    for _ in range(_ROUNDS):
        reach = np.linalg.norm(point - lines.origins, axis=1)
        if not np.all(reach > 0.0):
            raise ValueError("the lines meet in a viewpoint")
        aside = across / np.square(reach * lines.sigmas)[:, None, None]
        deep = along / np.where(ranged, lines.range_sigmas, 1.0)[:, None, None] ** 2
        information = (aside + deep).sum(axis=0)
        moved = np.linalg.solve(information, _pulled(aside, deep, lines, feet))
        step, point = float(np.linalg.norm(moved - point)), moved
        if step <= _SETTLED * float(reach.max()):
            break
    return _judged(lines, point, information)


def _pulled(across: Array, along: Array, lines: SightLines, feet: Array) -> Array:
    pull = np.einsum("nij,nj->i", across, lines.origins)
    return pull + np.einsum("nij,nj->i", along, feet)


def _judged(lines: SightLines, point: Array, information: Array) -> SightedPoint:
    offsets = point - lines.origins
    depth = np.einsum("ni,ni->n", offsets, lines.directions)
    if not np.all(depth > 0.0):
        raise ValueError("the lines meet behind a viewpoint")
    reach = np.linalg.norm(offsets, axis=1)
    aside = np.linalg.norm(offsets - depth[:, None] * lines.directions, axis=1)
    ranged = np.isfinite(lines.ranges)
    deep = (depth - lines.ranges)[ranged] / lines.range_sigmas[ranged]
    square = np.sum((aside / (reach * lines.sigmas)) ** 2) + np.sum(deep**2)
    n_free = 2 * len(lines) + int(ranged.sum()) - 3
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return SightedPoint(point, covariance, float(square), n_free)
