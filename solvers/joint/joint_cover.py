"""The cheapest projectors and cameras together, with a bound and its proof.

What cameras cost, g(S), only falls where projectors S are added. So whoever wants
cameras for at most t needs, of every set S with g(S) > t, a projector that isn't in S.
For each sum t that cameras may cost, the cheapest projectors that light enough and hit
the complements of all such sets known bound those of any answer with such cameras::

    total >= min over t of  (t + cheapest projectors for t)

The projectors found are asked for their cameras: these are an answer, or the set, grown
by every projector that doesn't help, is one more to be hit. It ends where the best
answer costs no more than the bound (implicit hitting sets; a logic-based Benders
decomposition whose cuts are covers).

References:
    Moreno-Centeno and Karp, "The implicit hitting set approach to solve combinatorial
    optimization problems", Operations Research 61(2), 2013.
    Hooker and Ottosson, "Logic-based Benders decomposition", Mathematical Programming
    96, 2003.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from solvers.checked_numbers import set_names, whole_number
from solvers.one_thread import on_one_thread
from solvers.status import SolveStatus

from .camera_costs import SAME, CostStep, CoverCosts, cost_steps
from .joint_problem import JointProblem

_Index = NDArray[np.int64]
_NONE = np.zeros(0, dtype=np.int64)
DEFAULT_COVERS, DEFAULT_BUDGET = 800, 3e8


@dataclass(frozen=True, eq=False)
class JointSolution:
    """Answer to a joint cover.

    Attributes:
        problem: The problem this answers.
        status: How the solve ended.
        projectors: Chosen projectors in increasing order; none where none was found.
        cameras: Chosen cameras likewise.
        lower_bound: No answer costs less; inf if there is none.
        proof: What proves the bound, and what cut the proof short if anything did.
    """

    problem: JointProblem
    status: SolveStatus
    projectors: _Index
    cameras: _Index
    lower_bound: float
    proof: str

    @property
    def cost(self) -> float:
        """What the devices cost; inf where none were found."""
        if not self.status.has_point:
            return np.inf
        return self.problem.cost(self.projectors, self.cameras)


@on_one_thread
def solve_joint(
    problem: JointProblem,
    *,
    known: tuple[ArrayLike, ArrayLike] | None = None,
    seed: int = 0,
    n_covers: int = DEFAULT_COVERS,
    budget: float = DEFAULT_BUDGET,
) -> JointSolution:
    """Find the cheapest projectors and cameras that light and measure enough.

    Args:
        problem: The joint cover.
        known: Projectors and cameras to begin with; the answer is never dearer.
        seed: Seed of the covers' heuristics.
        n_covers: Covers of one kind that are solved, about as many at most.
        budget: Counted work of each, in matrix entries touched.

    Returns:
        The solution; an infeasible problem is an answer, not an error.

    Raises:
        ValueError: If known devices aren't of the problem, or aren't enough.
    """
    n_covers = whole_number("n_covers", n_covers, least=1)
    search = _Search(problem, CoverCosts(problem, n_covers, budget, seed))
    if known is not None:
        p = set_names("known projectors", known[0], problem.n_projectors)
        c = set_names("known cameras", known[1], problem.n_cameras)
        if not problem.enough(p, c):
            raise ValueError("the known devices don't light and measure enough")
        search.offer(p, c)
    return search.run()


@dataclass(eq=False)
class _Open:
    """What is known of answers whose cameras cost what a step says."""

    step: CostStep
    least: float
    stuck: bool = False

    @property
    def bound(self) -> float:
        return self.step.low + self.least


@dataclass(eq=False)
class _Search:
    problem: JointProblem
    covers: CoverCosts
    best: tuple[_Index, _Index] | None = None
    cost: float = np.inf
    light: float = 0.0
    able: list[tuple[_Index, float]] = field(default_factory=list[tuple[_Index, float]])
    cuts: list[tuple[frozenset[int], float]] = field(
        default_factory=list[tuple[frozenset[int], float]]
    )

    def run(self) -> JointSolution:
        every = frozenset(range(self.problem.n_projectors))
        with_all = self.covers.cameras(every)
        light = self.covers.lighting([])
        if not (np.isfinite(with_all.bound) and np.isfinite(light.bound)):
            return self._ended(np.inf)
        self.light = light.bound
        if with_all.chosen is not None:
            self._improve(with_all.chosen)
        below = self.cost if np.isfinite(self.cost) else self._dearest()
        steps = cost_steps(
            self.problem.camera_costs,
            with_all.bound,
            below - light.bound + _step(below),
        )
        rows = [_Open(step, light.bound) for step in steps]
        while (row := self._next(rows)) is not None and not self.covers.exhausted:
            self._look(row)
        return self._ended(min((row.bound for row in rows), default=self.cost))

    def offer(self, projectors: _Index, cameras: _Index) -> None:
        """Keep devices if they are enough and cheaper than the best."""
        cost = self.problem.cost(projectors, cameras)
        if not self._saves(cost) or not self.problem.enough(projectors, cameras):
            return
        self.best, self.cost = (projectors, cameras), cost

    def _saves(self, cost: float) -> bool:
        return cost < self.cost - SAME * max(abs(cost), 1.0)

    def _dearest(self) -> float:
        problem = self.problem
        return float(problem.projector_costs.sum() + problem.camera_costs.sum())

    def _next(self, rows: list[_Open]) -> _Open | None:
        """The step that answers may be cheapest of; None: none may save anything."""
        left = [row for row in rows if not row.stuck and self._saves(row.bound)]
        return min(left, key=lambda row: (row.bound, row.step.low), default=None)

    def _look(self, row: _Open) -> None:
        """Raise the bound of a step, find a cheaper answer, or give the step up."""
        # What needs cameras for more than the step allows must be left behind.
        high = row.step.high * (1.0 + SAME)
        found = self.covers.lighting(
            [self._beyond(kept) for kept, bound in self.cuts if bound > high]
        )
        row.least = max(row.least, found.bound)
        if found.chosen is None or not self._saves(row.bound):
            row.stuck = found.chosen is None and np.isfinite(found.bound)
            return
        chosen = frozenset(found.chosen.tolist())
        with_these = self.covers.cameras(chosen)
        if with_these.chosen is not None:
            self.offer(found.chosen, with_these.chosen)
            self._improve(with_these.chosen)
        if with_these.bound > high:
            self._cut(chosen, high)
        elif found.bound < found.cost * (1.0 - SAME) or with_these.cost > high:
            # Neither the projectors' cost nor their cameras' is settled.
            row.stuck = True

    def _beyond(self, kept: frozenset[int]) -> NDArray[np.bool_]:
        others = np.ones(self.problem.n_projectors, dtype=bool)
        others[sorted(kept)] = False
        return others

    def _improve(self, cameras: _Index) -> None:
        """Take the cheapest projectors for cameras, and cameras for these, in turn."""
        while not self.covers.exhausted:
            before, dear = self.cost, self.problem.cost(_NONE, cameras)
            if not self._saves(dear + self.light):
                return
            light = self.covers.projectors(cameras)
            if light.chosen is None:
                return
            self.offer(light.chosen, cameras)
            views = self.covers.cameras(frozenset(light.chosen.tolist()))
            if views.chosen is None:
                return
            self.offer(light.chosen, views.chosen)
            cameras = views.chosen
            if not self.cost < before:
                return

    def _cut(self, chosen: frozenset[int], high: float) -> None:
        """Grow projectors whose cameras cost more, and keep them to be hit.

        Others join halves at a time, those first with which least more is measured.
        """
        kept, bound = chosen, self.covers.cameras(chosen).bound
        left, able = [self._by_gain(chosen)], None
        while left and not self.covers.exhausted:
            some = left.pop()
            trial = kept | frozenset(some)
            if self._does(trial, high):
                left += _halves(some)
                continue
            grown = self.covers.cameras(trial)
            if grown.bound > high:
                kept, bound = trial, grown.bound
                continue
            if grown.chosen is not None and grown.cost <= high:
                able = grown.chosen
                self.able.append((able, grown.cost))
            left += _halves(some)
        self.cuts.append((kept, bound))
        if able is not None:
            self._improve(able)

    def _does(self, projectors: frozenset[int], high: float) -> bool:
        """Whether cameras seen before, for no more, are enough with projectors."""
        problem, rows = self.problem, self.problem.rows_with(sorted(projectors))
        return any(
            cost <= high
            and problem.required_measured.met(
                problem.measured_by_rows(rows[cameras]), problem.row_sets
            )
            for cameras, cost in reversed(self.able)
        )

    def _by_gain(self, chosen: frozenset[int]) -> list[int]:
        """Other projectors, by how many pairs of sample and camera they add."""
        present = ~self.problem.measured_with(sorted(chosen))
        others = [p for p in range(self.problem.n_projectors) if p not in chosen]
        gains = [int((self.problem.measured_with([p]) & present).sum()) for p in others]
        return [others[i] for i in np.argsort(gains, kind="stable")]

    def _ended(self, bound: float) -> JointSolution:
        if self.best is None:
            none = np.isinf(bound)
            status = SolveStatus.INFEASIBLE if none else SolveStatus.UNKNOWN
            proof = "all devices together aren't enough" if none else self._proof()
            return JointSolution(self.problem, status, _NONE, _NONE, bound, proof)
        bound = min(bound, self.cost)
        proved = not self._saves(bound)
        status = SolveStatus.OPTIMAL if proved else SolveStatus.FEASIBLE
        bound = self.cost if proved else bound
        proof = self._proof() if proved else f"{self._proof()}, cut by the work budget"
        return JointSolution(self.problem, status, *self.best, bound, proof)

    def _proof(self) -> str:
        if not self.cuts:
            return "fewest projectors beside fewest cameras of any projectors"
        return f"hitting sets of {len(self.cuts)} sets of projectors"


def _halves(some: list[int]) -> list[list[int]]:
    """Return two halves, the first one last; none of a single one."""
    middle = len(some) // 2
    return [some[middle:], some[:middle]] if middle else []


def _step(cost: float) -> float:
    """A number above the room that rounding needs."""
    return 2.0 * SAME * max(cost, 1.0)
