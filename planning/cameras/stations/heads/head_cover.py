"""What heads light and measure of samples, and what is asked of several together.

Each measures by itself, with pairs of its own devices. Of n samples that candidates
light n_L and measure n_M; the fewest heads are sought that together::

    light >= ceil(dominant_coverage n_L)   and   measure >= ceil(coverage n_R)

with n_R the samples that they light and any candidate measures, and so of every large
region, with its floor. That isn't a cover, since n_R grows with what they light. But of
those lit n_L - n_M at most can't be measured, so that all heads that are enough::

    measure >= ceil(coverage (ceil(dominant_coverage n_L) - (n_L - n_M)))

A sample stands in a row for each of these that it counts for, so that with these least
floors all of it is one cover, whose bound holds. Its floors are raised to what the
light of its heads asks for, until heads meet it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from geometry.arrays import Array, Ints, Mask
from planning.proofs.quotas import Quotas, RegionFloors
from planning.proofs.selection import cover_problem
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import LitSamples, measured_by
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene
from solvers import CoverProblem, CoverSolution, solve_cover

from .head_poses import PlacedHead

# Times that floors are raised to what is due, before they are to what can be at most.
_RAISES = 8
# Counted work of each cover with raised floors, of which no proof is asked.
_RAISED_BUDGET = 5e7


@dataclass(frozen=True, eq=False)
class HeadSets:
    """What each of k heads lights and measures of n samples, shape (n, k)."""

    target: Target
    lit: Mask
    measured: Mask

    @classmethod
    def of(
        cls, scene: Scene, heads: Sequence[PlacedHead], target: Target
    ) -> "HeadSets":
        """Return what heads do, each by itself, none in another's way."""
        every = [head.named(f"{k}") for k, head in enumerate(heads)]
        projectors = [p for head in every for p in head.projectors]
        cameras = [c for head in every for c in head.cameras]
        by_each = lit_stages(scene, projectors, target) == LIT
        lit = _of_heads(by_each, [len(head.projectors) for head in every])
        bright = np.flatnonzero(lit.any(axis=1))
        measured = np.zeros_like(lit)
        if len(bright):
            samples = LitSamples.of(projectors, target.take(bright), by_each[bright])
            views = measured_by(scene, cameras, samples)
            counts = [len(head.cameras) for head in every]
            measured[bright] = _of_heads(views, counts)
        return cls(target, lit, measured)

    def beside(self, other: "HeadSets") -> "HeadSets":
        """Return these heads, then others, of the same samples."""
        return HeadSets(
            self.target,
            np.concatenate([self.lit, other.lit], axis=1),
            np.concatenate([self.measured, other.measured], axis=1),
        )

    def with_at(self, k: int, one: "HeadSets") -> "HeadSets":
        """Return these heads, another in the place of one."""
        lit, measured = self.lit.copy(), self.measured.copy()
        lit[:, k], measured[:, k] = one.lit[:, 0], one.measured[:, 0]
        return replace(self, lit=lit, measured=measured)

    def with_samples(self, other: "HeadSets") -> "HeadSets":
        """Return the same heads on the samples of both."""
        return HeadSets(
            merged(self.target, other.target),
            np.concatenate([self.lit, other.lit]),
            np.concatenate([self.measured, other.measured]),
        )

    def take(self, chosen: Ints) -> "HeadSets":
        """Return some of the heads."""
        return replace(self, lit=self.lit[:, chosen], measured=self.measured[:, chosen])


def _of_heads(by_device: Mask, counts: Sequence[int]) -> Mask:
    """Join what devices (n, m) do to what heads with so many each do, (n, k)."""
    starts = np.cumsum([0, *counts[:-1]])
    return np.logical_or.reduceat(by_device, starts, axis=1)


@dataclass(frozen=True, eq=False)
class HeadCover:
    """The cover over heads, and its rows.

    Attributes:
        sets: What the heads do.
        rows: Which sample each row is, shape (m,).
        of_light: Whether a row is of light, else of what is measured, shape (m,).
        quotas: Which row counts for what, and how many of these are asked for at least.
        due: Of a row of light the number under which its sample counts as measured, 0
            where no head measures it, shape (m,).
        shares: What must be measured of that which is due under a number, (n_numbers,).
    """

    sets: HeadSets
    rows: Ints
    of_light: Mask
    quotas: Quotas
    due: Ints
    shares: Array

    @classmethod
    def of(cls, scene: Scene, sets: HeadSets) -> "HeadCover":
        """Return the cover that a scene's requirements ask for."""
        required, regions = scene.requirements, RegionFloors.of(scene, sets.target)
        lit, measured = np.any(sets.lit, axis=1), np.any(sets.measured, axis=1)
        groups = [np.ones(len(lit), dtype=bool)]
        groups += [regions.row == r for r in range(1, regions.n_rows)]
        n = len(groups)
        pairs = product((lit, measured), groups)
        rows = [np.flatnonzero(done & one) for done, one in pairs]
        counts = np.array([len(one) for one in rows])
        shares = np.full((2, n), regions.share)
        shares[:, 0] = required.dominant_coverage, required.coverage
        least_lit = np.ceil(shares[0] * counts[:n] - 1e-9)
        least_due = np.clip(least_lit - (counts[:n] - counts[n:]), 0, None)
        least = np.ceil(shares[1] * least_due - 1e-9)
        floors = np.concatenate([[0], least_lit, least]).astype(np.int64)
        every, number = np.concatenate(rows), np.repeat(np.arange(2 * n) + 1, counts)
        of_light = number <= n
        return cls(
            sets,
            every,
            of_light,
            Quotas(int(floors.sum()), RegionFloors(number, len(floors)), floors),
            np.where(of_light & measured[every], number + n, 0),
            np.concatenate([np.zeros(1 + n), shares[1]]),
        )

    def without(self, head: int) -> "HeadCover":
        """Return the same cover with a head that does nothing; the rows stay."""
        lit, measured = self.sets.lit.copy(), self.sets.measured.copy()
        lit[:, head] = measured[:, head] = False
        return replace(self, sets=replace(self.sets, lit=lit, measured=measured))

    @cached_property
    def covers(self) -> Mask:
        """Which row (m, k) each head serves."""
        lit, measured = self.sets.lit[self.rows], self.sets.measured[self.rows]
        return np.where(self.of_light[:, None], lit, measured)

    @cached_property
    def problem(self) -> CoverProblem:
        """The cover as solvers take it."""
        return cover_problem(self.covers, self.quotas)

    def of_one(self, number: int) -> CoverProblem:
        """Return the cover of what is asked under one number alone, without others."""
        rows = self.quotas.regions.row == number
        floor = np.array([0, self.quotas.floors[number]])
        ones = RegionFloors(np.ones(int(rows.sum()), dtype=np.int64), 2)
        return cover_problem(self.covers[rows], Quotas(int(floor[1]), ones, floor))

    def proved(
        self, solution: CoverSolution, *, seed: int, budget: float
    ) -> tuple[int, str]:
        """Return the least number of heads that is proved, and what proves it.

        Of the cover, as it was solved, or of what all of the light asks for, or all
        that is measured: that is no more than is asked, and of a cover without regions
        more is proved with as much work.
        """
        parts = [
            solve_cover(self.of_one(number), seed=seed, budget=budget)
            for number in self.totals
        ]
        best = max((solution, *parts), key=lambda each: each.lower_bound)
        return int(np.ceil(best.lower_bound - 1e-9)), best.proof

    def fewest(self, *, seed: int, budget: float) -> tuple[Ints, CoverSolution]:
        """Return the fewest heads found that are enough, and the least floors' cover.

        The bound is of that; where heads aren't enough, they are the nearest found.
        """
        first = solve_cover(self.problem, seed=seed, budget=budget)
        chosen, cover = first.selected, self
        for left in range(_RAISES, -1, -1):
            if not self.lacking(chosen):
                break
            cover = cover.raised(self.served(chosen)) if left else self.whole
            solution = solve_cover(cover.problem, seed=seed, budget=_RAISED_BUDGET)
            chosen = solution.selected
        return chosen, first

    def raised(self, served: Mask) -> "HeadCover":
        """Return the cover that asks for all that is due where rows are served."""
        floors = self.floors_with(served)
        quotas = replace(self.quotas, total=int(floors.sum()), floors=floors)
        return replace(self, quotas=quotas)

    @property
    def whole(self) -> "HeadCover":
        """The cover that asks as if all were lit: that is enough, whatever is."""
        return self.raised(np.ones(len(self.rows), dtype=bool))

    def floors_with(self, served: Mask) -> Ints:
        """Return how many are asked for under each number where rows (m,) are served.

        The more is lit that can be measured, the more must be.
        """
        due = np.bincount(self.due[served], minlength=len(self.shares))
        asked = np.ceil(self.shares * due - 1e-9).astype(np.int64)
        return np.maximum(self.quotas.floors, asked)

    def short(self, served: Mask) -> Ints:
        """Return how many are lacking under each number where rows (m,) are served."""
        return np.clip(self.floors_with(served) - self.counts(served), 0, None)

    def counts(self, served: Mask) -> Ints:
        """Return how many rows of each number are served."""
        row, n = self.quotas.regions.row, len(self.quotas.floors)
        return np.bincount(row[served], minlength=n).astype(np.int64)

    def served(self, chosen: Ints) -> Mask:
        """Return which rows some of the heads serve, shape (m,)."""
        lit = np.any(self.sets.lit[:, chosen], axis=1)
        measured = np.any(self.sets.measured[:, chosen], axis=1)
        return np.where(self.of_light, lit[self.rows], measured[self.rows])

    @property
    def totals(self) -> tuple[int, int]:
        """Numbers of what is asked of all that is lit, and measured, of no region."""
        return 1, 1 + (len(self.quotas.floors) - 1) // 2

    def lacking(self, chosen: Ints) -> int:
        """Return how many rows are lacking of all that is asked, at least 0."""
        return int(self.short(self.served(chosen)).sum())

    def refuted(self, chosen: Ints) -> bool:
        """Return whether these aren't enough, nor any that light and measure less."""
        return bool(np.any(self.counts(self.served(chosen)) < self.quotas.floors))

    @property
    def asked(self) -> tuple[int, int]:
        """How many samples must be lit, and measured, of all, at least."""
        lit, measured = self.totals
        return int(self.quotas.floors[lit]), int(self.quotas.floors[measured])
