"""Lengths of many short vectors."""

import numpy as np
from numpy.typing import NDArray


def lengths(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sqrt(x^2 + y^2 + z^2) of each row, (n, 3) to (n,).

    To the last bit what `np.linalg.norm` gives along axis 1, whose sums over rows of
    three cost five times as much.
    """
    x, y, z = vectors.T
    return np.sqrt(x * x + y * y + z * z)
