"""Poses as they are written."""

import numpy as np
from numpy.typing import NDArray

_POSITION_DECIMALS = 5
DECIMALS = 12


def rounded_pose(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a pose as it will be written: positions to 0.01 mm."""
    result = np.round(pose, DECIMALS)
    result[:3, 3] = np.round(pose[:3, 3], _POSITION_DECIMALS)
    return result + 0.0
