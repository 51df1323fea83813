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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from planning.cameras.stations.heads.head_cover import HeadCover
from planning.scene.scene import Scene
from solvers import solve_cover

from .sample_bits import rows_together
from .some_steps import SomeSteps
from .standing_steps import StandingSteps, Steps
from .step_choices import Spent, StepChoices
from .table_room import TableRoom
from .table_sets import Place, TableSets

_BUDGET = 2e8
# Sets of angles at most that are looked at, for all places of as many projectors, and
# of which cameras are tried, so many choices of these; of more the number isn't proved.
# After some, steps that are enough are looked for in another way.
_ALL, _TRIED, _STOOD = 20_000_000, 4000, 100_000
_SOON = 1_000_000
# Of each choice of projectors so many are tried before others have their turn, and in
# its next turn so many times as many.
_TURN, _LONGER = 16, 4
_SEARCHED = "every choice of places and angles"
_SERVED = "what any cameras serve at a step"


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
        spent = Spent(_ALL, _TRIED, _STOOD)
        best: Steps | None = None
        for count in range(least, most + 1):
            if (found := self._at(kept, count, n_eyes, spent)) is not None:
                best = found
                break
            refuted &= not spent.cut
            if refuted:
                least = count + 1
            if best is None and (spent.cut or spent.looked > _SOON):
                best = self._some.of(kept, n_eyes, most)
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
        kept: list[tuple[int, tuple[Place, ...]]] = []
        for lamps in self._choices.lamps(n_lamps):
            self.scene.check_cancelled()
            if most := self._choices.promise(lamps, n_eyes):
                kept.append((-most, lamps))
        return [lamps for _, lamps in sorted(kept)]

    def _least(self, n_lamps: int, most: int) -> int:
        """Fewest steps of so many projectors with any cameras at any place."""
        every = [
            self.sets.steps_of([(e, 0)], None)
            for e in range(len(self.sets.lattice.projectors))
        ]
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
        self, kept: Sequence[tuple[Place, ...]], count: int, n_eyes: int, spent: Spent
    ) -> Steps | None:
        """A choice of so many angles that is enough.

        Of each choice of projectors those of most that any cameras measure come first.
        Where many of one may have no room the others have their turn before it goes on.
        """
        begin, end = 0, _TRIED if self.room.is_empty else _TURN
        while kept:
            unfinished: list[tuple[Place, ...]] = []
            for lamps in kept:
                self.scene.check_cancelled()
                found, ended = self._with(lamps, count, n_eyes, spent, (begin, end))
                if found is not None:
                    return found
                if spent.is_over:
                    spent.cut = True
                    return None
                if not ended:
                    unfinished.append(lamps)
            kept, begin, end = unfinished, end, _LONGER * end
        return None

    def _with(
        self,
        lamps: tuple[Place, ...],
        count: int,
        n_eyes: int,
        spent: Spent,
        turn: tuple[int, int],
    ) -> tuple[Steps | None, bool]:
        """The first choice with projectors that is enough, and whether all were tried.

        Tried are those from one number up to another.
        """
        n, (begin, end) = 0, turn
        least, crowded = self.cover.asked[1], not self.room.is_empty
        for row in self._choices.angles(lamps, count, spent):
            n += 1
            spent.tried += n > begin
            near, bits = self._choices.measured(lamps, row)
            # What is in the way of light leaves less to measure.
            asked = least if crowded else self._choices.asked(lamps, row)
            for chosen in rows_together(bits, n_eyes, asked):
                # What is in the way is looked at for each choice anew.
                n += crowded
                if n <= begin:
                    continue
                if spent.all_tried or n > end:
                    return None, False
                eyes = tuple(near[k] for k in chosen)
                spent.stood += 1
                if (found := self._stand.enough(lamps, eyes, row)) is not None:
                    return found, True
                spent.tried += crowded
            if spent.all_tried or n > end:
                return None, False
        return None, True

    @cached_property
    def _choices(self) -> StepChoices:
        return StepChoices(self.sets, self.cover)

    @cached_property
    def _stand(self) -> StandingSteps:
        return StandingSteps(self.sets, self.room, self.cover)

    @cached_property
    def _some(self) -> SomeSteps:
        return SomeSteps(self.scene, self._choices, self._stand)


def pairs_of_counts(most_lamps: int, most_eyes: int) -> list[tuple[int, int]]:
    """Return numbers of projectors and cameras, fewest devices first."""
    every = product(range(1, most_lamps + 1), range(1, most_eyes + 1))
    return sorted(every, key=lambda pair: (sum(pair), pair))
