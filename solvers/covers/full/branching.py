"""Branch and bound on full covers of equal costs, best bound first.

Who derives from the tree tells how a node is split. Rows of the whole that a node's
relaxation misses by much are taken in: any subset of the rows bounds the whole.
"""

import heapq
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.status import WorkBudget

from .node_program import Node, NodeProgram

_ROUNDING = 1e-7
INTEGRAL = 1e-6
# Rows missed by more than a share are taken in, so many at a time.
_MISSED = 0.25
_BATCH = 5
# A node's program may stop this far above what refutes it.
_BEYOND = 0.02


@dataclass(frozen=True, eq=False)
class Refutation:
    """What branch and bound found about covers of fewer sets than known.

    Attributes:
        selected: A cover of fewer sets, or None.
        lower_bound: Sets that any cover needs at least; the count known where all
            smaller ones are refuted.
    """

    selected: NDArray[np.int64] | None
    lower_bound: int


class Tree(ABC):
    """Search for fewer than ``size`` sets that cover every row.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s); every row is covered.
        rows: Rows to start from; more join as they are missed.
        size: Sets of a known cover.
        budget: Work; where it ends, the least bound of what is open is returned.
    """

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
        self.linear = NodeProgram(
            covers[rows], budget, presolve="off", objective_bound=self.cut + _BEYOND
        )
        self.made = 0
        self._nodes: list[tuple[int, int, int, Node]] = []

    @abstractmethod
    def branch(self, node: Node) -> list[Node] | None:
        """Return nodes that hold all smaller covers of a node between them.

        None where the budget ended before.
        """

    def run(self) -> Refutation:
        """Refute all smaller covers, or find one; deepest first among equal bounds."""
        root = self.linear.root()
        if root is None:
            return Refutation(None, 0)
        self._push(root, 0)
        lower = 0
        while self._nodes:
            lower = self._nodes[0][0]
            _, depth, _, node = heapq.heappop(self._nodes)
            again = self._take_in(node)
            if again is not None:
                self._push(again, depth)
                continue
            support = np.flatnonzero(node.primal > INTEGRAL)
            covered = self.covers[:, support].any(axis=1).all()
            if support.size < self.size and covered:
                return Refutation(support, lower)
            children = self.branch(node)
            if children is None:
                return Refutation(None, lower)
            for child in children:
                self._push(child, depth - 1)
        return Refutation(None, self.size)

    def _take_in(self, node: Node) -> Node | None:
        """Return the node bounded over more rows, or None if it misses none by much."""
        support = np.flatnonzero(node.primal > INTEGRAL)
        reached = self.covers[:, support] @ node.primal[support]
        self.budget.spend(4.0 * len(self.covers) * support.size)
        missed = np.flatnonzero(reached < 1.0 - _MISSED)
        if missed.size == 0:
            return None
        order = np.argsort(np.round(reached[missed], 9), kind="stable")
        self.linear.take_in(self.covers[missed[order[:_BATCH]]])
        return self.linear.solve(node.part, node.basis)

    def _push(self, node: Node, depth: int) -> None:
        if node.bound > self.cut:
            return
        level = max(0, int(np.ceil(node.bound - _ROUNDING)))
        self.made += 1
        heapq.heappush(self._nodes, (level, depth, -self.made, node))
