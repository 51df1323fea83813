"""Chosen devices whose bodies collide, or keep light and views from each other.

A cover knows nothing of what its members' bodies do to each other. So they are looked
at once it is chosen; where too little is left, members are set down one after the
other, the one that covers most first, each time with what the others would cover
recomputed among the bodies that stand by then, and the cover is completed anew. In the
end every member was chosen, or judged, with all other bodies in place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.scene.placed_bodies import (
    Device,
    blocked_by,
    bodies_of,
    collide,
    moves_bodies,
)
from solvers.covers.cover import solve_max_coverage

from .marginals import MORE, Marginals
from .quotas import Quotas
from .selection import CandidateCover, Selection, cover_problem

# Counted work of each completion, of which no proof is asked.
_BUDGET = 1e8
# Share of what a count covers that it must keep among bodies, else others are tried.
_HELD = 0.99


@dataclass(frozen=True, eq=False)
class Interference:
    """Candidates, and what each covers with the bodies of some in the way.

    Attributes:
        devices: The candidates.
        points: Samples in [m], shape (n, 3).
        covered: Which candidate covers which, but for bodies of others, shape (n, m).
        clearance_m: What bodies keep between each other [m].
    """

    devices: Sequence[Device]
    points: NDArray[np.float64]
    covered: NDArray[np.bool_]
    clearance_m: float

    @property
    def bodied(self) -> bool:
        """Whether any candidate that isn't existing has a body."""
        return moves_bodies(self.devices)

    def covers(
        self, standing: Sequence[int], columns: Sequence[int]
    ) -> NDArray[np.bool_]:
        """Return which samples candidates cover among the bodies of those that stand.

        One whose body would collide with theirs covers nothing. Shape (n, k).
        """
        chosen = [self.devices[i] for i in standing]
        bodies = bodies_of(device for device in chosen if not device.existing)
        covered = self.covered[:, columns]
        for k, column in enumerate(columns):
            device, at = self.devices[column], np.flatnonzero(covered[:, k])
            if collide(device, bodies, self.clearance_m):
                covered[:, k] = False
                continue
            blocked = blocked_by(bodies, device, self.points[at]).any(axis=1)
            covered[at[blocked], k] = False
        return covered

    def stand_together(self, chosen: Sequence[int]) -> bool:
        """Return whether no bodies collide, and none takes what can't be spared."""
        devices = [self.devices[i] for i in chosen]
        bodies = bodies_of(devices)
        return not any(collide(device, bodies, self.clearance_m) for device in devices)


def resolve_conflicts(
    among: Interference, cover: CandidateCover, selection: Selection
) -> Selection:
    """Return a selection of compatible candidates.

    It is the selection as it was where it covers what is required with all bodies in
    place. Its lower bound stays: bodies only take away.
    """
    if not among.bodied:
        return selection
    chosen, most = selection.chosen, cover.max_count
    quotas = cover.quotas.as_far_as(cover.covered(chosen))
    more = max(len(chosen), selection.needed) + MORE
    spare = max(selection.n_covered - quotas.total, int((1.0 - _HELD) * quotas.total))
    demand = _Demand(quotas, spare, more if most is None else most)
    resolved, held = _compatible(among, cover, chosen, demand)
    covered = int(held.sum())
    if np.array_equal(resolved, np.sort(chosen)) and covered == selection.n_covered:
        return selection
    smallest, met = resolved, cover.quotas.enough(held)
    costlier = len(resolved) > selection.needed
    if not met:
        # How many would do it, were more allowed.
        demand = replace(demand, quotas=cover.quotas, most=more)
        enough, there = _compatible(among, cover, selection.smallest, demand)
        cover_found = cover.quotas.enough(there)
        fewest = enough if cover_found else selection.smallest
        smallest = max((fewest, resolved), key=len)
        costlier |= not cover_found or len(enough) > selection.needed
    bound = selection.n_covered_bound
    if len(resolved) != len(chosen):
        _, bound = cover.most_covering(len(resolved), None, _BUDGET)
    proved = selection.lower_bound >= len(resolved)
    status = ("optimal" if proved else "feasible") if met else "infeasible"
    return replace(
        selection,
        chosen=resolved,
        smallest=smallest,
        status=status,
        n_covered=covered,
        n_covered_bound=bound,
        but_for_bodies=selection.needed if costlier else None,
    )


def resolve_others(
    among: Interference, cover: CandidateCover, others: Marginals, taken: int
) -> Marginals:
    """Return the best candidates of every other count that are compatible."""
    if not among.bodied:
        return others
    by_count, n_covered = dict(others.by_count), dict(others.n_covered)
    for count, chosen in others.by_count.items():
        if count != taken:
            before = cover.covered(chosen)
            held = int(_HELD * int(before.sum()))
            quotas = replace(cover.quotas.as_far_as(before), total=held)
            demand = _Demand(quotas, int(before.sum()) - held, count)
            by_count[count], after = _compatible(among, cover, chosen, demand)
            n_covered[count] = int(after.sum()), n_covered[count][1]
    return replace(others, by_count=by_count, n_covered=n_covered)


@dataclass(frozen=True)
class _Demand:
    """What compatible candidates must cover, and how many are allowed.

    One of them may take `spare` samples from those that stood before it.
    """

    quotas: Quotas
    spare: int
    most: int


def _compatible(
    among: Interference,
    cover: CandidateCover,
    chosen: NDArray[np.int64],
    demand: _Demand,
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return compatible candidates, and which samples they cover, (n,)."""
    standing = list(range(cover.n_existing))
    every = list(range(cover.covers.shape[1]))
    tried = [int(i) for i in chosen]
    best: tuple[list[int], NDArray[np.bool_]] | None = None
    while True:
        covered = np.any(among.covers(tried, tried), axis=1)
        if among.stand_together(tried):
            if best is None or _better(demand.quotas, covered, best[1]):
                best = tried, covered
            if demand.quotas.enough(covered):
                break
        waiting = [i for i in tried if i not in standing]
        if waiting:
            alone = among.covers(standing, waiting).sum(axis=0)
            standing = [*standing, waiting[int(np.argmax(alone))]]
        elif len(tried) >= demand.most:
            break
        covers = _harmless(among, standing, every, demand.spare)
        completed = _completed(covers, standing, tried, demand, cover)
        if not waiting and completed == tried:
            break
        tried = completed
    if best is None:
        existing = list(range(cover.n_existing))
        best = existing, np.any(among.covers(existing, existing), axis=1)
    chosen_best, held = best
    return np.array(sorted(chosen_best), dtype=np.int64), held


def _better(
    quotas: Quotas, covered: NDArray[np.bool_], than: NDArray[np.bool_]
) -> bool:
    """Return whether samples covered are less lacking than others, or as much more."""
    new, old = ((-quotas.lacking(c), int(c.sum())) for c in (covered, than))
    return new > old


def _harmless(
    among: Interference, standing: list[int], every: list[int], spare: int
) -> NDArray[np.bool_]:
    """What candidates cover; nothing where they take too much from those standing."""
    covers = among.covers(standing, every)
    before = int(covers[:, standing].any(axis=1).sum())
    if before <= spare:
        return covers
    for column in np.flatnonzero(covers.any(axis=0)):
        if column not in standing:
            after = among.covers([*standing, int(column)], standing)
            if before - int(after.any(axis=1).sum()) > spare:
                covers[:, column] = False
    return covers


def _completed(
    covers: NDArray[np.bool_],
    standing: list[int],
    tried: list[int],
    demand: _Demand,
    cover: CandidateCover,
) -> list[int]:
    """Return the candidates that stand, with others to cover what is required."""
    problem = cover_problem(covers, demand.quotas, stock=cover.stock)
    problem = replace(problem, fixed=np.array(standing, np.int64))
    taken = np.array(standing, dtype=np.int64)
    least = min(max(len(standing), len(tried)), demand.most)
    for count in range(least, demand.most + 1):
        taken = solve_max_coverage(
            problem, count, seed=cover.seed, budget=_BUDGET
        ).selected
        if demand.quotas.enough(np.any(covers[:, taken], axis=1)):
            break
    useful = np.asarray(covers.any(axis=0))
    return sorted(i for i in map(int, taken) if useful[i] or i in standing)
