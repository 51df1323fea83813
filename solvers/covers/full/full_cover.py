"""Fewest sets that cover every row, at equal costs: the order of the methods.

Few rows decide. The search (``row_weighting``) looks for one set less over a subset of
the rows; a find that misses rows of the whole takes some of these in, one that misses
none is a better cover. Where it finds nothing, branch and bound refutes smaller covers
or finds one: on pairs of rows (``row_branching``) or, where many sets are alike, on
orbits of sets (``orbital_branching``). A bound over a subset of the rows holds for all
of them.
"""

import numpy as np
from numpy.typing import NDArray

from solvers.covers.answers import Answer
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.status import SolveStatus, WorkBudget

from .node_program import linear_cover
from .orbital_branching import OrbitalTree
from .row_branching import RowTree
from .row_dominance import essential, separate
from .row_weighting import RowWeighting
from .symmetry import may_be_symmetric

_LINEAR_PROOF = "linear relaxation by rows"
_BRANCHING_PROOF = "branch and bound on pairs of rows"
_ORBITAL_PROOF = "branch and bound on orbits of sets"
# Missed rows that are taken in at a time.
_BATCH = 5
# All of so few rows are searched from the start.
_FEW_ROWS = 400
# So many are in the linear programs of all orbital nodes.
_MANY_ROWS = 2_000
# Covers of so few entries have their linear program solved at once.
_CHEAP = 200_000
# Exchanges without a find after which rows count as critical: first (also of a cover
# that isn't cheap), and then later.
_FIRST_STEPS = 2_000
_LARGE_STEPS = 10_000
_STEPS = 60_000
# Sets between bound and cover beyond which the tree gets half of what is left.
_FAR = 2
# Reduced costs are asked again while they leave less than this share of the sets.
_ROUNDS = 4
_FEWER = 0.9
_ROUNDING = 1e-6


def fewest_full(
    cover: ReducedCover,
    budget: WorkBudget,
    *,
    seed: int,
    start: NDArray[np.int64],
    lower: int,
) -> Answer:
    """Find the fewest sets that cover every row, with a lower bound.

    Args:
        cover: A cover of equal costs of which no row's weight may be lost.
        budget: Counted work; who gave it says what it cut.
        seed: Seed of the search.
        start: Sets that cover every row; the selection is never larger.
        lower: Sets known to be necessary; the bound is never below.

    Raises:
        ValueError: If the start leaves a row open.
    """
    served = cover.dense_rows()
    start = np.unique(np.asarray(start, dtype=np.int64))
    if not served[:, start].any(axis=1).all():
        raise ValueError(f"start of {start.size} sets must cover every row")
    budget.spend(float(served.size))
    rows, columns = essential(served, budget.part(0.12 * budget.units))
    smaller = served[np.ix_(rows, columns)]
    parts = separate(smaller)
    if len(parts) > 1:
        best, bound, proof = _of_parts(smaller, parts, budget, seed)
    else:
        search = _Search(smaller, budget, seed, start.size)
        search.lower = lower
        search.run()
        best, bound, proof = search.best, search.lower, search.proof
    if best is not None and best.size < start.size:
        start = np.sort(columns[best])
    if bound <= lower:
        bound, proof = lower, "bound known before"
    status = SolveStatus.OPTIMAL if bound >= start.size else SolveStatus.FEASIBLE
    return Answer(status, start, float(min(bound, start.size)), proof)


def _of_parts(
    covers: NDArray[np.bool_],
    parts: list[tuple[NDArray[np.int64], NDArray[np.int64]]],
    budget: WorkBudget,
    seed: int,
) -> tuple[NDArray[np.int64], int, str]:
    """Return cover, bound and proof of parts that share no set, the smallest first."""
    parts = sorted(parts, key=lambda part: part[0].size * part[1].size)
    sizes = np.array([rows.size * columns.size for rows, columns in parts])
    ahead = np.cumsum(sizes[::-1])[::-1]
    chosen, lower, proofs = [], 0, set[str]()
    for (rows, columns), share in zip(parts, sizes / ahead, strict=True):
        part = budget.part(share * budget.remaining)
        search = _Search(covers[np.ix_(rows, columns)], part, seed, columns.size + 1)
        search.lower = 1
        search.run()
        if search.best is not None:
            chosen.append(columns[search.best])
        lower += search.lower
        proofs.add(search.proof or "a row needs a set")
    return np.concatenate(chosen), lower, f"separate parts: {', '.join(sorted(proofs))}"


class _Search:
    def __init__(
        self, covers: NDArray[np.bool_], budget: WorkBudget, seed: int, size: int
    ) -> None:
        self.covers = covers
        self.budget = budget
        self.best: NDArray[np.int64] | None = None
        self.size = size
        self.lower = 0
        self.proof = ""
        self._known = _greedy(covers, budget)
        self._rows = np.empty(0, dtype=np.int64)
        self._search = RowWeighting(covers[:0], self._known, seed=seed)
        self._offer(self._known)

    def run(self) -> None:
        whole = self.budget.units
        self._search_over(_spread_rows(self.covers))
        if self.covers.size > _CHEAP:
            self._improve(_LARGE_STEPS, self.budget.part(0.3 * whole))
        linear = linear_cover(self.covers, self.budget.part(0.25 * whole))
        self._raise(linear.lower_bound, _LINEAR_PROOF)
        self._search_over(linear.rows)
        self._improve(_FIRST_STEPS, self.budget.part(0.15 * whole))
        if self.settled:
            return
        # Taking or leaving one of many alike sets leaves its twins: orbits don't.
        alike = may_be_symmetric(self.covers, self.budget.part(0.05 * whole))
        refute = self._by_orbits if alike else self._by_rows
        # A tree can't go on where it was cut.
        tries = ((_FIRST_STEPS, 0.1), (_STEPS, 0.9))
        for steps, share in tries[1:] if alike else tries:
            # Far from a proof the search has more to gain.
            share = min(share, 0.5) if self.size - self.lower > _FAR else share
            proving = self.budget.part(share * self.budget.remaining)
            while not self.settled and refute(proving):
                self._improve(steps, proving)
            self._improve(_STEPS, self.budget.part(0.15 * whole))
        while not self.settled and not self.budget.exhausted:
            self._improve(_STEPS, self.budget)

    @property
    def settled(self) -> bool:
        return self.lower >= self.size

    def _offer(self, selected: NDArray[np.int64]) -> None:
        self._known = selected if selected.size <= self._known.size else self._known
        if selected.size < self.size:
            self.best, self.size = selected, selected.size

    def _raise(self, bound: int, proof: str) -> None:
        if bound > self.lower:
            self.lower, self.proof = bound, proof

    def _take_in(self, selected: NDArray[np.int64]) -> bool:
        """Add some rows that a selection misses, if it misses any.

        Those of fewest sets first; none shares half of its sets with one before.
        """
        missed = np.flatnonzero(~self.covers[:, selected].any(axis=1))
        self.budget.spend(float(len(self.covers) * selected.size))
        order = np.argsort(self.covers[missed].sum(axis=1), kind="stable")
        taken: list[int] = []
        for row in missed[order]:
            sets = self.covers[row]
            near = self.covers[taken][:, sets].sum(axis=1)
            if not np.any(2 * near > np.count_nonzero(sets)):
                taken.append(int(row))
            if len(taken) == _BATCH:
                break
        self._search_over(np.array(taken, dtype=np.int64))
        return missed.size > 0

    def _search_over(self, rows: NDArray[np.int64]) -> None:
        new = np.setdiff1d(rows, self._rows)
        self._rows = np.concatenate([self._rows, new])
        self._search.add_rows(self.covers[new])
        self.budget.spend(4.0 * new.size * self.covers.shape[1])

    def _improve(self, max_steps: int, budget: WorkBudget) -> None:
        """Look for smaller covers until the rows taken in resist."""
        search = self._search
        search.select(self._known)
        while not self.settled and not budget.exhausted:
            while search.chosen.size >= self.size:
                search.drop()
            if not search.search(max_steps, budget):
                break
            if not self._take_in(search.chosen):
                self._offer(np.sort(search.chosen))

    def _by_rows(self, budget: WorkBudget) -> bool:
        """Refute covers of as many sets as the bound; return whether to go on."""
        size = self.lower + 1
        part, columns = self.covers, np.arange(self.covers.shape[1])
        for _ in range(_ROUNDS):
            linear = linear_cover(part, budget)
            kept = linear.needed + linear.reduced < self.lower + _ROUNDING
            smaller = part[:, kept]
            if linear.lower_bound >= size or not smaller.any(axis=1).all():
                self._raise(size, _BRANCHING_PROOF)
                return True
            if np.count_nonzero(kept) > _FEWER * kept.size:
                break
            # Without sets of large reduced cost more rows include others.
            rows, fewer = essential(smaller, budget.part(0.2 * budget.remaining))
            part, columns = smaller[np.ix_(rows, fewer)], columns[kept][fewer]
        linear = linear_cover(part, budget)
        answer = RowTree(part, linear.rows, size, budget).run()
        self._raise(answer.lower_bound, _BRANCHING_PROOF)
        if answer.selected is not None:
            self._offer(columns[answer.selected])
        return answer.lower_bound >= size or answer.selected is not None

    def _by_orbits(self, budget: WorkBudget) -> bool:
        """Refute all smaller covers; return whether to go on."""
        rows = np.arange(len(self.covers))
        if rows.size > _MANY_ROWS:
            rows = np.sort(self._rows)
        answer = OrbitalTree(self.covers, rows, self.size, budget).run()
        self._raise(answer.lower_bound, _ORBITAL_PROOF)
        if answer.selected is not None:
            self._offer(answer.selected)
        return answer.selected is not None


def _spread_rows(covers: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return all of few rows, else those of fewest sets, and more."""
    if len(covers) <= _FEW_ROWS:
        return np.arange(len(covers))
    order = np.argsort(covers.sum(axis=1), kind="stable")
    half = _FEW_ROWS // 2
    spread = np.linspace(half, len(covers) - 1, half).astype(np.int64)
    return np.sort(np.concatenate([order[:half], order[spread]]))


def _greedy(covers: NDArray[np.bool_], budget: WorkBudget) -> NDArray[np.int64]:
    """Return sets that cover every row, the one of most open rows first, increasing."""
    open_rows = np.ones(len(covers), dtype=bool)
    counts = covers.sum(axis=0)
    budget.spend(2.0 * covers.size)
    chosen: list[int] = []
    while open_rows.any():
        best = int(np.argmax(counts))
        chosen.append(best)
        served = open_rows & covers[:, best]
        counts -= covers[served].sum(axis=0)
        open_rows &= ~served
    return np.sort(np.array(chosen, dtype=np.int64))
