"""Whether the segment from a device to a sample is free, by the first face it meets."""

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster

# In units of the object's radius: 80 roundings of the float32 that rays are cast in.
_SLACK = 1e-5


class Shadow:
    """Tests segments against one mesh.

    A ray starts where its segment enters the sphere about the object (or at the device,
    if that stands inside), so that its length, and with it every rounding error, is in
    proportion to the object whatever the distance of the device. The segment is free if
    the first face met is the sample's own, or lies no nearer than the sample less 1e-5
    of the object's radius, or if nothing is met.

    Args:
        mesh: The occluder.
        threads: Worker threads of the ray caster.
    """

    def __init__(self, mesh: TriangleMesh, *, threads: int) -> None:
        self._caster = RayCaster(mesh, threads=threads)
        self._centre = mesh.centre
        self._radius = 1.05 * mesh.reach
        self._slack = _SLACK * mesh.radius

    @property
    def caster(self) -> RayCaster:
        """The bare ray caster, for other questions about the same mesh."""
        return self._caster

    def free(
        self,
        points: NDArray[np.float64],
        faces: NDArray[np.int64],
        along: NDArray[np.float64],
        lengths: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Return whether each segment is free.

        Args:
            points: Ends of the segments, samples of the mesh in [m], shape (n, 3).
            faces: Face of each sample, shape (n,).
            along: Unit direction from the device to the sample, shape (n, 3).
            lengths: Lengths of the segments in [m], shape (n,).
        """
        if len(points) == 0:
            return np.zeros(0, dtype=bool)
        offset = points - self._centre
        b = np.einsum("ij,ij->i", offset, along)
        inside = self._radius**2 - np.einsum("ij,ij->i", offset, offset)
        back = np.minimum(lengths, b + np.sqrt(b * b + inside))
        hit, distance = self._caster.first_hits(points - back[:, None] * along, along)
        return (hit == faces) | (distance >= back - self._slack)
