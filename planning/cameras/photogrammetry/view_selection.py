"""Fewest candidates whose pairs measure a share of the samples, and what was proved.

The cover by pairs of `solvers.covers.paired`, of samples of equal weight: weights are
counts and every comparison is exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.proofs.quotas import Quotas
from planning.proofs.selection import CandidateCover, Selection
from planning.scene.measuring.camera_views import CameraView
from planning.scene.scene import Scene
from solvers.covers.cover import DEFAULT_BUDGET
from solvers.covers.paired.pair_cover import solve_most_pairs, solve_pair_cover
from solvers.covers.paired.pair_problem import PairCoverProblem, packed_pairs

from .view_pairs import Sightings

_Ints = NDArray[np.int64]
_Mask = NDArray[np.bool_]
# Counted work of a cover, and of one whose bound is known already.
_BUDGET, _AGAIN = 2e9, 5e8


@dataclass(frozen=True, eq=False, kw_only=True)
class PairCandidates(CandidateCover):
    """Candidates of which two must see a sample, and see it well; `covers` who sees.

    Attributes:
        good: Bit rows of which samples two candidates measure, (m, m, n_words).
        views: Candidates that must see a sample.
        aimed: Samples that a selection aims at; None: those required.
    """

    good: NDArray[np.uint64]
    views: int
    aimed: int | None = None

    @cached_property
    def pairs(self) -> PairCoverProblem:
        """The cover by pairs, of all samples."""
        aim = self.required if self.aimed is None else self.aimed
        return self._stated(max(aim, self.required))

    def _stated(self, required: int) -> PairCoverProblem:
        return PairCoverProblem(
            self.covers,
            self.good,
            required_weight=float(required),
            views=self.views,  # pyright: ignore[reportArgumentType]
            fixed=np.arange(self.n_existing),
        )

    def _quotas(self, spare: float) -> Quotas:
        regions = self.regions
        assert regions is not None
        every = self._measured(np.arange(self.covers.shape[1]))
        return Quotas.of(regions, every, self.share, spare=spare)

    def covered(self, chosen: _Ints) -> _Mask:
        """Return which samples pairs of candidates measure, shape (n,)."""
        return self._measured(chosen)

    def n_covered(self, chosen: _Ints) -> int:
        """Return how many samples pairs of candidates measure."""
        return int(self._measured(chosen).sum())

    def enough(self, chosen: _Ints) -> bool:
        """Return whether pairs measure the share and the floors of all regions."""
        return self.quotas.enough(self._measured(chosen))

    def most_covering(
        self, count: int, warm_start: _Ints | None, budget: float = DEFAULT_BUDGET
    ) -> tuple[_Ints, int]:
        """Return candidates whose pairs measure most, and the proven most."""
        best = solve_most_pairs(
            self.pairs,
            count,
            warm_start=warm_start,
            seed=self.seed,
            budget=min(budget, _AGAIN),
        )
        selected = best.selected
        known = warm_start is not None and self.enough(warm_start)
        if known and warm_start is not None and not self.enough(selected):
            selected = warm_start
        return selected, int(np.floor(best.upper_bound + 1e-6))

    def _measured(self, chosen: _Ints) -> _Mask:
        words = np.zeros(self.good.shape[2], dtype=np.uint64)
        for s in chosen:
            words |= np.bitwise_or.reduce(self.good[s][chosen], axis=0)
        bits = np.unpackbits(words.view(np.uint8), count=len(self.covers))
        return bits.astype(bool) & (self.covers[:, chosen].sum(axis=1) >= self.views)


def seen_together(
    scene: Scene, views: Sequence[CameraView], normals: NDArray[np.float64]
) -> tuple[_Mask, NDArray[np.uint64]]:
    """Return who sees which of n samples, (n, m), and which pairs measure them."""
    n, m = len(normals), len(views)
    limits = scene.requirements.triangulation
    sightings = Sightings.of(views, normals)
    seen = np.zeros((n, m), dtype=bool)
    seen[sightings.sample, sightings.camera] = True

    def together(i: int) -> _Mask:
        scene.check_cancelled()
        rows = sightings.rows_of(i)
        first, second = sightings.partners(
            rows, slice(rows.stop, len(sightings.sample))
        )
        good = sightings.good(first, second, limits)
        table = np.zeros((m, n), dtype=bool)
        chosen = second[good]
        table[sightings.camera[chosen], sightings.sample[chosen]] = True
        return table

    return seen, packed_pairs(together, m, n)


def select_fewest_views(
    cover: PairCandidates, known: Selection | None = None
) -> Selection:
    """Return the fewest candidates whose pairs measure what is required, and floors.

    Bounds leave floors of regions out, which only add to them. With `known`, of the
    same candidates and less to aim at, its bound stays: what is required is the same.
    """
    budget = _BUDGET if known is None else _AGAIN
    solution = solve_pair_cover(cover.pairs, seed=cover.seed, budget=budget)
    smallest = _with_floors(cover, solution.selected)
    needed, bound = len(smallest), int(np.ceil(solution.lower_bound - 1e-9))
    proof = solution.proof
    if known is not None:
        bound, proof = known.lower_bound, known.proof
    allowed = min(needed, cover.most)
    chosen, most = cover.most_covering(allowed, smallest if allowed == needed else None)
    met = needed <= allowed and cover.enough(chosen)
    status = "feasible" if met else "infeasible"
    if met and bound >= needed:
        status = "optimal"
    return Selection(
        chosen,
        smallest,
        min(bound, needed),
        status,
        proof,
        cover.required,
        cover.n_covered(chosen),
        most,
        min(bound, needed),
        floors=cover.floors,
    )


def _with_floors(cover: PairCandidates, chosen: _Ints) -> _Ints:
    """Return candidates with those that missed floors of regions take, one by one."""
    while not cover.enough(chosen):
        covered = cover.covered(chosen)
        wanted = cover.quotas.wanted(covered) & ~covered
        gains = np.full(cover.covers.shape[1], -1.0)
        for s in np.setdiff1d(np.arange(len(gains)), chosen):
            more = cover.covered(np.append(chosen, s))
            # A first view of what is wanted prepares for a second.
            gains[s] = (more & wanted).sum() + 0.5 * (cover.covers[:, s] & wanted).sum()
        best = int(np.argmax(gains))
        if not gains[best] > 0.0:
            break
        chosen = np.union1d(chosen, [best])
    return chosen
