"""Fewest groups of which no two members conflict: the chromatic number, exactly.

Given a graph, colour its vertices so that the ends of each edge differ::

    minimise k  s.t.  colour_i in {0 .. k-1},   colour_i != colour_j for every edge ij

A clique of k vertices proves that k colours are needed. Where the largest clique is
smaller than the best colouring, branch and bound on one colour fewer decides: it either
finds one or has tried every colouring (DSATUR: the vertex with the fewest colours left
is coloured next; of the colours not used yet, only the first is tried).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .status import SolveStatus

# Vertices placed: a second or two.
_BUDGET = 300_000


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
        status: `OPTIMAL` if `n_colours` is the least, else `FEASIBLE`.
    """

    colour: NDArray[np.int64]
    n_colours: int
    lower_bound: int
    clique: tuple[int, ...]
    proof: str
    status: SolveStatus

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Vertices of each colour, rising."""
        return tuple(
            tuple(np.flatnonzero(self.colour == c).tolist())
            for c in range(self.n_colours)
        )


def fewest_colours(conflicts: NDArray[np.bool_], *, budget: int = _BUDGET) -> Colouring:
    """Colour a graph with the fewest colours.

    Args:
        conflicts: Whether two vertices conflict: symmetric, no vertex with itself,
            shape (n, n).
        budget: Vertices that each of the two searches may place.

    Raises:
        ValueError: If the table isn't square, boolean, symmetric and free of loops.
    """
    _check(conflicts)
    n = len(conflicts)
    near = [sum(1 << int(j) for j in np.flatnonzero(row)) for row in conflicts]
    clique = _largest_clique(near, budget)
    # The vertices of the clique differ anyway: their colours are given.
    given = {vertex: k for k, vertex in enumerate(clique)}
    colours = _greedy(near, given)
    least, work = len(clique), budget
    while max(colours, default=-1) >= least:
        k = max(colours)
        found, work = _coloured(near, given, k, work)
        if found is None:
            least = k + 1 if work > 0 else least
            break
        colours = found
    count = max(colours, default=-1) + 1
    proof = "clique" if count == len(clique) else "exhaustion"
    proof = proof if count == least else "none"
    status = SolveStatus.OPTIMAL if count == least else SolveStatus.FEASIBLE
    return Colouring(_named(colours, n), count, least, clique, proof, status)


def _largest_clique(near: Sequence[int], budget: int) -> tuple[int, ...]:
    """Return a largest clique, or the largest that the work allows.

    Tomita's bound: a clique in a set has no more members than a greedy colouring of
    the set has colours.
    """
    best: list[int] = []
    work = budget

    def grow(taken: list[int], rest: int) -> None:
        nonlocal best, work
        order = _by_colour(near, rest)
        for vertex, bound in reversed(order):
            if len(taken) + bound <= len(best) or work <= 0:
                return
            work -= 1
            taken.append(vertex)
            inner = rest & near[vertex]
            if inner:
                grow(taken, inner)
            elif len(taken) > len(best):
                best = taken.copy()
            taken.pop()
            rest &= ~(1 << vertex)

    grow([], (1 << len(near)) - 1)
    return tuple(sorted(best))


def _by_colour(near: Sequence[int], rest: int) -> list[tuple[int, int]]:
    """Return the vertices of a set with the number of their greedy colour, rising."""
    order: list[tuple[int, int]] = []
    colour = 0
    while rest:
        colour += 1
        free = rest
        while free:
            vertex = (free & -free).bit_length() - 1
            order.append((vertex, colour))
            rest &= ~(1 << vertex)
            free &= ~(near[vertex] | 1 << vertex)
    return order


def _greedy(near: Sequence[int], given: dict[int, int]) -> list[int]:
    """Return the colouring that DSATUR makes without ever going back."""
    colours = [given.get(vertex, -1) for vertex in range(len(near))]
    while (vertex := _next(near, colours)) is not None:
        taken = _taken(near, colours, vertex)
        colours[vertex] = next(c for c in range(len(near)) if not taken >> c & 1)
    return colours


def _coloured(
    near: Sequence[int], given: dict[int, int], k: int, work: int
) -> tuple[list[int] | None, int]:
    """Return a colouring with k colours, or None, and the work that is left."""
    colours = [given.get(vertex, -1) for vertex in range(len(near))]

    def place(used: int) -> bool:
        nonlocal work
        vertex = _next(near, colours)
        if vertex is None:
            return True
        taken = _taken(near, colours, vertex)
        for colour in range(min(used + 1, k)):
            if taken >> colour & 1:
                continue
            if work <= 0:
                return False
            work -= 1
            colours[vertex] = colour
            if place(max(used, colour + 1)):
                return True
            colours[vertex] = -1
        return False

    return (colours if place(len(given)) else None), work


def _next(near: Sequence[int], colours: list[int]) -> int | None:
    """Return the vertex next to most colours, then to most vertices, then the first."""
    left = [vertex for vertex, colour in enumerate(colours) if colour < 0]
    if not left:
        return None
    return max(
        left,
        key=lambda v: (_taken(near, colours, v).bit_count(), near[v].bit_count(), -v),
    )


def _taken(near: Sequence[int], colours: list[int], vertex: int) -> int:
    """Return the colours around a vertex, as bits."""
    taken = 0
    for other, colour in enumerate(colours):
        if colour >= 0 and near[vertex] >> other & 1:
            taken |= 1 << colour
    return taken


def _named(colours: list[int], n: int) -> NDArray[np.int64]:
    first = list(dict.fromkeys(colours))
    return np.array([first.index(colours[v]) for v in range(n)], dtype=np.int64)


def _check(conflicts: NDArray[np.bool_]) -> None:
    n = len(conflicts)
    if conflicts.shape != (n, n) or conflicts.dtype != np.bool_:
        raise ValueError(
            f"conflicts must be boolean and square, got {conflicts.dtype} "
            f"{conflicts.shape}"
        )
    if np.any(conflicts != conflicts.T) or np.any(np.diag(conflicts)):
        raise ValueError("conflicts must be symmetric, and no vertex its own conflict")
