"""Which points a closed surface holds, by its generalised winding number."""

import igl
import numpy as np

from geometry.arrays import Array, Mask
from geometry.mesh.mesh import TriangleMesh


def held(mesh: TriangleMesh, points: Array) -> Mask:
    """Return whether points (n, 3) [m] lie inside a surface, shape (n,).

    Its winding number there is over a half; of an open surface that is where it closes
    around more than it leaves open (Jacobson 2013).
    """
    if not len(points):
        return np.zeros(0, dtype=bool)
    winding = igl.fast_winding_number(mesh.vertices, mesh.faces, points)
    return np.abs(np.asarray(winding)).ravel() > 0.5
