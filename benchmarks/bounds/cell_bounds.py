"""Bounds over cells on circles and spheres of known optimum, beside plain HiGHS.

Usage: python -m benchmarks.bounds.cell_bounds [WORD ...]   (ringrig installed)

Every row is one run of `bound_count` with its usual budget, asked to prove the truth.
Trees are `tests/support/cap_trees.py`'s, made when asked for; what that takes is one
column. HiGHS gets the whole mixed-integer program over all leaves, one thread and 60 s,
where that has at most 5 million nonzeros. WORDs select rows that contain one of them.
"""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import highspy
import numpy as np
from numpy.typing import NDArray
from support import cap_trees

from benchmarks.machine import machine
from solvers.cells import cell_bound, cell_tuples
from solvers.cells.cell_bound import CellBound, bound_count
from solvers.cells.cell_problem import CellProblem
from solvers.cells.cell_tree import CellBatch, CellTree

TREES = cap_trees
HIGHS_SECONDS = 60.0
MAX_NONZEROS = 5_000_000
HEAD = (
    "| workspace | rows | leaves | truth | bound | proved by | most of one less "
    "| cells asked | multisets | multipliers [s] | multisets [s] | making cells [s] "
    "| HiGHS, all leaves |"
)


@dataclass(frozen=True)
class Case:
    """One workspace.

    Attributes:
        name: For the table.
        tree: Its cells.
        problem: What must be served.
        truth: Fewest poses; where nobody knows, None, and a greedy cover stands in.
    """

    name: str
    tree: CellTree
    problem: CellProblem
    truth: int | None


class Clocked:
    """A tree that measures what making its cells takes."""

    units = 0.0

    def __init__(self, tree: CellTree) -> None:
        self.tree, self.n_rows, self.seconds = tree, tree.n_rows, 0.0

    def roots(self) -> CellBatch:
        """Return the tree's roots."""
        return self.tree.roots()

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the tree's children."""
        begin = time.perf_counter()
        batch = self.tree.children(cells)
        self.seconds += time.perf_counter() - begin
        return batch


def main() -> int:
    """Print the table."""
    print(
        f"{machine()} (one used), HiGHS {highspy.Highs().version()}, "
        f"load before the run {os.getloadavg()[0]:.1f}\n"
    )
    print(HEAD)
    print("|" + (HEAD.count("|") - 1) * "---|")
    for case in _cases():
        label = f"{case.name}, {case.tree.n_rows} rows"
        if not sys.argv[1:] or any(word in label for word in sys.argv[1:]):
            print(_row(case), flush=True)
    print()
    print(_pairs())
    return 0


def _cases() -> list[Case]:
    cases = [
        _circle(1024, 12, 600),
        _circle(1024, 12, 300),
        _circle(1024, 12, 130),
        _circle(8192, 17, 1040),
    ]
    for rows, depth in ((1024, 5), (1024, 7), (8192, 7)):
        cases.append(_sphere(rows, depth, 75.0, 4))
        cases.append(_sphere(rows, depth, 64.0, 5))
        cases.append(_sphere(rows, depth, 44.5, 6, discs=5.7))
        cases.append(_uneven(rows, depth, 60.0, 0.95))
        cases.append(_uneven(rows, depth, 80.0, 1.0))
    cases.append(_sphere(1024, 7, 66.0, 5))
    cases.append(_sphere(1024, 7, 56.0, 6))
    return cases


def _circle(n: int, depth: int, reach: int) -> Case:
    """Even points, arcs that hold ``reach`` of them wherever they lie."""
    spacing = 2 * np.pi / n
    points = TREES.circle(spacing * (np.arange(n) + 0.3))
    tree = TREES.CircleTree(points, (reach - 0.5) / 2 * spacing, depth)
    problem = CellProblem(np.ones(n), np.array([float(n)]))
    return Case("circle, all", tree, problem, -(-n // reach))


def _sphere(
    n: int, depth: int, degrees: float, truth: int, discs: float | None = None
) -> Case:
    """Even points, equal caps: all of them, or the area of a number of caps."""
    tree = TREES.SphereTree(TREES.spread(n), np.deg2rad(degrees), depth)
    share = 1.0
    if discs is not None:
        share = discs * (1.0 - np.cos(np.deg2rad(degrees))) / 2.0
    what = "all" if discs is None else f"{share:.0%}"
    problem = CellProblem(np.ones(n), np.array([np.floor(share * n)]))
    return Case(f"sphere, caps of {degrees:g} deg, {what}", tree, problem, truth)


def _uneven(n: int, depth: int, degrees: float, share: float) -> Case:
    """Points crowded on one side, each with a reach and a weight of its own."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(n, 3)) * [1.0, 0.6, 0.3] + 0.3 * rng.normal(size=3)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    reach = np.deg2rad(rng.uniform(0.5 * degrees, degrees, n))
    weights = rng.random(n)
    tree = TREES.SphereTree(points, reach, depth)
    problem = CellProblem(weights, np.array([share * weights.sum()]))
    name = f"uneven sphere, caps to {degrees:g} deg, {share:.0%}"
    return Case(name, tree, problem, None)


@contextmanager
def _weighed() -> Iterator[list[int]]:
    """Count the multisets of cells that are weighed, into the list's one number."""
    count, weigh = [0], cell_tuples._weigh

    def counted(nodes, *given):  # noqa: ANN001, ANN002, ANN202
        count[0] += len(nodes)
        return weigh(nodes, *given)

    cell_tuples._weigh = counted
    yield count
    cell_tuples._weigh = weigh


def _row(case: Case) -> str:
    truth = _greedy(case) if case.truth is None else case.truth
    tree, spent = Clocked(case.tree), [0.0]
    tuples = cell_bound.refute_tuples

    def clocked(*given):  # noqa: ANN002, ANN202
        begin, made = time.perf_counter(), tree.seconds
        found = tuples(*given)
        spent[0] += time.perf_counter() - begin - (tree.seconds - made)
        return found

    cell_bound.refute_tuples = clocked
    begin = time.perf_counter()
    with _weighed() as multisets:
        answer = bound_count(case.problem, tree, truth)
    wall = time.perf_counter() - begin
    cell_bound.refute_tuples = tuples
    cells = [
        case.name,
        f"{tree.n_rows:,}",
        f"{_leaves(case.tree):,}",
        f"{truth}" if case.truth is not None else f"at most {truth} (greedy)",
        f"{answer.lower_bound:g}",
        _how(answer),
        f"{answer.most_weight / case.problem.weights.sum():.1%}",
        f"{answer.cells_used:,}",
        f"{multisets[0]:,}",
        f"{wall - spent[0] - tree.seconds:.2f}",
        f"{spent[0]:.2f}",
        f"{tree.seconds:.2f}",
        _highs(case),
    ]
    return "| " + " | ".join(cells) + " |"


def _how(answer: CellBound) -> str:
    said = {"PROVED": "", "SURVIVED": "; one less survives", "CUT": "; cut"}
    word = "multisets" if answer.proof.startswith("multisets") else "multipliers"
    if answer.status.name == "SURVIVED":
        return f"{word}; cells for {answer.lower_bound:g} survive"
    return word + said[answer.status.name]


def _leaves(tree: CellTree) -> int:
    return tree.n_roots * tree.arity**tree.depth  # type: ignore[attr-defined]


def _greedy(case: Case) -> int:
    """Return the size of a greedy cover by free poses."""
    poses = TREES.spread(20_000)
    serves = poses @ case.tree.points.T >= np.cos(case.tree.radius)  # type: ignore[attr-defined]
    serves = serves.astype(np.float32)
    left = case.problem.weights.copy()
    allowed, count = left.sum() - case.problem.required_weight[0], 0
    while left.sum() > allowed * (1 + 1e-12):
        left[serves[int(np.argmax(serves @ left.astype(np.float32)))] > 0] = 0.0
        count += 1
    return count


def _leaf_matrix(tree: CellTree) -> NDArray[np.bool_] | None:
    """Return what every leaf may serve, or None if that is too much."""
    every = np.arange(_leaves(tree))
    firsts = TREES.CircleTree if isinstance(tree, TREES.CircleTree) else None
    first = 2**tree.depth - 1 if firsts else 2 * (4**tree.depth - 1)  # type: ignore[attr-defined]
    sample = tree.serves(first + every[:: max(1, every.size // 200)])  # type: ignore[attr-defined]
    if sample.mean() * every.size * tree.n_rows > MAX_NONZEROS:
        return None
    return tree.serves(first + every)  # type: ignore[attr-defined]


def _highs(case: Case) -> str:
    """Solve the program over all leaves with HiGHS alone; say how far it came."""
    serves = _leaf_matrix(case.tree)
    if serves is None:
        return "too large"
    begin = time.perf_counter()
    solver = _program(serves, case.problem)
    solver.setOptionValue("time_limit", HIGHS_SECONDS)
    solver.run()
    wall = time.perf_counter() - begin
    info = solver.getInfo()
    bound = int(np.ceil(max(info.mip_dual_bound, 0.0) - 1e-6))
    if solver.getModelStatus() == highspy.HighsModelStatus.kOptimal:
        return f"{bound} in {wall:.1f} s"
    return f"bound {bound} at {wall:.0f} s"


def _program(serves: NDArray[np.bool_], problem: CellProblem) -> highspy.Highs:
    n, rows = serves.shape
    solver = highspy.Highs()
    for name, value in (("output_flag", False), ("threads", 1), ("parallel", "off")):
        solver.setOptionValue(name, value)
    scale = rows / problem.weights.sum()
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = n + rows, rows + 1
    lp.col_cost_ = np.concatenate([np.ones(n), np.zeros(rows)])
    lp.col_lower_, lp.col_upper_ = np.zeros(n + rows), np.ones(n + rows)
    lp.row_lower_ = np.append(np.zeros(rows), problem.required_weight[0] * scale)
    lp.row_upper_ = np.full(rows + 1, highspy.kHighsInf)
    columns = [np.flatnonzero(serves[:, i]) for i in range(rows)]
    index = [np.append(c, n + i) for i, c in enumerate(columns)]
    index.append(n + np.arange(rows))
    value = [np.append(np.ones(c.size), -1.0) for c in columns]
    value.append(problem.weights * scale)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    sizes = [0, *(i.size for i in index)]
    lp.a_matrix_.start_ = np.cumsum(sizes).astype(np.int32)
    lp.a_matrix_.index_ = np.concatenate(index).astype(np.int32)
    lp.a_matrix_.value_ = np.concatenate(value)
    integer, free = highspy.HighsVarType.kInteger, highspy.HighsVarType.kContinuous
    lp.integrality_ = [integer] * n + [free] * rows
    solver.passModel(lp)
    return solver


def _pairs() -> str:
    """Time all pairs of cells by a matrix product, which the search does without."""
    rng = np.random.default_rng(2)
    points = rng.normal(size=(1024, 3)) * [1.0, 0.7, 0.5]
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    tree = TREES.SphereTree(points, np.deg2rad(50.0), 5)
    serves = _leaf_matrix(tree)
    assert serves is not None
    dense = serves.astype(np.float32)
    begin, best = time.perf_counter(), 0.0
    each = dense.sum(axis=1)
    for start in range(0, len(dense), 512):
        part = slice(start, start + 512)
        both = each[part, None] + each - dense[part] @ dense.T
        best = max(best, float(both.max()))
    product = time.perf_counter() - begin
    begin = time.perf_counter()
    problem = CellProblem(np.ones(1024), np.array([best + 1.0]))
    with _weighed() as multisets:
        answer = bound_count(problem, tree, 3)
    search = time.perf_counter() - begin
    return (
        f"The best pair of {len(dense):,} leaves of an uneven sphere (1,024 rows, caps "
        f"of 50 deg) serves {best:.0f} rows: {product:.2f} s by matrix product. That "
        f"no pair serves one more: bound {answer.lower_bound:g} in {search:.2f} s with "
        f"{answer.cells_used:,} cells and {multisets[0]:,} multisets, making them "
        f"included."
    )


if __name__ == "__main__":
    sys.exit(main())
