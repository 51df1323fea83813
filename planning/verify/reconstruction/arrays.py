"""Names for arrays, columns of equal length, and trees of points."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from geometry.arrays import rows_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.int64]
Grey = NDArray[np.float32]
Images = NDArray[np.uint8 | np.float32]
# Points in a leaf of a tree: such a tree is made sooner, and answers sooner.
_LEAF = 24


def tree_of(points: NDArray[np.floating]) -> KDTree:
    """Return a tree to ask for what is near of many points, shape (n, k)."""
    return KDTree(points, leafsize=_LEAF, balanced_tree=False)


@dataclass(frozen=True, eq=False)
class Columns:
    """A value whose arrays have one row for each of its items."""

    def __len__(self) -> int:
        return len(next(iter(self._columns().values())))

    def take(self, chosen: Mask | Indices) -> Self:
        """Return some of the items."""
        columns = self._columns()
        return replace(self, **{n: rows_of(one, chosen) for n, one in columns.items()})

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """Return all items of one part or more, in their order."""
        each = [part._columns() for part in parts]
        joined = {n: np.concatenate([one[n] for one in each]) for n in each[0]}
        return replace(parts[0], **joined)

    def _columns(self) -> dict[str, Array]:
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {n: one for n, one in values.items() if isinstance(one, np.ndarray)}
