"""Least-squares sphere and plane, and what the guideline reads from them."""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy.optimize import least_squares

from geometry.arrays import Array

# So many of the points may be left out, those farthest off: three in a thousand.
LEFT_OUT = 0.003
# Fewer points say nothing of a form.
FEWEST = 25


@dataclass(frozen=True, eq=False)
class FittedSphere:
    """A free least-squares sphere.

    Attributes:
        centre: In the world [m], shape (3,).
        radius: [m].
        form: Span of the points' distances from it, `spread` [m].
    """

    centre: Array
    radius: float
    form: float


def fit_sphere(points: Array) -> FittedSphere:
    """Return the sphere that minimises ``sum (|X - c| - rho)^2``; points (n, 3) [m]."""
    start = points.mean(axis=0)
    size = float(np.linalg.norm(points - start, axis=1).max())

    def outward(c: Array) -> tuple[Array, Array]:
        ways = points - (start + size * c[:3])
        return ways, np.linalg.norm(ways, axis=1)

    def residuals(c: Array) -> Array:
        return outward(c)[1] / size - c[3]

    def slopes(c: Array) -> Array:
        ways, reach = outward(c)
        return np.column_stack([-ways / reach[:, None], -np.ones(len(points))])

    # In units of the patch: from its middle, as large as it.
    first = np.array([0.0, 0.0, 0.0, 1.0])
    found = least_squares(residuals, first, jac=cast(Any, slopes), method="lm").x
    distances = size * residuals(found)
    return FittedSphere(
        start + size * found[:3], float(size * found[3]), spread(distances)
    )


def flatness(points: Array) -> float:
    """Return the span of distances from the least-squares plane, `spread` [m]."""
    centred = points - points.mean(axis=0)
    normal = np.linalg.svd(centred.T @ centred)[0][:, -1]
    return spread(centred @ normal)


def spread(distances: Array) -> float:
    """Return the largest less the smallest, three in a thousand left out [m].

    Those farthest from zero go, as a person would drop them.
    """
    kept = len(distances) - int(LEFT_OUT * len(distances))
    nearest = distances[np.argsort(np.abs(distances), kind="stable")[:kept]]
    return float(np.ptp(nearest))
