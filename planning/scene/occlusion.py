"""What the object's own surface hides: of several members that which a sample lies on.

Members of a family take each other's place before the rig, so none is ever in the way
of another. Each has rays of its own.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.rays.visibility import Visibility
from geometry.rays.visibility_matrix import visibility_matrix

from .samples import Target

_Array = NDArray[np.float64]
_Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Occlusion:
    """Occlusion by the surface of each member, in their order."""

    members: tuple[Visibility, ...]

    def share(self, work: Callable[[slice], None], parts: Sequence[slice]) -> None:
        """Do pieces of work on all threads."""
        self.members[0].caster.share(work, parts)

    def blocked(
        self, origin: _Array, target: Target, *, along: _Array | None = None
    ) -> _Mask:
        """Return between which samples and a device the surface stands, shape (n,).

        `origin` and `along` are those of `Visibility.blocked`.
        """
        hidden = np.zeros(len(target), dtype=bool)
        for visibility, rows, some in self._parts(target):
            samples = some.samples
            hidden[rows] = visibility.blocked(
                origin, samples.points, samples.normals, along=along
            )
        return hidden

    def seen(
        self,
        origins: _Array,
        target: Target,
        *,
        along: _Array | None = None,
        candidates: _Mask | None = None,
    ) -> _Mask:
        """Return which device (row) sees which sample (column), shape (m, n).

        Arguments are those of `visibility_matrix`.
        """
        free = np.zeros((len(origins), len(target)), dtype=bool)
        for visibility, rows, some in self._parts(target):
            wanted = candidates
            if candidates is not None and len(self.members) > 1:
                wanted = np.ascontiguousarray(candidates[:, rows])
            free[:, rows] = visibility_matrix(
                visibility,
                origins,
                some.samples.points,
                some.samples.normals,
                along=along,
                candidates=wanted,
            )
        return free

    def _parts(
        self, target: Target
    ) -> Iterator[tuple[Visibility, slice | NDArray[np.int64], Target]]:
        """Yield each member's rays, which samples lie on it, and these."""
        if len(self.members) == 1:
            yield self.members[0], slice(None), target
            return
        for index in np.unique(target.member).tolist():
            rows = np.flatnonzero(target.member == index)
            yield self.members[index], rows, target.take(rows)
