"""Steps that are enough, found without looking at every choice.

First cameras that measure most, with the projectors of which most is expected; then
draws of both, since what measures most may have no room. Of the cameras drawn the
fewest angles are a cover.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np

from geometry.arrays import Ints
from planning.scene.scene import Scene

from .sample_bits import held_by, joined, rows_of_most
from .standing_steps import StandingSteps, Steps
from .step_choices import StepChoices
from .table_sets import Place

_BUDGET = 2e8
# Choices of projectors of which cameras that measure most are taken; draws of others,
# draws of cameras for each, and how many cameras these are drawn from.
_FIRST, _DRAWS, _AT_ONCE, _AMONG = 4, 400, 50, 60
# Draws that are enough of which the fewest steps are taken.
_ENOUGH = 3


@dataclass(frozen=True, eq=False)
class SomeSteps:
    """Looks for steps that are enough.

    Attributes:
        scene: What is asked.
        choices: What may be chosen.
        stand: The room.
    """

    scene: Scene
    choices: StepChoices
    stand: StandingSteps

    def of(
        self, kept: Sequence[tuple[Place, ...]], n_eyes: int, most: int
    ) -> Steps | None:
        """Return steps with some of the projectors kept; None: none were found."""
        found = [
            steps
            for lamps, eyes, angles in self._greedy(kept, n_eyes)
            for steps in self._fewest(lamps, eyes, angles, most)
        ]
        if not found:
            drawn = self._drawn(kept, n_eyes)
            first = (next(self._fewest(*each, most), None) for each in drawn)
            found = list(islice((one for one in first if one is not None), _ENOUGH))
        return min(found, key=lambda steps: len(steps.angles), default=None)

    def _greedy(
        self, kept: Sequence[tuple[Place, ...]], n_eyes: int
    ) -> Iterator[tuple[tuple[Place, ...], tuple[Place, ...], Ints]]:
        """Yield projectors, cameras that measure most beside each other, and angles."""
        for lamps, angles in product(kept[:_FIRST], self.choices.cosets):
            near, bits = self.choices.measured(lamps, angles)
            eyes = tuple(near[k] for k in rows_of_most(bits, n_eyes))
            if len(eyes) == n_eyes:
                yield lamps, eyes, angles

    def _drawn(
        self, kept: Sequence[tuple[Place, ...]], n_eyes: int
    ) -> Iterator[tuple[tuple[Place, ...], tuple[Place, ...], Ints]]:
        """Yield draws that are enough at all angles, if nothing is in the way."""
        rng = np.random.default_rng(self.scene.seed)
        cosets = self.choices.cosets
        for _ in range(_DRAWS):
            lamps = kept[int(rng.integers(len(kept)))]
            angles = cosets[int(rng.integers(len(cosets)))]
            near, bits = self.choices.measured(lamps, angles)
            among = np.argsort(-held_by(bits), kind="stable")[:_AMONG]
            if len(among) < n_eyes:
                continue
            rows = among[rng.random((_AT_ONCE, len(among))).argsort(axis=1)[:, :n_eyes]]
            asked = self.choices.asked(lamps, angles)
            good = rows[held_by(joined(bits, rows)) >= asked]
            if len(good):
                yield lamps, tuple(near[k] for k in good[0]), angles

    def _fewest(
        self,
        lamps: tuple[Place, ...],
        eyes: tuple[Place, ...],
        angles: Ints,
        most: int,
    ) -> Iterator[Steps]:
        """Yield the fewest steps of places, from each beginning that is enough."""
        self.scene.check_cancelled()
        for _, sets in self.stand.standing(lamps, eyes, angles):
            cover = replace(self.stand.cover, sets=sets.take(angles))
            if cover.lacking(np.arange(len(angles))):
                continue
            few, _ = cover.fewest(seed=self.scene.seed, budget=_BUDGET)
            steps = self.stand.enough(lamps, eyes, angles[few])
            if steps is not None and len(few) <= most:
                yield steps
