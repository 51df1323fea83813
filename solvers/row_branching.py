"""Branch and bound on full covers by the pairs of rows that one set may serve together.

For rows r and q let S be the sets over both. Either some set of S is taken, then the
row S itself, which is harder to cover than r or q, joins the rows; or none is, then all
of S goes. Where many sets are nearly alike, both sides raise the bound, whereas taking
or leaving a single set leaves its twins. What is left is a full cover again.

Rows of the whole that a node's relaxation misses by much are taken in as they are met:
any subset of the rows bounds the whole. Every node is bounded by multipliers evaluated
here, whatever the linear program says::

    count >= sum_e y_e + sum_j min(0, 1 - y a_j)

and sets whose reduced cost exceeds what a smaller cover may still spend go below it.

References:
    Ryan and Foster, "An integer programming approach to scheduling", in: Computer
    Scheduling of Public Transport, North-Holland, 1981.
"""

import dataclasses
import heapq

import numpy as np
from numpy.typing import NDArray

from .node_program import Node, NodeProgram
from .row_generation import IntegerCover
from .status import WorkBudget

_ROUNDING = 1e-7
_INTEGRAL = 1e-6
# Pairs whose two sides are bounded before one is branched on.
_TRIED = 3
# Rows missed by more than a share are taken in, so many at a time.
_MISSED = 0.25
_BATCH = 5
_PAIRS = 400
# A node's program may stop this far above what refutes it.
_BEYOND = 0.02


def branch_on_rows(
    covers: NDArray[np.bool_],
    rows: NDArray[np.int64],
    size: int,
    budget: WorkBudget,
) -> IntegerCover:
    """Refute that fewer than ``size`` sets cover every row, or find them.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s); every row is covered.
        rows: Rows to start from; more join as they are missed.
        size: Sets of a known cover.
        budget: Work; where it ends, the least bound of what is open is returned.
    """
    return _Tree(covers, rows, size, budget).run()


class _Tree:
    def __init__(
        self,
        covers: NDArray[np.bool_],
        rows: NDArray[np.int64],
        size: int,
        budget: WorkBudget,
    ) -> None:
        self.covers = covers
        self.cut = size - 1 + _ROUNDING
        self.size = size
        self.budget = budget
        self.linear = NodeProgram(covers[rows], self.cut + _BEYOND, budget)
        self.nodes: list[tuple[int, int, int, Node]] = []
        self.made = 0

    def run(self) -> IntegerCover:
        """Search best bound first, deepest first among equal ones."""
        allowed = np.ones(self.covers.shape[1], dtype=bool)
        root = self.linear.solve(allowed, (), None)
        if root is None:
            return IntegerCover(None, 0)
        self._push(root, 0)
        lower = 0
        while self.nodes:
            lower = self.nodes[0][0]
            _, depth, _, node = heapq.heappop(self.nodes)
            again = self._take_in(node)
            if again is not None:
                self._push(again, depth)
                continue
            support = np.flatnonzero(node.primal > _INTEGRAL)
            if support.size < self.size and self._is_cover(support):
                return IntegerCover(support, lower)
            children = self._branch(node)
            if children is None:
                return IntegerCover(None, lower)
            for child in children:
                self._push(child, depth - 1)
        return IntegerCover(None, self.size)

    def _is_cover(self, support: NDArray[np.int64]) -> bool:
        return bool(self.covers[:, support].any(axis=1).all())

    def _take_in(self, node: Node) -> Node | None:
        """Return the node bounded over more rows, or None if it misses none by much."""
        support = np.flatnonzero(node.primal > _INTEGRAL)
        reached = self.covers[:, support] @ node.primal[support]
        self.budget.spend(4.0 * len(self.covers) * support.size)
        missed = np.flatnonzero(reached < 1.0 - _MISSED)
        if missed.size == 0:
            return None
        order = np.argsort(np.round(reached[missed], 9), kind="stable")
        self.linear.take_in(self.covers[missed[order[:_BATCH]]])
        return self.linear.solve(node.allowed, node.added, node.basis)

    def _push(self, node: Node, depth: int) -> None:
        if node.bound > self.cut:
            return
        level = max(0, int(np.ceil(node.bound - _ROUNDING)))
        self.made += 1
        heapq.heappush(self.nodes, (level, depth, -self.made, node))

    def _branch(self, node: Node) -> list[Node] | None:
        """Return the children worth keeping, or None where the budget ended."""
        allowed = node.allowed & (node.bound + node.reduced <= self.cut)
        best: list[Node] = []
        best_gain = -1.0
        room = self.cut - node.bound + 0.01
        for pair in self._pairs(node, allowed):
            taken = self.linear.solve(allowed, (*node.added, pair), node.basis)
            left = self.linear.solve(allowed & ~pair, node.added, node.basis)
            if taken is None or left is None:
                return None
            gains = [min(max(c.bound - node.bound, 0.0), room) for c in (taken, left)]
            gain = (gains[0] + 1e-3) * (gains[1] + 1e-3)
            if gain > best_gain:
                best, best_gain = [left, taken], gain
            if min(gains) >= room:
                break
        return best

    def _pairs(self, node: Node, allowed: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
        """Return sets over pairs of rows, of about half a set in the relaxation."""
        rows = np.concatenate([self.linear.rows, *(row[None] for row in node.added)])
        if node.dual.size != len(rows):
            node = dataclasses.replace(node, dual=np.ones(len(rows)))
        heavy = np.flatnonzero(node.dual > _INTEGRAL)
        support = np.flatnonzero(
            (node.primal > _INTEGRAL) & (node.primal < 1.0 - _INTEGRAL) & allowed
        )
        over = rows[np.ix_(heavy, support)].astype(np.float64)
        both = (over * node.primal[support]) @ over.T
        alone = over @ node.primal[support]
        apart = np.minimum(alone[:, None], alone[None]) - both
        score = np.minimum(both, apart) * (node.dual[heavy, None] + node.dual[heavy])
        score = np.round(np.triu(score, 1), 9)
        order = np.argsort(-score, axis=None, kind="stable")[:_PAIRS]
        pairs: list[NDArray[np.bool_]] = []
        seen: set[bytes] = set()
        used = np.zeros(heavy.size, dtype=np.int64)
        for i, j in zip(*np.unravel_index(order, score.shape), strict=True):
            if not score[i, j] > 0 or len(pairs) == _TRIED:
                break
            if used[i] + used[j] > 1:
                continue
            pair = rows[heavy[i]] & rows[heavy[j]] & allowed
            key = pair[support].tobytes()
            if key not in seen:
                seen.add(key)
                used[[i, j]] += 1
                pairs.append(pair)
        if support.size and len(pairs) < 2:
            middle = np.argmin(np.abs(node.primal[support] - 0.5))
            pairs.append(np.arange(allowed.size) == support[middle])
        if not pairs:
            pairs.append(np.arange(allowed.size) == np.flatnonzero(allowed)[0])
        return pairs
