"""What may be seen from anywhere in a cell of camera positions: a superset.

As `measurable_cells`, of limits that ask for no projector: incidence and sampling
distance of some model of the cameras. What a pair asks beyond that is left out, which
only adds to the cells.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import by_column, dot
from geometry.devices import PinholeModel
from planning.model.requirements import Requirements
from planning.scene.limits.camera_limits import CAMERA_LIMITS, CellView
from planning.scene.limits.limit import may_hold
from planning.scene.samples import Target

from .crossings import Cone, nearest_cos
from .image_cone import image_cone

_Array = NDArray[np.float64]


class SeenCells:
    """Says which samples a camera in a cell may see; the `limits` of its tree."""

    def __init__(
        self,
        target: Target,
        required: Requirements,
        devices: Sequence[PinholeModel],
        *,
        check_cancelled: Callable[[], None] = lambda: None,
    ) -> None:
        self._check_cancelled = check_cancelled
        self._camera, self._normals = required.camera, target.samples.normals
        self._lenses = [(image_cone(d).off_axis, d.focal_px) for d in devices]

    def admits(
        self,
        samples: NDArray[np.int64],
        towards: _Array,
        nearest: _Array,
        psi: _Array,
    ) -> NDArray[np.bool_]:
        """Return which samples a camera in a cell may see, as `CellLimits`."""
        self._check_cancelled()
        middle = dot(by_column(self._normals, samples), towards)
        facing = nearest_cos(middle, Cone.of(towards, psi))
        admitted = np.zeros(samples.size, dtype=bool)
        for off_axis, focal_px in self._lenses:
            cell = CellView(facing, nearest * np.cos(off_axis), focal_px)
            admitted |= may_hold(CAMERA_LIMITS, cell, self._camera, len(samples))
        return admitted
