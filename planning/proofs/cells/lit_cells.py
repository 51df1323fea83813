"""What may be lit from anywhere in a cell of projector positions: a superset.

Seen from sample P, the cell lies within psi of the direction u_c. Light from there
arrives along L = -u, u within psi of u_c, so that::

    -N.L   <= cos(max(0, angle(N, u_c) - psi))                      facing
    |T1.L| >= cos(min(pi/2, angle(T1, line of u_c) + psi))          along T1

Maps of open directions say the same by whole cells of a map; here it is exact however
small the cell. Beam and aim are left out, which only adds samples.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import by_column, dot
from planning.model.requirements import ProjectorLimits
from planning.scene.limits.limit import may_hold
from planning.scene.limits.projector_limits import PROJECTOR_LIMITS, LightCell
from planning.scene.samples import Target

from .crossings import Cone, farthest_cos, nearest_cos

_Array = NDArray[np.float64]


class LitCells:
    """Says which samples light from a cell may meet; the `limits` of its tree."""

    def __init__(self, target: Target, limits: ProjectorLimits) -> None:
        self._normals = np.asfortranarray(target.samples.normals)
        self._steep = np.asfortranarray(target.steep)
        self._limits = limits

    def admitted(
        self, samples: NDArray[np.int64], towards: _Array, psi: _Array
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which samples a projector in a cell may light, and lights anywhere.

        Each with its cell, as `CellLimits.admits` has them.
        """
        cone = Cone.of(towards, psi)
        facing = dot(by_column(self._normals, samples), towards)
        facing = np.clip(facing, -1.0, 1.0)
        along = np.abs(dot(by_column(self._steep, samples), towards))
        best = LightCell(nearest_cos(facing, cone), farthest_cos(along, cone))
        least = facing * cone.cosine - np.sqrt(1.0 - facing**2) * cone.sine
        worst = LightCell(least, nearest_cos(along, cone))
        may, surely = (
            may_hold(PROJECTOR_LIMITS, light, self._limits, len(samples))
            for light in (best, worst)
        )
        return may, surely & (psi < 0.5 * np.pi)
