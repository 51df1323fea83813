"""Lines through the points near each along its ring, and what they average."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array, Indices, Mask

_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Lines:
    """A line about each of n points, by weights of its neighbours on either side.

    Attributes:
        one: Places of points, shape (n_links,).
        other: Of a neighbour of each.
        apart: How much farther along the ring it lies [m].
        weight: Of each point, shape (n,).
        sums: Of weights, weights times places, and times their squares, shape (3, n).
        good: Whether there are points enough for a line, shape (n,).
        spread: Deviation of the line at each point; its own without a line, shape (n,).
    """

    one: Indices
    other: Indices
    apart: Array
    weight: Array
    sums: Array
    good: Mask
    spread: Array

    @classmethod
    def of(cls, one: Indices, other: Indices, apart: Array, sigma: Array) -> "Lines":
        """Return the lines through points of these deviations, ``1 / sigma^2``."""
        weight = sigma**-2.0
        w, ws, wss = weight.copy(), np.zeros(len(sigma)), np.zeros(len(sigma))
        count = np.zeros(len(sigma))
        for at, of, s in ((one, other, apart), (other, one, -apart)):
            share = weight[of]
            count += np.bincount(at, minlength=len(sigma))
            w += np.bincount(at, share, len(sigma))
            ws += np.bincount(at, share * s, len(sigma))
            wss += np.bincount(at, share * s * s, len(sigma))
        det = w * wss - ws * ws
        good = (count >= 2) & (det > 1e-6 * w * wss)
        det = np.where(good, det, 1.0)
        spread = np.where(good, np.sqrt(wss / det), sigma)
        return cls(one, other, apart, weight, np.stack([w, ws, wss]), good, spread)

    def astray(self, noise: Array) -> Array:
        """Return what share of places' spread is noise of this deviation [m], (n,).

        A slope b is estimated as (1 - share) b + share c where noise moves points along
        a slope c (errors in variables). Half at most: beyond there is no slope.
        """
        w, ws, wss = self.sums
        random = own = self.weight * np.square(noise)
        for at, of in ((self.one, self.other), (self.other, self.one)):
            random = random + np.bincount(at, own[of], len(own))
        spread = np.where(self.good, wss - ws * ws / w, 1.0)
        return np.where(self.good, np.minimum(random / spread, 0.5), 0.0)

    def through(self, values: Array) -> tuple[Array, Array]:
        """Return the slope of values (n,) along the ring, and how far lines lie off."""
        w, ws, wss = self.sums
        rise = values[self.other] - values[self.one]
        n, (wt, wst) = len(values), np.zeros((2, len(values)))
        for at, of in ((self.one, self.other), (self.other, self.one)):
            sign = 1.0 if at is self.one else -1.0
            share = sign * self.weight[of] * rise
            wt += np.bincount(at, share, n)
            wst += np.bincount(at, sign * share * self.apart, n)
        det = np.where(self.good, w * wss - ws * ws, 1.0)
        return (
            np.where(self.good, (w * wst - ws * wt) / det, 0.0),
            np.where(self.good, (wss * wt - ws * wst) / det, 0.0),
        )


@dataclass(frozen=True, eq=False)
class RingFit:
    """Where lines put the points of a cloud.

    Attributes:
        order: Index of the lines' points in the cloud, shape (n,).
        shift: How far each point is from its line along the light [m], shape (n,).
        remaining: Share of its deviation that is left, shape (n,).
        noise: What is left of noise along the light [m], shape (n,).
        redundant: Whether it lies between better points of other cameras, shape (n,).
        used: The lines of each reach, and for which of their points, (n,), these count
            unless later ones do.
    """

    order: Indices
    shift: Array
    remaining: Array
    noise: Array
    redundant: Mask
    used: tuple[tuple[Mask, Lines], ...]

    def averaged(self, values: Array) -> Array:
        """Return what the lines make of values of a cloud's points, shape (n,).

        What every camera sees alike isn't averaged as noise is, but weighted as it.
        """
        own = values[self.order]
        mean = own.copy()
        for better, lines in self.used:
            mean = np.where(better, own + lines.through(own)[1], mean)
        return in_cloud(self.order, mean)


def in_cloud(order: Indices, values: NDArray[_T]) -> NDArray[_T]:
    """Return values of points in this order by their index in the cloud, (n,)."""
    there = np.empty_like(values)
    there[order] = values
    return there
