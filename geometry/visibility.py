"""The planner's visibility: whether the segment from a device to a sample is free.

Policy, from measurements: the mesh is centred in float64, rays are cast *from the
device to the sample* and stop a little short of it. Casting from the sample needs an
offset along the normal, which trades falsely blocked samples for falsely clear ones;
stopping short needs none. The slack is a twentieth of the mean edge, so it scales with
the mesh.
"""

import numpy as np
from numpy.typing import NDArray

from .mesh import TriangleMesh
from .rays import RayCaster

_SLACK_EDGES = 0.05
_MAX_RAYS = 1 << 21


class Visibility:
    """Occlusion queries against one mesh.

    Args:
        mesh: The occluder, on which the samples lie.
        threads: Worker threads.
    """

    def __init__(self, mesh: TriangleMesh, *, threads: int = 2) -> None:
        self.caster = RayCaster(mesh, threads=threads)
        self.slack = _SLACK_EDGES * mesh.mean_edge

    def blocked(
        self, origins: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return whether something stands between origins and points.

        Args:
            origins: Devices, in [m], shape (n, 3), or (3,) for a common one.
            points: Samples on the mesh in [m], shape (n, 3).

        Returns:
            Shape (n,).
        """
        blocked = np.empty(len(points), dtype=bool)
        for begin in range(0, len(points), _MAX_RAYS):
            part = slice(begin, begin + _MAX_RAYS)
            start = origins if origins.ndim == 1 else origins[part]
            offsets = points[part] - start
            distances = np.linalg.norm(offsets, axis=1)
            reach = np.maximum(distances - self.slack, 0.0)
            safe = np.where(distances > 0, distances, 1.0)
            along = offsets / safe[:, None]
            blocked[part] = self.caster.occluded(start, along, reach)
        return blocked
