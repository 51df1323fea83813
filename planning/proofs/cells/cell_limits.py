"""What forbids samples in a cell of positions, as a tree of cells asks."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class CellLimits(Protocol):
    """Says which samples a device in a cell may serve."""

    def admits(
        self,
        samples: NDArray[np.int64],
        towards: NDArray[np.float64],
        nearest: NDArray[np.float64],
        psi: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Return which samples a device in a cell may serve, each with its cell.

        Args:
            samples: Their numbers, shape (k,).
            towards: Unit directions from them to the cell's middle, shape (k, 3).
            nearest: No place of the cell is nearer to them, in [m], shape (k,).
            psi: Angle about `towards` that holds the cell [rad], shape (k,).
        """
        ...
