"""The best plan so far is kept, whatever ends the search for a better one."""

import time
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar

from planning.model.plan import InterruptedPlanError, RigPlan
from planning.model.progress import TIME_IS_UP, Stopwatch

Keep = Callable[[RigPlan], None]

# Time kept for writing, in times that writing the first plan took.
_WRITING = 1.25


class _Partial(Protocol):
    """What a plan is written from, a dataclass; cut plans are told as such."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def truncated(self) -> bool: ...


class Known(Protocol):
    """What is known of a plan before all of it is written."""

    def written(self, clock: Stopwatch) -> RigPlan:
        """Return the plan."""
        ...


@dataclass(frozen=True)
class Whole:
    """A plan that nothing is left to be written of."""

    plan: RigPlan

    def written(self, clock: Stopwatch) -> RigPlan:
        """Return the plan."""
        return self.plan


P = TypeVar("P", bound=_Partial)
D = TypeVar("D", bound=Known)
# Gives what there is so far, ever better, and whether its draft is wanted: then it is
# sent back, for what comes next hangs on it. Ends after a draft that is good enough.
Search = Generator[tuple[P, bool], D | None, None]


def best_kept(
    search: Search[P, D],
    draft: Callable[[P, Stopwatch], D],
    clock: Stopwatch,
    keep: Keep | None,
) -> tuple[RigPlan, P]:
    """Return the plan of a search's last draft, and what it was written from.

    With a time limit the first of all is written at once: that shows how long it takes,
    and stands if there is no time to write a better one.

    Raises:
        InterruptedPlanError: If the search is interrupted; it carries the best plan.
        TimeLimitError: If the time limit came before any plan was written.
    """

    def write(partial: P, clock: Stopwatch) -> RigPlan:
        return draft(partial, clock).written(clock)

    first: RigPlan | None = None
    partial, wanted = next(search)
    begun = partial
    try:
        if clock.limited:
            first = _first_kept(_cut(partial), write, clock, keep)
        while True:
            known = draft(partial, clock) if wanted else None
            try:
                partial, wanted = search.send(known)
            except StopIteration:
                assert known is not None
                return known.written(clock), partial
    except KeyboardInterrupt:
        clock.lift()
        raise InterruptedPlanError(write(_cut(partial), clock)) from None
    except TIME_IS_UP:
        clock.extend()
        if first is None:
            raise
        with suppress(*TIME_IS_UP):
            if partial is not begun:
                first = write(_cut(partial), clock)
        return first, partial


def _first_kept(
    partial: P,
    write: Callable[[P, Stopwatch], RigPlan],
    clock: Stopwatch,
    keep: Keep | None,
) -> RigPlan:
    """Write a plan that stands if the run is cut, and reserve time for another."""
    begin = time.monotonic()
    plan = write(partial, clock)
    if keep is not None:
        keep(plan)
    clock.reserve(_WRITING * (time.monotonic() - begin))
    return plan


def _cut(partial: P) -> P:
    return replace(partial, truncated=True)
