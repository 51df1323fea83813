"""Choices of places as they stand in the room, and whether they are enough there."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Ints
from planning.cameras.stations.heads.head_cover import HeadCover, HeadSets

from .table_room import TableRoom
from .table_sets import Place, TableSets


@dataclass(frozen=True, eq=False)
class Steps:
    """Places of devices, and the angles at which they measure.

    Attributes:
        lamps: Places of the projectors, `eyes` of the cameras, in the room.
        angles: Chosen ones, as places of the table, ascending, (k,).
        lower_bound: Proven least number of angles for as many devices, wherever on the
            lattice they are.
        proof: What proves it.
    """

    lamps: tuple[Place, ...]
    eyes: tuple[Place, ...]
    angles: Ints
    lower_bound: int
    proof: str


@dataclass(frozen=True, eq=False)
class StandingSteps:
    """Puts choices into the room.

    Attributes:
        sets: What pairs of places do.
        room: What stands about the table.
        cover: What is asked, as rows.
    """

    sets: TableSets
    room: TableRoom
    cover: HeadCover

    def enough(
        self, lamps: tuple[Place, ...], eyes: tuple[Place, ...], angles: Ints
    ) -> Steps | None:
        """Places in the room, if it holds them and floors of regions are met, too."""
        cover, n = self.cover, self.sets.lattice.n_places
        free = self.sets.steps_of(lamps, eyes, angles=angles)
        if replace(cover, sets=free).refuted(np.arange(len(angles))):
            return None
        for by, sets in self.standing(lamps, eyes, angles):
            if replace(cover, sets=sets).lacking(angles):
                continue
            # Devices that stand by so much further on see the same as much later.
            places = _moved(lamps, by, n), _moved(eyes, by, n)
            return Steps(*places, np.sort((angles + by) % n), 1, "")
        return None

    def standing(
        self, lamps: tuple[Place, ...], eyes: tuple[Place, ...], angles: Ints
    ) -> Iterator[tuple[int, HeadSets]]:
        """Yield by how many places devices may be moved on, and what they do there.

        Angles count from before the move; where angle 0 is among them comes first. With
        nothing in the way of light it is the same everywhere, and told once.
        """
        begins = self.room.begins(lamps, eyes)
        # The table can turn by its own angles only.
        begins = begins[(begins + angles[0]) % self.sets.lattice.stride == 0]
        from_zero = np.isin(begins, -angles % self.sets.lattice.n_places)
        begins = begins[np.argsort(~from_zero, kind="stable")]
        if self.room.is_empty:
            for by in begins[:1].tolist():
                yield by, self.sets.steps_of(lamps, eyes)
            return
        every = self.room.clear(lamps, eyes, angles, begins)
        for by, clear in zip(begins.tolist(), every, strict=True):
            yield by, self.sets.steps_of(lamps, eyes, clear)


def _moved(at: tuple[Place, ...], by: int, n_places: int) -> tuple[Place, ...]:
    return tuple((circle, (place + by) % n_places) for circle, place in at)
