"""The fewest steps of a turntable, for so many projectors and cameras before it.

A choice of places is a cover of its own: its sets are the angles of the table, and what
is asked is the same for every choice. With one projector its place on its circle is
free (turn the table, and any other is as good). So all choices of it and of one or two
cameras are looked at: one whose k largest sets hold together fewer samples than are
asked needs more than k steps; the others are solved, those of the smallest k first. The
bound of other numbers of devices leaves the cameras out::

    steps >= ceil(K / P),  K the fewest pairs of place and angle that any cameras serve
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Ints
from planning.heads.head_cover import HeadCover, HeadSets
from planning.scene.placed_bodies import Device
from planning.scene.scene import Scene
from solvers import solve_cover

from .table_sets import Place, TableSets

_BUDGET = 2e8
# Choices that are solved for each number of devices, at most.
_SOLVED = 300
# Circles from which places of several projectors are sought, one after another.
_BEGINNINGS = 4
_NEVER = 1 << 30

_Choice = tuple[tuple[Place, ...], tuple[Place, ...]]
_Bits = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Steps:
    """Places of devices, and the angles at which they measure.

    Attributes:
        lamps: Places of the projectors, `eyes` of the cameras, as the room has them.
        angles: Chosen ones, as places of the table, (k,).
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

    def fewest(self, n_lamps: int, n_eyes: int) -> Steps | None:
        """Return the fewest steps for so many devices; None: no choice was enough."""
        best, open_ = None, _NEVER
        for k, (few, choice) in enumerate(self._promising(n_lamps, n_eyes)):
            if k >= _SOLVED or (best is not None and few >= len(best.angles)):
                open_ = min(open_, few)
                break
            found = self._solved(choice)
            if found is None:
                continue
            open_ = min(open_, found.lower_bound)
            if best is None or len(found.angles) < len(best.angles):
                best = found
        if best is None:
            return None
        bound, proof = self.least(n_lamps) or 1, "what any cameras serve at a step"
        if n_lamps == 1 and n_eyes <= 2:
            each = min(open_, len(best.angles))
            if each > bound:
                bound, proof = each, "every choice of places"
        return replace(best, lower_bound=min(bound, len(best.angles)), proof=proof)

    def least(self, n_lamps: int) -> int | None:
        """Return the fewest steps of so many projectors with any cameras at any place.

        None: no number of them is enough.
        """
        alone = [self.sets.steps_of([(e, 0)], None) for e in range(self._n_circles)]
        if n_lamps == 1:
            counts = (self._count(one) for one in alone)
            return min((n for n in counts if n is not None), default=None)
        together = alone[0]
        for one in alone[1:]:
            together = together.beside(one)
        count = self._count(together)
        return None if count is None else -(-count // n_lamps)

    def _count(self, sets: HeadSets) -> int | None:
        cover = replace(self.cover, sets=sets)
        if cover.lacking(np.arange(sets.lit.shape[1])):
            return None
        solution = solve_cover(cover.problem, seed=self.scene.seed, budget=_BUDGET)
        return int(np.ceil(solution.lower_bound - 1e-9))

    def _solved(self, choice: _Choice) -> Steps | None:
        """The fewest angles of a choice of places; None: it isn't one, or not enough."""
        lamps, eyes = choice
        lattice = self.sets.lattice
        devices: list[tuple[Device, int]] = [
            *((lattice.projectors[e], i) for e, i in lamps),
            *((lattice.cameras[f], k) for f, k in eyes),
        ]
        begins = lattice.begins(devices)
        if not len(begins):
            return None
        sets = self.sets.steps_of(lamps, eyes)
        cover = replace(self.cover, sets=sets)
        if cover.lacking(np.arange(lattice.n_places)):
            return None
        solution = solve_cover(cover.problem, seed=self.scene.seed, budget=_BUDGET)
        bound = int(np.ceil(solution.lower_bound - 1e-9))
        # Devices that stand by so much further on see the same at angles as much on.
        from_zero = np.isin(begins, -solution.selected % lattice.n_places)
        by = int(begins[np.argmax(from_zero)])
        lamps, eyes = (_moved(at, by, lattice.n_places) for at in (lamps, eyes))
        angles = np.sort((solution.selected + by) % lattice.n_places)
        return Steps(lamps, eyes, angles, bound, solution.proof)

    def _promising(self, n_lamps: int, n_eyes: int) -> list[tuple[int, _Choice]]:
        """Choices that may be enough with the least steps of each, fewest first."""
        found: list[tuple[int, _Choice]] = []
        for lamps in self._lamps(n_lamps):
            dark = self._few(self._packed(lamps, None)[None], light=True)[0]
            if dark == _NEVER:
                continue
            near = self._near(lamps)
            bits = np.stack([self._packed(lamps, eye) for eye in near])
            for eyes, counts in self._eyes(bits, n_eyes, every=n_lamps == 1):
                found += [
                    (int(max(few, dark)), (lamps, tuple(near[k] for k in chosen)))
                    for chosen, few in zip(eyes, counts, strict=True)
                    if few < _NEVER
                ]
        return sorted(found, key=lambda one: one[0])

    def _lamps(self, count: int) -> Iterator[tuple[Place, ...]]:
        """Places of projectors: one of each circle; of several the best beside it."""
        alone = [((e, 0),) for e in range(self._n_circles)]
        if count == 1:
            yield from alone
            return
        least = [self._lacking_light(one) for one in alone]
        for k in np.argsort(least, kind="stable")[:_BEGINNINGS]:
            chosen: tuple[Place, ...] = alone[int(k)]
            while len(chosen) < count:
                others = [
                    (e, i)
                    for e in range(self._n_circles)
                    for i in range(self.sets.lattice.n_places)
                    if (e, i) not in chosen
                ]
                short = [self._lacking_light((*chosen, one)) for one in others]
                chosen = (*chosen, others[int(np.argmin(short))])
            yield chosen

    def _lacking_light(self, lamps: tuple[Place, ...]) -> float:
        """How much less than everything a few steps of projectors light on average."""
        lit = self.sets.steps_of(lamps, ()).lit
        return -float(lit.any(axis=1).sum()) - lit.mean()

    def _near(self, lamps: tuple[Place, ...]) -> list[Place]:
        places = self.sets.lattice.n_places
        every = (
            (f, (k + i) % places) for e, i in lamps for f, k in self.sets.near((e, 0))
        )
        return list(dict.fromkeys(every))

    def _packed(self, lamps: tuple[Place, ...], eye: Place | None) -> _Bits:
        """What a camera measures with projectors at each angle, as bits; None: light."""
        sets = self.sets.steps_of(lamps, () if eye is None else (eye,))
        rows = sets.lit if eye is None else sets.measured
        return np.packbits(rows.T, axis=1)

    def _eyes(
        self, bits: _Bits, count: int, *, every: bool
    ) -> Iterator[tuple[list[tuple[int, ...]], Ints]]:
        """Yield choices of cameras, by rows of bits (k, A, b), and their least steps.

        Of one or two all, if `every`; else for each the best beside it, one by one.
        """
        n = len(bits)
        if count == 1:
            yield [(k,) for k in range(n)], self._few(bits)
            return
        for k in range(n):
            chosen, together = (k,), bits[k]
            while len(chosen) < count:
                joined = together | bits
                last = len(chosen) == count - 1
                if last and every and count == 2:
                    after = range(k + 1, n)
                    yield [(k, j) for j in after], self._few(joined[k + 1 :])
                    break
                gained = np.bitwise_count(joined).sum(axis=(1, 2), dtype=np.int64)
                gained[list(chosen)] = -1
                best = int(np.argmax(gained))
                chosen, together = (*chosen, best), joined[best]
            else:
                yield [chosen], self._few(together[None])

    def _few(self, bits: _Bits, *, light: bool = False) -> Ints:
        """The least k whose k largest sets hold what is asked together, (m,)."""
        asked = self.cover.asked[0 if light else 1]
        counts = np.bitwise_count(bits).sum(axis=2, dtype=np.int64)
        most = np.cumsum(-np.sort(-counts, axis=1), axis=1)
        few = 1 + np.argmax(most >= asked, axis=1)
        whole = np.bitwise_or.reduce(bits, axis=1)
        reached = np.bitwise_count(whole).sum(axis=1, dtype=np.int64)
        return np.where(reached >= asked, few, _NEVER)

    @cached_property
    def _n_circles(self) -> int:
        return len(self.sets.lattice.projectors)


def _moved(at: tuple[Place, ...], by: int, n_places: int) -> tuple[Place, ...]:
    return tuple((circle, (place + by) % n_places) for circle, place in at)


def pairs_of_counts(most_lamps: int, most_eyes: int) -> list[tuple[int, int]]:
    """Return numbers of projectors and cameras, fewest devices first."""
    every = [(p, c) for p in range(1, most_lamps + 1) for c in range(1, most_eyes + 1)]
    return sorted(every, key=lambda pair: (sum(pair), pair))
