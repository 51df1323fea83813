"""Fewest groups of which no two members conflict: the chromatic number, exactly.

Given a graph, colour its vertices so that the ends of each edge differ::

    minimise k  s.t.  colour_i in {0 .. k-1},   colour_i != colour_j for every edge ij

A clique of k vertices proves that k colours are needed. One colour more than that is
tried until a colouring exists. Cliques and colourings are searched vertex by vertex,
back to the last choice where none is left, up to a number of steps.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .status import WorkBudget

# About two seconds.
_MAX_NODES = 200_000

Proof = Literal["clique", "exhaustion", "none"]


@dataclass(frozen=True, eq=False)
class Colouring:
    """Answer of :func:`fewest_colours`.

    Attributes:
        colour: Of each vertex, 0 to `n_colours` - 1 in the order of the first vertex
            that has it, shape (n,).
        n_colours: Number of colours.
        lower_bound: Colours that are needed at least.
        clique: Vertices that conflict pairwise, rising: the largest set found.
        proof: `clique`: there are as many in it as colours. `exhaustion`: no colouring
            with one colour fewer exists, all were tried. `none`: the work ran out.
    """

    colour: NDArray[np.int64]
    n_colours: int
    lower_bound: int
    clique: tuple[int, ...]
    proof: Proof

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Vertices of each colour, rising."""
        return tuple(
            tuple(np.flatnonzero(self.colour == c).tolist())
            for c in range(self.n_colours)
        )


def fewest_colours(
    conflicts: NDArray[np.bool_], *, max_nodes: int = _MAX_NODES
) -> Colouring:
    """Colour a graph with the fewest colours.

    Args:
        conflicts: Whether two vertices conflict: symmetric, no vertex with itself,
            shape (n, n).
        max_nodes: Vertices that each search may choose or colour.

    Raises:
        ValueError: If the table isn't square, boolean, symmetric and free of loops.
    """
    _check(conflicts)
    n, clique = len(conflicts), tuple[int, ...]()
    every = np.arange(n)
    while larger := _clique(conflicts, every, len(clique) + 1, WorkBudget(max_nodes)):
        clique = larger
    least, count, proved = len(clique), len(clique), True
    others = np.setdiff1d(every, clique)
    while True:
        # With as many colours as vertices no step is in vain.
        budget = WorkBudget(max_nodes if count < n else np.inf)
        colours = np.full(n, -1)
        colours[list(clique)] = np.arange(len(clique))
        if _coloured(conflicts, colours, others, count, budget):
            break
        proved = proved and not budget.exhausted
        count += 1
        least = count if proved else least
    count = int(np.unique(colours).size)
    proof: Proof = (
        "clique" if count == len(clique) else "exhaustion" if proved else "none"
    )
    _, first, same = np.unique(colours, return_index=True, return_inverse=True)
    named = np.argsort(np.argsort(first))[same.reshape(n)]
    return Colouring(named.astype(np.int64), count, least, clique, proof)


def _clique(
    conflicts: NDArray[np.bool_],
    among: NDArray[np.int64],
    size: int,
    budget: WorkBudget,
) -> tuple[int, ...] | None:
    """Return the last clique of a size among vertices, None if none was met."""
    if size == 0:
        return ()
    for i in range(len(among) - size, -1, -1):
        if budget.exhausted:
            break
        budget.spend(1)
        later = among[i + 1 :][conflicts[among[i], among[i + 1 :]]]
        rest = _clique(conflicts, later, size - 1, budget)
        if rest is not None:
            return (int(among[i]), *rest)
    return None


def _coloured(
    conflicts: NDArray[np.bool_],
    colours: NDArray[np.int64],
    others: NDArray[np.int64],
    count: int,
    budget: WorkBudget,
) -> bool:
    """Colour the other vertices in order, if `count` colours and the budget do."""
    if not others.size:
        return True
    vertex, later = others[0], others[1:]
    # Colours that no vertex has yet are alike: one of them is tried.
    most = min(int(colours.max(initial=-1)) + 2, count)
    for colour in np.setdiff1d(np.arange(most), colours[conflicts[vertex]]):
        if budget.exhausted:
            break
        budget.spend(1)
        colours[vertex] = colour
        if _coloured(conflicts, colours, later, count, budget):
            return True
    colours[vertex] = -1
    return False


def _check(conflicts: NDArray[np.bool_]) -> None:
    n = len(conflicts)
    if conflicts.shape != (n, n) or conflicts.dtype != np.bool_:
        raise ValueError(
            f"conflicts must be boolean and square, got {conflicts.dtype} "
            f"{conflicts.shape}"
        )
    if np.any(conflicts != conflicts.T) or np.any(np.diag(conflicts)):
        raise ValueError("conflicts must be symmetric, and no vertex its own conflict")
