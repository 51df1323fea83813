"""The fewest steps of a turntable, for so many projectors and cameras before it.

With one projector its place on its circle is free: turn the table, and any other is as
good. So for k = 1, 2, ... all sets J of k angles are looked at for each circle: those
that light too little, or where even all cameras together measure too little, are left
out; for the others the places of cameras are tried, one, two or three at once. What is
found first takes the fewest steps of all places of the lattice, and the search is the
proof. Places of several projectors are the best found one after the other, and for
their number the bound leaves out who pairs with whom::

    steps >= ceil(K / P),  K the fewest pairs of place and angle that any cameras serve
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Ints
from planning.heads.head_cover import HeadCover
from planning.scene.placed_bodies import Device
from planning.scene.scene import Scene
from solvers import solve_cover

from .table_sets import Place, TableSets

_BUDGET = 2e8
# Sets of angles of which cameras are tried, at most, of each number and circle.
_TRIED = 4000
# Sets of angles at most that are looked at all; of more the number isn't proved.
_ALL = 800_000
# Circles from which places of several projectors are sought.
_BEGINNINGS = 2
_AT_ONCE = 20_000
_SEARCHED = "every choice of places and angles"
_SERVED = "what any cameras serve at a step"

_Bits = NDArray[np.uint8]


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
class _Seen:
    """What devices do at each of A angles, as bits of samples.

    Attributes:
        lamps: Places of projectors.
        near: Places of cameras that measure anything with them.
        lit: Shape (A, b).
        measured: By each of these cameras, shape (n_near, A, b).
    """

    lamps: tuple[Place, ...]
    near: tuple[Place, ...]
    lit: _Bits
    measured: _Bits


@dataclass(frozen=True, eq=False)
class StepSearch:
    """Looks for the fewest steps of a lattice's places.

    Attributes:
        scene: What is asked.
        sets: What pairs of places do.
        cover: What is asked, as rows; its sets are those of everything.
    """

    scene: Scene
    sets: TableSets
    cover: HeadCover

    @classmethod
    def of(cls, scene: Scene, sets: TableSets) -> "StepSearch":
        """Return the search for what a scene asks."""
        return cls(scene, sets, HeadCover.of(scene, sets.everywhere()))

    def fewest(self, n_lamps: int, n_eyes: int, most: int) -> tuple[Steps | None, int]:
        """Return the fewest steps for so many devices, and what is proved of them.

        None: at most so many steps weren't found to be enough.
        """
        seen = self._alone if n_lamps == 1 else self._seen(n_lamps)
        least, refuted = self._least(n_lamps, most), n_lamps == 1
        for count in range(least, most + 1):
            for one in seen:
                found, whole = self._at(one, count, n_eyes)
                if found is not None:
                    proof = _SEARCHED if refuted else _SERVED
                    return replace(found, lower_bound=least, proof=proof), least
                refuted &= whole
            if refuted:
                least = count + 1
        return None, least

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
        return -(-int(np.ceil(solution.lower_bound - 1e-9)) // n_lamps)

    def _at(self, seen: _Seen, count: int, n_eyes: int) -> tuple[Steps | None, bool]:
        """The first choice of so many angles that is enough, and whether all were seen.

        Those of most that any cameras measure come first.
        """
        angles, whole = self._angles(seen, count)
        for row in angles[:_TRIED]:
            self.scene.check_cancelled()
            bits = np.bitwise_or.reduce(seen.measured[:, row], axis=1)
            for chosen in _together(bits, n_eyes, self.cover.asked[1]):
                found = self._stands(seen, chosen, row)
                if found is not None:
                    return found, whole
        return None, whole and len(angles) <= _TRIED

    def _angles(self, seen: _Seen, count: int) -> tuple[Ints, bool]:
        """Sets of angles (m, count) that light enough and where cameras may measure it.

        And whether all sets were looked at.
        """
        lit, measured = self.cover.asked
        anyone = np.bitwise_or.reduce(seen.measured, axis=0)
        kept: list[Ints] = []
        held: list[Ints] = []
        looked = 0
        for part in _subsets(len(seen.lit), count):
            looked += len(part)
            enough = _count(_joined(seen.lit, part)) >= lit
            part = part[enough]
            counts = _count(_joined(anyone, part))
            kept.append(part[counts >= measured])
            held.append(counts[counts >= measured])
            if looked >= _ALL:
                break
        order = np.argsort(-np.concatenate(held), kind="stable")
        return np.concatenate(kept)[order], looked < _ALL

    def _stands(
        self, seen: _Seen, chosen: tuple[int, ...], angles: Ints
    ) -> Steps | None:
        """Places in the room, if it holds them and floors of regions are met, too."""
        lattice, eyes = self.sets.lattice, tuple(seen.near[k] for k in chosen)
        devices: list[tuple[Device, int]] = [
            *((lattice.projectors[e], i) for e, i in seen.lamps),
            *((lattice.cameras[f], k) for f, k in eyes),
        ]
        begins = lattice.begins(devices)
        cover = replace(self.cover, sets=self.sets.steps_of(seen.lamps, eyes))
        if not len(begins) or cover.lacking(angles):
            return None
        # Devices that stand by so much further on see the same at angles as much on.
        from_zero = np.isin(begins, -angles % lattice.n_places)
        by = int(begins[np.argmax(from_zero)])
        return Steps(
            _moved(seen.lamps, by, lattice.n_places),
            _moved(eyes, by, lattice.n_places),
            np.sort((angles + by) % lattice.n_places),
            1,
            "",
        )

    @cached_property
    def _alone(self) -> list[_Seen]:
        return self._seen(1)

    def _seen(self, n_lamps: int) -> list[_Seen]:
        return [_seen(self.sets, lamps) for lamps in self._lamps(n_lamps)]

    @cached_property
    def _n_circles(self) -> int:
        return len(self.sets.lattice.projectors)

    def _lamps(self, count: int) -> Iterator[tuple[Place, ...]]:
        """Yield places of projectors: one of each circle, or the best beside it."""
        alone = [((e, 0),) for e in range(self._n_circles)]
        if count == 1:
            yield from alone
            return
        order = np.argsort([-self._light(one) for one in alone], kind="stable")
        places = range(self.sets.lattice.n_places)
        for k in order[:_BEGINNINGS]:
            chosen: tuple[Place, ...] = alone[int(k)]
            while len(chosen) < count:
                every = product(range(self._n_circles), places)
                others = [one for one in every if one not in chosen]
                light = [self._light((*chosen, one)) for one in others]
                chosen = (*chosen, others[int(np.argmax(light))])
            yield chosen

    def _light(self, lamps: tuple[Place, ...]) -> float:
        """How much projectors light at all angles together, then on average."""
        lit = self.sets.steps_of(lamps, ()).lit
        return float(lit.any(axis=1).sum()) + float(lit.mean())


def _seen(sets: TableSets, lamps: tuple[Place, ...]) -> _Seen:
    places = sets.lattice.n_places
    every = ((f, (k + i) % places) for e, i in lamps for f, k in sets.near((e, 0)))
    near = tuple(dict.fromkeys(every))
    light = _packed(sets.steps_of(lamps, ()).lit)
    measured = [_packed(sets.steps_of(lamps, (eye,)).measured) for eye in near]
    shape = (len(near), *light.shape)
    return _Seen(lamps, near, light, np.array(measured, np.uint8).reshape(shape))


def _packed(rows: NDArray[np.bool_]) -> _Bits:
    return np.packbits(rows.T, axis=1)


def _joined(bits: _Bits, sets: Ints) -> _Bits:
    """What sets (m, k) of rows (A, b) hold together, (m, b)."""
    together = np.zeros((len(sets), bits.shape[1]), dtype=np.uint8)
    for column in sets.T:
        together |= bits[column]
    return together


def _count(bits: _Bits) -> Ints:
    return np.bitwise_count(bits).sum(axis=-1, dtype=np.int64)


def _subsets(n: int, count: int) -> Iterator[Ints]:
    """Yield all sets of so many of n, many at once, (m, count)."""
    every = combinations(range(n), count)
    while True:
        part = [one for one, _ in zip(every, range(_AT_ONCE), strict=False)]
        if not part:
            return
        yield np.array(part, dtype=np.int64)


def _together(bits: _Bits, count: int, asked: int) -> Iterator[tuple[int, ...]]:
    """Yield which rows (n, b), one to three at once, hold enough; the most first."""
    n = len(bits)
    if count == 1:
        held = _count(bits)
        for k in np.argsort(-held, kind="stable"):
            if held[k] < asked:
                return
            yield (int(k),)
        return
    alone = _count(bits)
    best = int(alone.max(initial=0))
    found: list[tuple[int, tuple[int, ...]]] = []
    for k in range(n - count + 1):
        if alone[k] + (count - 1) * best < asked:
            continue
        joined = bits[k] | bits[k + 1 :]
        if count == 2:
            held = _count(joined)
            good = np.flatnonzero(held >= asked)
            found += [(-int(held[j]), (k, k + 1 + int(j))) for j in good]
            continue
        for rest in _together(joined, count - 1, asked):
            held = int(_count(np.bitwise_or.reduce(joined[list(rest)])))
            found.append((-held, (k, *(k + 1 + j for j in rest))))
    for _, chosen in sorted(found):
        yield chosen


def _moved(at: tuple[Place, ...], by: int, n_places: int) -> tuple[Place, ...]:
    return tuple((circle, (place + by) % n_places) for circle, place in at)


def pairs_of_counts(most_lamps: int, most_eyes: int) -> list[tuple[int, int]]:
    """Return numbers of projectors and cameras, fewest devices first."""
    every = product(range(1, most_lamps + 1), range(1, most_eyes + 1))
    return sorted(every, key=lambda pair: (sum(pair), pair))
