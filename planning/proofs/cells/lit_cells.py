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

from planning.model.requirements import ProjectorLimits
from planning.scene.limits.limit import may_hold
from planning.scene.limits.projector_limits import PROJECTOR_LIMITS, LightCell
from planning.scene.samples import Target

from .crossings import Cone, dot, farthest_cos, nearest_cos

_Array = NDArray[np.float64]


class LitCells:
    """Says which samples light from a cell may meet; the `limits` of its tree."""

    def __init__(self, target: Target, limits: ProjectorLimits) -> None:
        self._normals, self._steep = target.samples.normals, target.steep
        self._limits = limits

    def admits(
        self,
        samples: NDArray[np.int64],
        towards: _Array,
        nearest: _Array,
        psi: _Array,
    ) -> NDArray[np.bool_]:
        """Return which samples a projector in a cell may light, as `CellLimits`."""
        cone, facing, along = self._cosines(samples, towards, psi)
        best = LightCell(nearest_cos(facing, cone), farthest_cos(along, cone))
        return may_hold(PROJECTOR_LIMITS, best, self._limits, len(samples))

    def surely(
        self, samples: NDArray[np.int64], towards: _Array, psi: _Array
    ) -> NDArray[np.bool_]:
        """Return which samples every part of a cell admits, likewise."""
        cone, facing, along = self._cosines(samples, towards, psi)
        least = facing * cone.cosine - np.sqrt(1.0 - facing**2) * cone.sine
        worst = LightCell(least, nearest_cos(along, cone))
        holds = may_hold(PROJECTOR_LIMITS, worst, self._limits, len(samples))
        return holds & (psi < 0.5 * np.pi)

    def _cosines(
        self, samples: NDArray[np.int64], towards: _Array, psi: _Array
    ) -> tuple[Cone, _Array, _Array]:
        """Return the cones about directions, and N.u and |T1.u| of their middles."""
        facing = np.clip(dot(self._normals[samples], towards), -1.0, 1.0)
        along = np.abs(dot(self._steep[samples], towards))
        return Cone.of(towards, psi), facing, along
