"""The best plan so far is kept, whatever ends the search for a better one."""

import time
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import replace
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


P = TypeVar("P", bound=_Partial)
# Gives what there is so far, ever better, and whether its plan is wanted: then it is
# sent back, for what comes next hangs on it. Ends after a plan that is good enough.
Search = Generator[tuple[P, bool], RigPlan | None, None]


def best_kept(
    search: Search[P],
    write: Callable[[P, Stopwatch], RigPlan],
    clock: Stopwatch,
    keep: Keep | None,
) -> tuple[RigPlan, P]:
    """Return the last plan of a search, and what it was written from.

    With a time limit the first of all is written at once: that shows how long it takes,
    and stands if there is no time to write a better one.

    Raises:
        InterruptedPlanError: If the search is interrupted; it carries the best plan.
        TimeLimitError: If the time limit came before any plan was written.
    """
    first: RigPlan | None = None
    partial, wanted = next(search)
    begun = partial
    try:
        if clock.limited:
            first = _first_kept(_cut(partial), write, clock, keep)
        while True:
            plan = write(partial, clock) if wanted else None
            try:
                partial, wanted = search.send(plan)
            except StopIteration:
                assert plan is not None
                return plan, partial
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
