"""What heads light and measure of samples, and what is asked of several together.

Each measures by itself, with pairs of its own devices. Of n samples that candidates
light n_L and measure n_M; the fewest heads are sought that together::

    light >= ceil(dominant_coverage n_L)   and   measure >= ceil(coverage n_M)

and so of every large region, with its floor. A sample stands in a row for each of these
that it counts for, so all of it is one cover.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from geometry.arrays import Ints, Mask
from planning.proofs.quotas import Quotas, RegionFloors
from planning.proofs.selection import cover_problem
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import LitSamples, measured_by
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene
from solvers import CoverProblem, CoverSolution, solve_cover

from .head_poses import PlacedHead


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
        quotas: Which row counts for what, and how many of these are asked for.
    """

    sets: HeadSets
    rows: Ints
    of_light: Mask
    quotas: Quotas

    @classmethod
    def of(cls, scene: Scene, sets: HeadSets) -> "HeadCover":
        """Return the cover that a scene's requirements ask for."""
        required, regions = scene.requirements, RegionFloors.of(scene, sets.target)
        rows: list[Ints] = []
        light: list[Mask] = []
        number: list[Ints] = []
        floors = [0]
        for done, share in (
            (sets.lit, required.dominant_coverage),
            (sets.measured, required.coverage),
        ):
            reached = done.any(axis=1)
            groups = [np.flatnonzero(reached)]
            groups += [
                np.flatnonzero(reached & (regions.row == r))
                for r in range(1, regions.n_rows)
            ]
            shares = [share, *[regions.share] * (len(groups) - 1)]
            for group, least in zip(groups, shares, strict=True):
                number.append(np.full(len(group), len(floors), dtype=np.int64))
                rows.append(group)
                light.append(np.full(len(group), done is sets.lit))
                floors.append(int(np.ceil(least * len(group) - 1e-9)))
        numbers = RegionFloors(np.concatenate(number), len(floors))
        quotas = Quotas(sum(floors), numbers, np.array(floors))
        return cls(sets, np.concatenate(rows), np.concatenate(light), quotas)

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

    @property
    def totals(self) -> tuple[int, int]:
        """Numbers of what is asked of all that is lit, and measured, of no region."""
        return 1, 1 + (len(self.quotas.floors) - 1) // 2

    def lacking(self, chosen: Ints) -> int:
        """Return how many rows are lacking of all that is asked, at least 0."""
        lit = np.any(self.sets.lit[:, chosen], axis=1)
        measured = np.any(self.sets.measured[:, chosen], axis=1)
        served = np.where(self.of_light, lit[self.rows], measured[self.rows])
        counts = np.bincount(
            self.quotas.regions.row[served], minlength=len(self.quotas.floors)
        )
        return int(np.clip(self.quotas.floors - counts, 0, None).sum())

    @property
    def asked(self) -> tuple[int, int]:
        """How many samples must be lit, and measured, of all."""
        lit, measured = self.totals
        return int(self.quotas.floors[lit]), int(self.quotas.floors[measured])
