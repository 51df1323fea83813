"""How many poses are needed at least, wherever in their cells they stand.

First multipliers (``cell_multipliers``), one count after the other; then the search
over multisets of cells (``cell_tuples``). Cut short, the bound is lower but true. Where
a look finds cells that no search refutes, only smaller counts are searched. What
multisets of more than two cells refute is in the end given to multipliers again: who
wants to follow the proof needs little else.
"""

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import BitSum, pack_rows
from solvers.checked_numbers import whole_number
from solvers.one_thread import on_one_thread
from solvers.status import WorkBudget

from .cell_multipliers import MultiplierSearch
from .cell_problem import CellProblem, WholeRows, whole_rows
from .cell_store import CellStore
from .cell_tree import CellTree
from .cell_tuples import Enough, refute_tuples

DEFAULT_BUDGET = 2e10
# Multisets of more cells than these were never exhausted, with ten times the work that
# all else takes: this share of the budget finds what survives, if that is soon found.
MOST_CELLS, _BRIEFLY = 5, 0.05
_MULTIPLIERS_SHARE = 0.75
# A look for cells that survive: of so many poses at least, as of fewer multipliers soon
# say all; multisets split at a time; and counted work, beside the budget.
_LOOKED_FOR, _FEW, _LOOK = 2, 4, 2e8
# Multisets that are soon followed, and counted work for multipliers of what larger ones
# refute, beside the budget.
_FOLLOWED, _AGAIN = 2, 1.2e10
_BY_MULTIPLIERS = "multipliers of the rows"


class CellStatus(enum.Enum):
    """What the search over cells found out about a count."""

    PROVED = "fewer poses than the count can't be enough"
    SURVIVED = "fewer poses may be enough: cells that can't be split don't refute it"
    CUT = "stopped at a limit before a proof"
    INFEASIBLE = "no number of poses is enough"


@dataclass(frozen=True, eq=False)
class CellBound:
    """Answer of :func:`bound_count`.

    Attributes:
        problem: The problem this answers.
        tree: The cells over which it holds.
        count: The count that was to be proved.
        status: What was found out.
        lower_bound: Poses needed at least, at most ``count``; inf if infeasible.
        proof: What proves the bound, and what cut the proof short if anything did.
        survivor: Cells, by the tree's names and with repetition, in which
            ``lower_bound`` poses may be enough: where a better cover may be. Else None.
        multipliers: Of the rows, integers, shape (n_rows,).
        largest_cost: No pose serves rows of more than this cost by the multipliers.
        by_multipliers: The part of the bound that they prove.
        over_known: The most that multipliers prove over the known poses alone; inf if
            none are known.
        out_of_work: Whether work ended the search for multipliers: finer cells would
            be of no use.
        most_weight: Weight that ``count`` - 1 poses serve at most, by them.
        cells_used: Cells that the tree was asked for.
    """

    problem: CellProblem
    tree: CellTree
    count: int
    status: CellStatus
    lower_bound: float
    proof: str
    survivor: NDArray[np.int64] | None
    multipliers: NDArray[np.int64]
    largest_cost: int
    by_multipliers: float
    over_known: float
    out_of_work: bool
    most_weight: float
    cells_used: int


@on_one_thread
def bound_count(
    problem: CellProblem,
    tree: CellTree,
    count: int,
    *,
    known: NDArray[np.bool_] | None = None,
    least: int = 0,
    budget: float = DEFAULT_BUDGET,
    time_limit: float = float("inf"),
    most_cells: int = MOST_CELLS,
) -> CellBound:
    """Prove that fewer than ``count`` poses can't be enough, or as much as holds.

    Args:
        problem: What must be served.
        tree: Cells that hold every pose of the workspace.
        count: Poses that are known to be enough.
        known: Which rows some poses of the workspace serve, shape (k, n_rows). They
            guide the search; what it proves doesn't rest on them.
        least: Poses that were proved to be needed: no fewer are looked at.
        budget: Counted work, about 1e9 a second.
        time_limit: Wall time that cuts the work, in [s]; the proof then says so.
        most_cells: Multisets of more are searched briefly: multipliers get their work.

    Raises:
        ValueError: If the count isn't a whole number of at least 1, the tree has other
            rows than the problem, or a cell serves rows that its parent misses.
    """
    count = whole_number("count", count, least=1)
    if tree.n_rows != problem.weights.size:
        raise ValueError(
            f"the tree's cells have {tree.n_rows} rows, the problem has "
            f"{problem.weights.size}"
        )
    limit = WorkBudget(budget, time_limit=time_limit)
    proof = _Proof(problem, tree, count, limit, known, least, most_cells)
    return proof.run()


class _Proof:
    def __init__(
        self,
        problem: CellProblem,
        tree: CellTree,
        count: int,
        budget: WorkBudget,
        known: NDArray[np.bool_] | None,
        least: int,
        most_cells: int,
    ) -> None:
        self.problem, self.tree, self.count, self.budget = problem, tree, count, budget
        self.whole = whole_rows(problem)
        self.most_cells = most_cells
        few = count - 1 <= most_cells
        multipliers = _MULTIPLIERS_SHARE if few else 1.0 - _BRIEFLY
        share = budget.part(multipliers * budget.units)
        # Cells that are made count in both.
        self.store = CellStore(tree, share)
        rows = None if known is None else pack_rows(known)
        self.share = share
        self.search = MultiplierSearch(self.whole, self.store, share, rows)
        self.lower, self.proof = min(least, count), "nothing is required of poses"
        if least:
            self.proof = "fewer were refuted before"
        # Poses that multisets refuted last, and multipliers didn't.
        self.by_multisets = 0
        self.survivor: NDArray[np.int64] | None = None
        # Cells in which one pose fewer than the count may be enough, whatever is tried.
        self.standing: NDArray[np.int64] | None = None
        self.seen = self.store.names

    def run(self) -> CellBound:
        if not _reachable(self.whole, self.store):
            proof = "all cells together serve less than is required"
            return self._answer(CellStatus.INFEASIBLE, float("inf"), proof)
        most = self.count - 1
        if most >= _LOOKED_FOR:
            self._look(most)
            most -= self.standing is not None
        if self.lower < most and (self.lower or self._refute(0)):
            # Smaller numbers follow from larger ones.
            self.search.refute_most(most)
        while self.lower < self.count and self._refute(self.lower):
            pass
        if self.by_multisets > _FOLLOWED:
            self._again()
        if self.lower >= self.count:
            return self._answer(CellStatus.PROVED, float(self.count), self.proof)
        if self.survivor is not None:
            proof = f"{self.proof}; cells that can't be split don't refute {self.lower}"
            return self._answer(CellStatus.SURVIVED, float(self.lower), proof)
        proof = f"{self.proof}; {self._ended_by()}"
        return self._answer(CellStatus.CUT, float(self.lower), proof)

    def _ended_by(self) -> str:
        if self.store.full:
            return "search cut by the memory limit"
        if self.budget.exhausted:
            return f"search cut by the {self.budget.reason}"
        return f"multisets of {self.lower} cells are too many to search for long"

    def _look(self, n_poses: int) -> None:
        """Look shortly, where cells serve most, for so many that no search refutes."""
        allowed, left = min(_LOOK, self.budget.units), self.budget.time_left
        look = WorkBudget(allowed, time_limit=max(0.0, left))
        store = CellStore(self.tree, look)
        answer = refute_tuples(
            self.whole, store, n_poses, self.search.multipliers, look, _FEW
        )
        self.seen = store.names
        if answer.survivor is not None:
            self.standing = store.names[answer.survivor]

    def _refute(self, n_poses: int) -> bool:
        if n_poses == 0:
            return self._refute_none()
        if n_poses == self.count - 1 and self.standing is not None:
            self.survivor = self.standing
            return False
        if self.search.refute(n_poses):
            self.lower, self.by_multisets = int(min(self.search.bound, self.count)), 0
            self.proof = _BY_MULTIPLIERS
            return True
        budget = self.budget
        if n_poses > self.most_cells:
            if self.search.out_of_work:
                # Among as many cells as were made till then nothing is found soon.
                return False
            budget = budget.part(_BRIEFLY * budget.units)
        answer = refute_tuples(
            self.whole, self.store, n_poses, self.search.multipliers, budget
        )
        if answer.refuted:
            self.lower, self.by_multisets = n_poses + 1, n_poses
            self.proof = f"multisets of {n_poses} cells by exhaustion"
        elif answer.survivor is not None:
            self.survivor = self.store.names[answer.survivor]
        return answer.refuted

    def _again(self) -> None:
        """Let multipliers refute what multisets did, beside the budget."""
        ended = self.search.out_of_work
        self.share.renew(_AGAIN)
        if self.search.refute(self.by_multisets):
            self.proof = _BY_MULTIPLIERS
        # What ended the search is what ended it before.
        self.search.out_of_work = ended

    def _refute_none(self) -> bool:
        none = np.zeros((1, 0, self.store.rows.shape[1]), dtype=np.uint64)
        enough = bool(Enough(self.whole, 0)(none)[0][0])
        if enough:
            self.survivor = np.empty(0, dtype=np.int64)
        else:
            self.lower, self.proof = 1, "what is required needs a pose"
        return not enough

    def _answer(self, status: CellStatus, lower: float, proof: str) -> CellBound:
        search, total = self.search, float(self.problem.weights.sum())
        paid = (self.count - 1) * search.largest_cost
        most = self.whole.most(search.multipliers, paid)
        multipliers = search.multipliers.copy()
        multipliers.flags.writeable = False
        return CellBound(
            problem=self.problem,
            tree=self.tree,
            count=self.count,
            status=status,
            lower_bound=lower,
            proof=proof,
            survivor=self.survivor,
            multipliers=multipliers,
            largest_cost=search.largest_cost,
            by_multipliers=search.bound,
            over_known=search.over_known,
            out_of_work=search.out_of_work,
            most_weight=min(self.whole.in_unit(most), total),
            cells_used=np.union1d(self.store.names, self.seen).size,
        )


def _reachable(whole: WholeRows, store: CellStore) -> bool:
    served = np.bitwise_or.reduce(store.rows[: store.n_roots], axis=0)
    served |= pack_rows((whole.needs == 0)[None])[0]
    weights = [
        int(BitSum(np.where(whole.row_sets == g, whole.weights, 0))(served[None])[0])
        for g in range(len(whole.needed))
    ]
    each = all(w >= n for w, n in zip(weights, whole.needed, strict=True))
    return each and sum(weights) >= whole.needed_total
