"""The kinds of arrays that geometry is made of."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
Words = NDArray[np.uint64]
Length = TypeVar("Length", float, Array)

_Kind = TypeVar("_Kind", bound=np.generic)


def rows_of(array: NDArray[_Kind], chosen: Ints | Mask) -> NDArray[_Kind]:
    """Return some rows, by index or mask: up to ten times as fast as `array[chosen]`.

    numpy copies whole rows here, and number by number there.
    """
    if chosen.dtype == np.bool_:
        return array.compress(chosen, axis=0)
    return array.take(chosen, axis=0)
