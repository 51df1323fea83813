"""What pairs about a turntable measure of the part, at every angle of the table."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from geometry.arrays import Ints, Mask
from planning.cameras.stations.heads.head_cover import HeadSets
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.camera_views import camera_views
from planning.scene.measuring.measured import LitSamples, measured_by
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .table_lattice import TableLattice

# Of each device its circle and its place.
Place = tuple[int, int]


@dataclass(frozen=True, eq=False)
class TableSets:
    """What the lattice's devices do to n samples of the part.

    Attributes:
        lattice: The places.
        target: The samples.
        lit: Whether the projector of a circle lights them from a place, (E, A, n).
        measured: Whether with it the camera of a circle measures them, so many places
            on as the lattice's offsets say, shape (E, A, F, n_offsets, n).
    """

    lattice: TableLattice
    target: Target
    lit: Mask
    measured: Mask

    @classmethod
    def of(cls, scene: Scene, lattice: TableLattice, target: Target) -> "TableSets":
        """Return what each pair of places does, in the frame of the part."""
        n, places, offsets = len(target), lattice.n_places, lattice.offsets
        lamps = [
            lattice.placed(p, i) for p in lattice.projectors for i in range(places)
        ]
        eyes = [lattice.placed(c, k) for c in lattice.cameras for k in range(places)]
        lit: Mask = lit_stages(scene, lamps, target) == LIT
        views = camera_views(scene, eyes, target)
        shape = (len(lattice.projectors), places, len(lattice.cameras), len(offsets), n)
        measured = np.zeros(shape, dtype=bool)
        for k, (e, i) in enumerate(product(range(shape[0]), range(places))):
            scene.check_cancelled()
            samples = LitSamples.of(lamps[k : k + 1], target, lit[:, k : k + 1])
            near = (
                places * np.arange(shape[2])[:, None] + (i + offsets) % places
            ).ravel()
            seen = measured_by(
                scene, [eyes[c] for c in near], samples, [views[c] for c in near]
            )
            measured[e, i] = seen.T.reshape(shape[2:])
        return cls(lattice, target, lit.T.reshape(shape[0], places, n), measured)

    def everywhere(self) -> HeadSets:
        """Return what any device lights, and any pair measures, as if of one."""
        n = len(self.target)
        lit = np.any(self.lit.reshape(-1, n), axis=0, keepdims=True)
        measured = np.any(self.measured.reshape(-1, n), axis=0, keepdims=True)
        return HeadSets(self.target, lit.T, measured.T)

    def steps_of(
        self,
        lamps: Sequence[Place],
        eyes: Sequence[Place] | None,
        clear: Mask | None = None,
        *,
        angles: Ints | None = None,
    ) -> HeadSets:
        """Return what devices do at each angle of the table, (n, A).

        At angle j they are seen j places back. Cameras None: any. Where a line to a
        sample isn't `clear`, as `TableRoom.clear` says, a device does nothing. Of some
        angles alone, (k,): columns are these, (n, k).
        """
        places, n = self.lattice.n_places, len(self.target)
        back = -(np.arange(places) if angles is None else angles)
        if clear is None:
            clear = np.ones((len(lamps) + len(eyes or ()), 1, 1), dtype=bool)
        lit, measured = np.zeros((2, len(back), n), dtype=bool)
        for (e, i), free in zip(lamps, clear, strict=False):
            at = (i + back) % places
            lit |= self.lit[e, at] & free
            if eyes is None:
                measured |= self.measured[e, at].any(axis=(1, 2))
                continue
            for (f, k), in_view in zip(eyes, clear[len(lamps) :], strict=True):
                column = self._offset(k - i)
                if column is not None:
                    measured |= self.measured[e, at, f, column] & free & in_view
        return HeadSets(self.target, lit.T, measured.T)

    def near(self, lamp: Place) -> list[Place]:
        """Return the places of cameras that measure anything with a projector."""
        e, i = lamp
        some = self.measured[e].any(axis=(0, 3))
        return [
            (int(f), int(i + self.lattice.offsets[column]) % self.lattice.n_places)
            for f, column in np.argwhere(some)
        ]

    def _offset(self, places: int) -> int | None:
        """The column of an offset; None where so far apart none was looked at."""
        half = self.lattice.n_places // 2
        return self._columns.get((places + half) % self.lattice.n_places - half)

    @cached_property
    def _columns(self) -> dict[int, int]:
        return {int(o): column for column, o in enumerate(self.lattice.offsets)}
