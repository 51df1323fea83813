"""Chosen devices whose bodies collide, or keep light and views from each other.

A cover knows nothing of what its members' bodies do to each other. So they are looked
at once it is chosen; where too little is left, members are set down one after the
other, the one that covers most first, each time with what the others would cover
recomputed among the bodies that stand by then, and the cover is completed anew. In the
end every member was chosen, or judged, with all other bodies in place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.scene.samples import Target
from planning.scene.standing import blocked_by, bodies_of, collide, moves_bodies
from solvers.covers.cover import solve_max_coverage

from .selection import MORE, Marginals, Selection, cover_problem

# Counted work of each completion, of which no proof is asked.
_BUDGET = 1e8
# What a row of the marginal table may lose to bodies before others are looked for.
_HELD = 0.99


class Interference(Protocol):
    """Candidates, and what each covers with the bodies of some in the way."""

    @property
    def bodied(self) -> bool:
        """Whether any candidate that isn't given has a body."""
        ...

    def covers(
        self, standing: Sequence[int], columns: Sequence[int]
    ) -> NDArray[np.bool_]:
        """Return which rows candidates cover among the bodies of others.

        Args:
            standing: Candidates whose bodies stand.
            columns: Candidates asked about; one whose body would collide with those
                covers nothing.

        Returns:
            Shape (n, len(columns)).
        """
        ...

    def stand_together(self, chosen: Sequence[int]) -> bool:
        """Return whether no bodies collide, and none takes what can't be spared."""
        ...


@dataclass(frozen=True, eq=False)
class ProjectorInterference:
    """Projectors, and the samples that they light.

    Attributes:
        devices: The candidates.
        rows: The samples.
        lit: Which candidate lights which, but for bodies of others, shape (n, m).
    """

    devices: Sequence[PlannedProjector]
    rows: Target
    lit: NDArray[np.bool_]

    @property
    def bodied(self) -> bool:
        """Whether any candidate that isn't given has a body."""
        return moves_bodies(self.devices)

    def covers(
        self, standing: Sequence[int], columns: Sequence[int]
    ) -> NDArray[np.bool_]:
        """Return which rows candidates light among the bodies of others."""
        chosen = [self.devices[i] for i in standing]
        bodies = bodies_of(device for device in chosen if not device.existing)
        lit = self.lit[:, columns]
        for k, column in enumerate(columns):
            device, own = self.devices[column], np.flatnonzero(lit[:, k])
            if collide(device, bodies):
                lit[:, k] = False
                continue
            points = self.rows.samples.points[own]
            lit[own[blocked_by(bodies, device, points).any(axis=1)], k] = False
        return lit

    def stand_together(self, chosen: Sequence[int]) -> bool:
        """Return whether no bodies collide."""
        devices = [self.devices[i] for i in chosen]
        bodies = bodies_of(devices)
        return not any(collide(device, bodies) for device in devices)


def resolve_conflicts(
    crowd: Interference,
    covers: NDArray[np.bool_],
    selection: Selection,
    *,
    max_count: int | None,
    seed: int,
    given: int = 0,
) -> Selection:
    """Return a selection whose members bear each other's bodies.

    It is the selection as it was where it covers what is required with all bodies in
    place. Its lower bound stays: bodies only take away.

    Args:
        crowd: The candidates.
        covers: What each covers, but for bodies of other candidates, shape (n, m).
        selection: Chosen without regard to bodies.
        max_count: Candidates allowed; None for no limit.
        seed: Of the heuristics.
        given: First candidates that are taken whatever they cover.
    """
    if not crowd.bodied:
        return selection
    chosen, required = selection.chosen, min(selection.required, selection.best_rows)
    more = max(len(chosen), selection.needed) + MORE
    most = more if max_count is None else max_count
    spare = max(selection.best_rows - required, int((1.0 - _HELD) * required))
    wanted = _Wanted(required, spare, most, given, seed)
    settled, rows = _settled(crowd, covers.shape[1], chosen, wanted)
    if np.array_equal(settled, np.sort(chosen)) and rows == selection.best_rows:
        return selection
    smallest, met = settled, rows >= selection.required
    but_for_bodies = None
    if len(settled) > selection.needed:
        but_for_bodies = selection.needed
    if not met:
        # How many would do it, were more allowed.
        wanted = replace(wanted, required=selection.required, most=more)
        enough, there = _settled(crowd, covers.shape[1], selection.smallest, wanted)
        found = enough if there >= selection.required else selection.smallest
        smallest = max((found, settled), key=len)
        if found is not enough or len(enough) > selection.needed:
            but_for_bodies = selection.needed
    bound = selection.best_rows_bound
    if len(settled) != len(chosen):
        problem = cover_problem(covers, required, given)
        best = solve_max_coverage(problem, len(settled), seed=seed, budget=_BUDGET)
        bound = int(np.floor(best.upper_bound + 1e-6))
    proved = selection.lower_bound >= len(settled)
    status = ("optimal" if proved else "feasible") if met else "infeasible"
    return replace(
        selection,
        chosen=settled,
        smallest=smallest,
        status=status,
        best_rows=rows,
        best_rows_bound=bound,
        but_for_bodies=but_for_bodies,
    )


def resolve_others(
    crowd: Interference,
    covers: NDArray[np.bool_],
    others: Marginals,
    taken: int,
    *,
    seed: int,
    given: int = 0,
) -> Marginals:
    """Return the best candidates of every other count, bearing each other's bodies.

    Args:
        crowd: The candidates.
        covers: As for `resolve_conflicts`.
        others: Chosen without regard to bodies.
        taken: The count that is settled already.
        seed: Of the heuristics.
        given: As for `resolve_conflicts`.
    """
    if not crowd.bodied:
        return others
    by_count, most_rows = dict(others.by_count), dict(others.most_rows)
    for count, chosen in others.by_count.items():
        if count != taken:
            rows = int(covers[:, chosen].any(axis=1).sum())
            held = int(_HELD * rows)
            wanted = _Wanted(held, rows - held, count, given, seed)
            by_count[count], rows = _settled(crowd, covers.shape[1], chosen, wanted)
            most_rows[count] = rows, most_rows[count][1]
    return replace(others, by_count=by_count, most_rows=most_rows)


@dataclass(frozen=True)
class _Wanted:
    """What is asked of candidates that bear each other.

    Attributes:
        required: Rows to be covered.
        spare: Rows that one of them may take from those that stood before it.
        most: Candidates allowed.
        given: First candidates that are taken whatever they cover.
        seed: Of the heuristics.
    """

    required: int
    spare: int
    most: int
    given: int
    seed: int


def _settled(
    crowd: Interference, n_candidates: int, chosen: NDArray[np.int64], wanted: _Wanted
) -> tuple[NDArray[np.int64], int]:
    """Return candidates that bear each other, and the rows that they cover."""
    standing = list(range(wanted.given))
    every = list(range(n_candidates))
    tried = [int(i) for i in chosen]
    best, best_rows = standing, -1
    while True:
        rows = int(crowd.covers(tried, tried).any(axis=1).sum())
        if crowd.stand_together(tried):
            if rows > best_rows:
                best, best_rows = tried, rows
            if rows >= wanted.required:
                break
        left = [i for i in tried if i not in standing]
        if left:
            alone = crowd.covers(standing, left).sum(axis=0)
            standing = [*standing, left[int(np.argmax(alone))]]
        elif len(tried) >= wanted.most:
            break
        covers = _harmless(crowd, standing, every, wanted.spare)
        completed = _completed(covers, standing, tried, wanted)
        if not left and completed == tried:
            break
        tried = completed
    if best_rows < 0:
        best_rows = int(crowd.covers(best, best).any(axis=1).sum())
    return np.array(sorted(best), dtype=np.int64), best_rows


def _harmless(
    crowd: Interference, standing: list[int], every: list[int], spare: int
) -> NDArray[np.bool_]:
    """What candidates cover; nothing where they cost those that stand more than spare.

    A cover can't count rows that a member takes away, so who takes many isn't offered.
    """
    covers = crowd.covers(standing, every)
    before = int(covers[:, standing].any(axis=1).sum())
    if before <= spare:
        return covers
    for column in np.flatnonzero(covers.any(axis=0)):
        if column not in standing:
            left = crowd.covers([*standing, int(column)], standing)
            if before - int(left.any(axis=1).sum()) > spare:
                covers[:, column] = False
    return covers


def _completed(
    covers: NDArray[np.bool_],
    standing: list[int],
    tried: list[int],
    wanted: _Wanted,
) -> list[int]:
    """Return the candidates that stand, with others to cover what is required."""
    problem = replace(cover_problem(covers, 0), fixed=np.array(standing, np.int64))
    found = np.array(standing, dtype=np.int64)
    least = min(max(len(standing), len(tried)), wanted.most)
    for count in range(least, wanted.most + 1):
        found = solve_max_coverage(
            problem, count, seed=wanted.seed, budget=_BUDGET
        ).selected
        if covers[:, found].any(axis=1).sum() >= wanted.required:
            break
    serves = np.asarray(covers.any(axis=0))
    return sorted(i for i in map(int, found) if serves[i] or i in standing)
