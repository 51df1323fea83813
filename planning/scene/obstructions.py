"""Obstacles in the scene: which light and views they stop, and what touches them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.shapes.boxes import OrientedBox, triangles_touch

# Samples of a surface that lies on an obstacle's don't meet it there [m].
_CONTACT_M = 1e-5


@dataclass(frozen=True, eq=False)
class Obstruction:
    """An obstacle that light and views meet.

    Attributes:
        name: As in the rig file.
        mesh: Where it stands [m].
    """

    name: str
    mesh: TriangleMesh

    @property
    def words(self) -> str:
        """What messages call it."""
        return f"obstacle {self.name!r}"

    def is_of(self, device: object) -> bool:
        """Return False: no device owns it."""
        return False

    def crossed(
        self, starts: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return which straight lines to points (n, 3) meet it, shape (n,).

        Args:
            starts: Where light leaves or views end, shape (n, 3) or (3,) [m].
            points: Samples, shape (n, 3) [m].
        """
        ways = starts - points
        lengths = np.linalg.norm(ways, axis=1)
        along = ways / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        return self._caster.occluded(
            points + _CONTACT_M * along, along, np.maximum(lengths - _CONTACT_M, 0.0)
        )

    def touches(self, box: OrientedBox) -> bool:
        """Return whether a box shares a point with its surface."""
        low, high = self.mesh.bounds
        if np.any(box.centre - box.radius > high) or np.any(
            box.centre + box.radius < low
        ):
            return False
        return bool(triangles_touch(box, self.mesh.corners).any())

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.mesh)
