"""Fewest groups of which no two members conflict: the chromatic number, exactly.

Given a graph, colour its vertices so that the ends of each edge differ::

    minimise k  s.t.  colour_i in {0 .. k-1},   colour_i != colour_j for every edge ij

A clique of k vertices proves that k colours are needed. One colour more than that is
tried until a colouring exists. Up to eight vertices all cliques and colourings are
listed; above, HiGHS decides, up to a number of nodes::

    clique:     maximise sum_i x_i,  x_i + x_j <= 1 where i and j don't conflict
    colouring:  sum_c x_ic = 1 for each i,  x_ic + x_jc <= 1 for each edge ij and c
"""

from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

_LISTED = 8
_MAX_NODES = 20_000
# Of `scipy.optimize.milp`.
_INFEASIBLE = 2

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
        max_nodes: Nodes that each run of HiGHS may take.

    Raises:
        ValueError: If the table isn't square, boolean, symmetric and free of loops.
    """
    _check(conflicts)
    n, listed = len(conflicts), len(conflicts) <= _LISTED
    clique = _largest_clique(conflicts) if listed else _clique(conflicts, max_nodes)
    least, count, proved = len(clique), len(clique), True
    while True:
        if count == n:
            colours, refuted = np.arange(n), True
        elif listed:
            colours, refuted = _listed_colouring(conflicts, clique, count), True
        else:
            colours, refuted = _colouring(conflicts, clique, count, max_nodes)
        if colours is not None:
            break
        proved = proved and refuted
        count += 1
        least = count if proved else least
    count = int(np.unique(colours).size)
    proof: Proof = (
        "clique" if count == len(clique) else "exhaustion" if proved else "none"
    )
    _, first, same = np.unique(colours, return_index=True, return_inverse=True)
    named = np.argsort(np.argsort(first))[same.reshape(n)]
    return Colouring(named.astype(np.int64), count, least, clique, proof)


def _largest_clique(conflicts: NDArray[np.bool_]) -> tuple[int, ...]:
    """Return the last of the largest cliques, trying all."""
    n = len(conflicts)
    cliques = (
        chosen
        for size in range(n, -1, -1)
        for chosen in reversed(list(combinations(range(n), size)))
        if all(conflicts[i, j] for i, j in combinations(chosen, 2))
    )
    return next(cliques)


def _listed_colouring(
    conflicts: NDArray[np.bool_], clique: tuple[int, ...], count: int
) -> NDArray[np.int64] | None:
    """Return the first colouring of all in which the clique has the first colours."""
    colours = np.zeros(len(conflicts), dtype=np.int64)
    colours[list(clique)] = np.arange(len(clique))
    others = np.setdiff1d(np.arange(len(conflicts)), clique)
    one, other = np.nonzero(np.triu(conflicts))
    for choice in product(range(count), repeat=others.size):
        colours[others] = choice
        if not np.any(colours[one] == colours[other]):
            return colours
    return None


def _clique(conflicts: NDArray[np.bool_], max_nodes: int) -> tuple[int, ...]:
    n = len(conflicts)
    pairs = np.argwhere(np.triu(~conflicts, 1))
    x, _ = _binaries(np.ones(n), pairs, np.ones(n), max_nodes)
    # A run that was cut may have found none: a vertex is one.
    return (0,) if x is None else tuple(np.flatnonzero(x > 0.5).tolist())


def _colouring(
    conflicts: NDArray[np.bool_], clique: tuple[int, ...], count: int, max_nodes: int
) -> tuple[NDArray[np.int64] | None, bool]:
    n = len(conflicts)
    edges = np.argwhere(np.triu(conflicts))
    pairs = np.concatenate([edges + n * c for c in range(count)])
    once = sparse.csr_array(np.tile(np.eye(n), count))
    upper = np.ones((count, n))
    upper[:, list(clique)] = np.eye(count, len(clique))
    x, refuted = _binaries(np.zeros(n * count), pairs, upper.ravel(), max_nodes, once)
    return (None if x is None else np.argmax(x.reshape(count, n), axis=0)), refuted


def _binaries(
    gains: NDArray[np.float64],
    pairs: NDArray[np.int64],
    upper: NDArray[np.float64],
    max_nodes: int,
    once: sparse.csr_array | None = None,
) -> tuple[NDArray[np.float64] | None, bool]:
    """Maximise gains of binaries, no pair of which is taken; rows of `once` take one.

    Returns the solution or None, and whether it is proved that there is none.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    rows = np.repeat(np.arange(len(pairs)), 2)
    table = (np.ones(pairs.size), (rows, pairs.ravel()))
    shape = (len(pairs), gains.size)
    limits = [LinearConstraint(sparse.csr_array(table, shape=shape), ub=1.0)]
    if once is not None:
        limits.append(LinearConstraint(once, 1.0, 1.0))
    answer = milp(
        -gains,
        integrality=np.ones(gains.size),
        bounds=Bounds(0.0, upper),  # type: ignore[arg-type]
        constraints=limits,
        options={"node_limit": max_nodes},
    )
    return answer.x, answer.status == _INFEASIBLE


def _check(conflicts: NDArray[np.bool_]) -> None:
    n = len(conflicts)
    if conflicts.shape != (n, n) or conflicts.dtype != np.bool_:
        raise ValueError(
            f"conflicts must be boolean and square, got {conflicts.dtype} "
            f"{conflicts.shape}"
        )
    if np.any(conflicts != conflicts.T) or np.any(np.diag(conflicts)):
        raise ValueError("conflicts must be symmetric, and no vertex its own conflict")
