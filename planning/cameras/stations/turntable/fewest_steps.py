"""The fewest steps of a turntable, for so many projectors and cameras before it.

The place of the first projector on its circle is free: turn the table, and any other is
as good. So for k = 1, 2, ... all sets J of k angles are looked at for all places of one
or two projectors: those that light too little, or where even all cameras together
measure too little, are left out; for the others the places of cameras are tried, one,
two or three at once. What is found first takes the fewest steps of all places of the
lattice, and the search is the proof. Where it was cut the bound leaves out who pairs
with whom::

    steps >= ceil(K / P),  K the fewest pairs of place and angle that any cameras serve
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement, product

import numpy as np

from geometry.arrays import Ints
from planning.cameras.stations.heads.head_cover import HeadCover, HeadSets
from planning.scene.scene import Scene
from solvers import solve_cover

from .circle import Circle
from .sample_bits import (
    Bits,
    held_by,
    joined,
    rows_of_most,
    rows_together,
    subsets,
)
from .table_room import TableRoom
from .table_sets import Place, TableSets

_BUDGET = 2e8
# Sets of angles at most that are looked at, for all places of as many projectors, and
# of which cameras are tried; of more the number isn't proved. After some, steps that
# are enough are looked for in another way, with the first of the projectors.
_ALL, _TRIED = 20_000_000, 4000
_SOON, _FIRST = 1_000_000, 4
_SEARCHED = "every choice of places and angles"
_SERVED = "what any cameras serve at a step"


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


@dataclass
class _Spent:
    """Sets of angles looked at, and tried with cameras; whether it ended there."""

    looked: int = 0
    tried: int = 0
    cut: bool = False


@dataclass(frozen=True, eq=False)
class StepSearch:
    """Looks for the fewest steps of a lattice's places.

    Attributes:
        scene: What is asked.
        sets: What pairs of places do.
        room: What stands about the table.
        cover: What is asked, as rows; its sets are those of everything.
    """

    scene: Scene
    sets: TableSets
    room: TableRoom
    cover: HeadCover

    @classmethod
    def of(cls, scene: Scene, sets: TableSets, room: TableRoom) -> "StepSearch":
        """Return the search for what a scene asks."""
        return cls(scene, sets, room, HeadCover.of(scene, sets.everywhere()))

    def fewest(self, n_lamps: int, n_eyes: int, most: int) -> tuple[Steps | None, int]:
        """Return the fewest steps of one or two projectors, and what is proved of them.

        None: at most so many steps weren't found to be enough; are they refuted, the
        bound is above them.
        """
        kept = self._kept(n_lamps, n_eyes)
        if not kept:
            return None, most + 1
        least, refuted = self._least(n_lamps, most), True
        spent = _Spent()
        best: Steps | None = None
        for count in range(least, most + 1):
            if (found := self._at(kept, count, n_eyes, spent)) is not None:
                best = found
                break
            refuted &= not spent.cut
            if refuted:
                least = count + 1
            if best is None and (spent.cut or spent.looked > _SOON):
                best = self._some(kept, n_eyes, most)
            if spent.cut or (best is not None and len(best.angles) <= count):
                break
        if best is None:
            return None, least
        least = min(least, len(best.angles))
        proof = _SEARCHED if refuted else _SERVED
        return replace(best, lower_bound=least, proof=proof), least

    def _kept(self, n_lamps: int, n_eyes: int) -> list[tuple[Place, ...]]:
        """Places of projectors with which cameras may measure enough at all angles.

        Those with which any cameras measure most come first.
        """
        lit, measured = self.cover.asked
        kept: list[tuple[int, tuple[Place, ...]]] = []
        for lamps in self._lamps(n_lamps):
            self.scene.check_cancelled()
            most = 0
            light, anyone = self._bits(lamps)
            for angles in self._cosets:
                every = np.bitwise_or.reduce(light[angles], axis=0)
                held = int(held_by(np.bitwise_or.reduce(anyone[angles], axis=0)))
                if held_by(every) < lit or held < measured:
                    continue
                _, bits = self._measured(lamps, angles)
                alone = np.sort(held_by(bits))[-n_eyes:]
                if alone.sum() >= measured and (
                    n_lamps > 1 or next(rows_together(bits, n_eyes, measured), None)
                ):
                    most = max(most, held)
            if most:
                kept.append((-most, lamps))
        return [lamps for _, lamps in sorted(kept)]

    def _some(
        self, kept: Sequence[tuple[Place, ...]], n_eyes: int, most: int
    ) -> Steps | None:
        """Steps that are enough: cameras that measure most of all, then angles."""
        best: Steps | None = None
        for lamps, angles in product(kept[:_FIRST], self._cosets):
            self.scene.check_cancelled()
            near, bits = self._measured(lamps, angles)
            eyes = tuple(near[k] for k in rows_of_most(bits, n_eyes))
            if len(eyes) < n_eyes:
                continue
            for _, sets in self._standing(lamps, eyes, angles):
                cover = replace(self.cover, sets=sets.take(angles))
                if cover.lacking(np.arange(len(angles))):
                    continue
                few = solve_cover(cover.problem, seed=self.scene.seed, budget=_BUDGET)
                steps = self._stands(lamps, eyes, angles[few.selected])
                if steps is None or len(few.selected) > most:
                    continue
                if best is None or len(steps.angles) < len(best.angles):
                    best = steps
        return best

    def _least(self, n_lamps: int, most: int) -> int:
        """Fewest steps of so many projectors with any cameras at any place."""
        every = [self.sets.steps_of([(e, 0)], None) for e in range(self._n_circles)]
        together = every[0]
        for one in every[1:]:
            together = together.beside(one)
        cover = replace(self.cover, sets=together)
        if cover.lacking(np.arange(together.lit.shape[1])):
            return most + 1
        solution = solve_cover(cover.problem, seed=self.scene.seed, budget=_BUDGET)
        least, _ = cover.proved(solution, seed=self.scene.seed, budget=_BUDGET)
        return -(-least // n_lamps)

    def _at(
        self,
        kept: Sequence[tuple[Place, ...]],
        count: int,
        n_eyes: int,
        spent: "_Spent",
    ) -> Steps | None:
        """A choice of so many angles that is enough.

        Of each choice of projectors those of most that any cameras measure come first.
        """
        for lamps in kept:
            self.scene.check_cancelled()
            for row in self._angles(lamps, count, spent):
                spent.tried += 1
                near, bits = self._measured(lamps, row)
                for chosen in rows_together(bits, n_eyes, self.cover.asked[1]):
                    eyes = tuple(near[k] for k in chosen)
                    if (found := self._stands(lamps, eyes, row)) is not None:
                        return found
                    # What is in the way is looked at for each choice anew.
                    spent.tried += not self.room.is_empty
                    if spent.tried >= _TRIED:
                        break
                if spent.tried >= _TRIED:
                    break
            if spent.looked >= _ALL or spent.tried >= _TRIED:
                spent.cut = True
                return None
        return None

    @property
    def _cosets(self) -> list[Ints]:
        """Places that the table can take to each other, as many as it has angles."""
        lattice = self.sets.lattice
        every = lattice.stride * np.arange(lattice.n_angles, dtype=np.int64)
        return [every + begin for begin in range(lattice.stride)]

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

    def _angles(self, lamps: tuple[Place, ...], count: int, spent: "_Spent") -> Ints:
        """Sets of angles (m, count) that light enough and where any cameras measure it.

        Those where they measure most come first.
        """
        lit, measured = self.cover.asked
        light, anyone = self._bits(lamps)
        kept: list[Ints] = [np.empty((0, count), dtype=np.int64)]
        held: list[Ints] = [np.empty(0, dtype=np.int64)]
        for places in self._cosets:
            for rows in subsets(len(places), count):
                if spent.looked >= _ALL:
                    break
                spent.looked += len(rows)
                part = places[rows]
                part = part[held_by(joined(light, part)) >= lit]
                counts = held_by(joined(anyone, part))
                kept.append(part[counts >= measured])
                held.append(counts[counts >= measured])
        order = np.argsort(-np.concatenate(held), kind="stable")
        return np.concatenate(kept)[order]

    def _measured(
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

    def _stands(
        self, lamps: tuple[Place, ...], eyes: tuple[Place, ...], angles: Ints
    ) -> Steps | None:
        """Places in the room, if it holds them and floors of regions are met, too."""
        cover, n = self.cover, self.sets.lattice.n_places
        if replace(cover, sets=self.sets.steps_of(lamps, eyes)).lacking(angles):
            return None
        for by, sets in self._standing(lamps, eyes, angles):
            if replace(cover, sets=sets).lacking(angles):
                continue
            # Devices that stand by so much further on see the same as much later.
            places = _moved(lamps, by, n), _moved(eyes, by, n)
            return Steps(*places, np.sort((angles + by) % n), 1, "")
        return None

    def _standing(
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

    @cached_property
    def _circles(self) -> list[Circle]:
        return [Circle.of(self.sets, e) for e in range(self._n_circles)]

    @cached_property
    def _n_circles(self) -> int:
        return len(self.sets.lattice.projectors)

    def _lamps(self, count: int) -> Iterator[tuple[Place, ...]]:
        """Yield places of projectors, all of one or two of them."""
        circles, places = range(self._n_circles), self.sets.lattice.n_places
        if count == 1:
            yield from (((e, 0),) for e in circles)
            return
        for e, f in combinations_with_replacement(circles, 2):
            # On one circle half a turn is as good as the other half.
            turn = places // 2 + 1 if e == f else places
            yield from (((e, 0), (f, i)) for i in range(e == f, turn))


def _moved(at: tuple[Place, ...], by: int, n_places: int) -> tuple[Place, ...]:
    return tuple((circle, (place + by) % n_places) for circle, place in at)


def pairs_of_counts(most_lamps: int, most_eyes: int) -> list[tuple[int, int]]:
    """Return numbers of projectors and cameras, fewest devices first."""
    every = product(range(1, most_lamps + 1), range(1, most_eyes + 1))
    return sorted(every, key=lambda pair: (sum(pair), pair))
