"""Obstacles in the scene: which light and views they stop, and what touches them."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.shapes.boxes import OrientedBox, triangles_touch
from planning.model.obstacles import Obstacle

# Samples of a surface that lies on an obstacle's don't meet it there: in half diagonals
# of the object, as `geometry.rays.visibility` has it.
_CONTACT = 2e-6


@dataclass(frozen=True, eq=False)
class Obstruction:
    """An obstacle that light and views meet, unless within `contact_m` of a sample."""

    name: str
    mesh: TriangleMesh
    contact_m: float

    @classmethod
    def about(
        cls, mesh: TriangleMesh, obstacles: Iterable[Obstacle]
    ) -> tuple["Obstruction", ...]:
        """Return what stands about an object."""
        low, high = mesh.bounds
        contact = _CONTACT * 0.5 * float(np.linalg.norm(high - low))
        return tuple(cls(each.name, each.mesh, contact) for each in obstacles)

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
        """Return which lines from starts, (n, 3) or (3,), to points meet it, (n,)."""
        ways = starts - points
        lengths = np.linalg.norm(ways, axis=1)
        along = ways / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        begin = points + self.contact_m * along
        reach = np.maximum(lengths - self.contact_m, 0.0)
        return self._caster.occluded(begin, along, reach)

    def touches(self, box: OrientedBox) -> bool:
        """Return whether a box shares a point with its surface."""
        return touches_mesh(box, self.mesh)

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.mesh)


def touches_mesh(box: OrientedBox, mesh: TriangleMesh) -> bool:
    """Return whether a box shares a point with a surface."""
    low, high = mesh.bounds
    near = (box.centre - box.radius <= high) & (box.centre + box.radius >= low)
    return bool(near.all() and triangles_touch(box, mesh.corners).any())
