"""How large an object is, as optics see it."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from geometry.mesh.mesh import TriangleMesh


@dataclass(frozen=True)
class ObjectSize:
    """The size of an object.

    Attributes:
        radius_m: Of the smallest ball that holds it [m].
        shadow_m2: Mean area of its shadow over all directions [m²].
        sides_m: The two largest sides of a box about it [m].
    """

    radius_m: float
    shadow_m2: float
    sides_m: tuple[float, float]

    @classmethod
    def ball(cls, radius_m: float) -> Self:
        """Return the size of a ball."""
        return cls(radius_m, math.pi * radius_m**2, (2.0 * radius_m, 2.0 * radius_m))

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Self:
        """Return the size of a mesh.

        The mean shadow of a convex body is a quarter of its surface (Cauchy); the
        object's is that of its convex hull. The box lies along the axes of the mesh or
        the principal ones of the hull's corners, whichever shows less.
        """
        # Joggled, so that a flat plate has a hull, of both its sides; of a triangle the
        # middle is the fourth point that is asked for.
        points = np.vstack([mesh.vertices, mesh.vertices.mean(axis=0)])
        hull = ConvexHull(points, qhull_options="QJ")
        corners = points[hull.vertices]
        principal = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)[
            2
        ]
        sides = min(_sides(corners @ axes.T) for axes in (np.eye(3), principal))
        return cls(mesh.radius, float(hull.area) / 4.0, sides[1:])


def _sides(corners: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the area and the sides of the largest face of a box along the axes."""
    _, second, largest = np.sort(np.ptp(corners, axis=0)).tolist()
    return second * largest, largest, second
