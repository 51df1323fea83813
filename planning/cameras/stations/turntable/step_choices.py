"""Choices of projectors, angles and cameras about a table, the most promising first."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

from geometry.arrays import Ints
from planning.cameras.stations.heads.head_cover import HeadCover

from .circle import Circle
from .sample_bits import (
    Bits,
    are_enough_together,
    held_by,
    joined,
    packed,
    subsets,
)
from .table_sets import Place, TableSets


@dataclass
class Spent:
    """Sets of angles looked at, and tried with cameras; whether it ended there.

    Attributes:
        most_looked: How many may be looked at; `most_tried` likewise, and `most_stood`
            of the choices of cameras for them.
    """

    most_looked: int
    most_tried: int
    most_stood: int
    looked: int = 0
    tried: int = 0
    stood: int = 0
    cut: bool = False

    @property
    def all_tried(self) -> bool:
        """Whether no more may be tried."""
        return self.tried >= self.most_tried or self.stood >= self.most_stood

    @property
    def is_over(self) -> bool:
        """Whether no more may be looked at, or tried."""
        return self.looked >= self.most_looked or self.all_tried


@dataclass(frozen=True, eq=False)
class StepChoices:
    """Choices that may be enough, whatever stands in the way.

    Attributes:
        sets: What pairs of places do.
        cover: What is asked, as rows.
    """

    sets: TableSets
    cover: HeadCover

    @cached_property
    def cosets(self) -> list[Ints]:
        """Places that the table can take to each other, as many as it has angles."""
        lattice = self.sets.lattice
        every = lattice.stride * np.arange(lattice.n_angles, dtype=np.int64)
        return [every + begin for begin in range(lattice.stride)]

    def lamps(self, count: int) -> Iterator[tuple[Place, ...]]:
        """Yield places of projectors, all of one or two of them."""
        circles, places = range(self._n_circles), self.sets.lattice.n_places
        if count == 1:
            yield from (((e, 0),) for e in circles)
            return
        for e, f in combinations_with_replacement(circles, 2):
            # On one circle half a turn is as good as the other half.
            turn = places // 2 + 1 if e == f else places
            yield from (((e, 0), (f, i)) for i in range(e == f, turn))

    def promise(self, lamps: tuple[Place, ...], n_eyes: int) -> int:
        """Return how much any cameras measure with projectors, at all angles.

        0 where so many can't measure enough.
        """
        lit, measured = self.cover.asked
        most = 0
        light, anyone = self._bits(lamps)
        for angles in self.cosets:
            every = np.bitwise_or.reduce(light[angles], axis=0)
            held = int(held_by(np.bitwise_or.reduce(anyone[angles], axis=0)))
            if held_by(every) < lit or held < measured:
                continue
            _, bits = self.measured(lamps, angles)
            alone = np.sort(held_by(bits))[-n_eyes:]
            if alone.sum() >= measured and (
                len(lamps) > 1 or are_enough_together(bits, n_eyes, measured)
            ):
                most = max(most, held)
        return most

    def angles(self, lamps: tuple[Place, ...], count: int, spent: Spent) -> Ints:
        """Sets of angles (m, count) that light enough and where any cameras measure it.

        Those where they measure most come first.
        """
        lit, measured = self.cover.asked
        light, anyone = self._bits(lamps)
        kept: list[Ints] = [np.empty((0, count), dtype=np.int64)]
        held: list[Ints] = [np.empty(0, dtype=np.int64)]
        for places in self.cosets:
            for rows in subsets(len(places), count):
                if spent.looked >= spent.most_looked:
                    break
                spent.looked += len(rows)
                part = places[rows]
                part = part[held_by(joined(light, part)) >= lit]
                counts = held_by(joined(anyone, part))
                kept.append(part[counts >= measured])
                held.append(counts[counts >= measured])
        order = np.argsort(-np.concatenate(held), kind="stable")
        return np.concatenate(kept)[order]

    def asked(self, lamps: tuple[Place, ...], angles: Ints) -> int:
        """Return how much must be measured of what is lit, with nothing in the way."""
        light = joined(self._bits(lamps)[0], angles[None])
        number = self.cover.totals[1]
        due = self.cover.shares[number] * int(held_by(light & self._measurable)[0])
        return max(self.cover.asked[1], int(np.ceil(due - 1e-9)))

    def measured(
        self, lamps: tuple[Place, ...], angles: Ints
    ) -> tuple[list[Place], Bits]:
        """Places of cameras, and what each measures at angles with them, (n, b)."""
        places, n_bytes = self.sets.lattice.n_places, self._circles[0].lit.shape[1]
        every: dict[Place, Bits] = {}
        for e, i in lamps:
            for (f, k), bits in self._circles[e].measured.items():
                own = np.bitwise_or.reduce(bits[(angles - i) % places], axis=0)
                at = f, (k + i) % places
                every[at] = every[at] | own if at in every else own
        rows = np.array(list(every.values()), dtype=np.uint8)
        return list(every), rows.reshape(-1, n_bytes)

    def _bits(self, lamps: tuple[Place, ...]) -> tuple[Bits, Bits]:
        """What projectors light at each angle, and any cameras measure, (A, b)."""
        light, anyone = (
            np.bitwise_or.reduce([np.roll(bits, i, axis=0) for bits, i in each])
            for each in (
                [(self._circles[e].lit, i) for e, i in lamps],
                [(self._circles[e].anyone, i) for e, i in lamps],
            )
        )
        return light, anyone

    @cached_property
    def _measurable(self) -> Bits:
        """What any pair measures at any angle, (1, b)."""
        return packed(self.sets.everywhere().measured)

    @cached_property
    def _circles(self) -> list[Circle]:
        return [Circle.of(self.sets, e) for e in range(self._n_circles)]

    @cached_property
    def _n_circles(self) -> int:
        return len(self.sets.lattice.projectors)
