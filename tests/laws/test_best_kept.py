"""Whatever ends a search, the best there is so far is what is returned."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import pytest

from planning.model.errors import TimeLimitError
from planning.model.plan import InterruptedPlanError
from planning.model.progress import Stopwatch
from planning.steps.best_kept import Search, Whole, best_kept


@dataclass(frozen=True)
class Partial:
    name: str
    truncated: bool = False


def searched(
    end: Callable[[], None], after: int, asked: list[object]
) -> Search[Partial, Whole]:
    """A draft, its plan, a draft, its plan; something ends it after so many."""
    for k, (name, wanted) in enumerate(
        (("draft", False), ("whole", True), ("better", False), ("best", True))
    ):
        if k == after:
            end()
        asked.append((yield Partial(name), wanted))


def ended(kind: type[BaseException]) -> Callable[[], None]:
    def end() -> None:
        raise kind("over")

    return end


def kept(end, after, *, limit=None):
    """Names of what stands, of what it was written from, of all written; and told."""
    written: list[str] = []
    told: list[str] = []
    asked: list[object] = []

    def write(partial: Partial, _: Stopwatch) -> Any:
        written.append(f"{partial.name}{'*' if partial.truncated else ''}")
        return Whole(cast(Any, written[-1]))

    clock, search = Stopwatch(time_limit=limit), searched(end, after, asked)
    try:
        plan, partial = best_kept(search, write, clock, cast(Any, told.append))
    except InterruptedPlanError as error:
        return error.plan, None, written, told, asked
    return plan, partial.name, written, told, asked


def test_the_last_plan_of_a_whole_search_is_taken_and_drafts_cost_nothing():
    name, partial, written, told, asked = kept(ended(KeyboardInterrupt), 9)
    assert (name, partial) == ("best", "best")
    assert written == ["whole", "best"]
    assert told == []
    # A search is told of a plan where it asked for one, and of none else.
    assert [one is None for one in asked] == [True, False, True, False]


def test_with_a_time_limit_the_first_is_written_at_once_and_kept():
    name, _, written, told, _ = kept(ended(KeyboardInterrupt), 9, limit=1e6)
    assert name == "best"
    assert written == ["draft*", "whole", "best"]
    assert told == ["draft*"]


@pytest.mark.parametrize(
    ("after", "best"), [(1, "draft*"), (2, "whole*"), (3, "better*")]
)
def test_an_interrupted_search_leaves_what_was_best(after, best):
    assert kept(ended(KeyboardInterrupt), after)[0] == best


@pytest.mark.parametrize(
    ("after", "best"), [(1, "draft*"), (2, "whole*"), (3, "better*")]
)
def test_a_cut_search_leaves_what_was_best(after, best):
    name, partial, written, _, _ = kept(ended(TimeLimitError), after, limit=1e6)
    assert name == best
    assert partial == best.rstrip("*")
    assert written[0] == "draft*"


def test_a_limit_before_anything_was_written_is_an_error():
    with pytest.raises(TimeLimitError):
        kept(ended(TimeLimitError), 0, limit=1e6)
    with pytest.raises(KeyboardInterrupt):
        kept(ended(KeyboardInterrupt), 0)


def test_of_drafts_that_a_search_goes_on_from_nothing_more_is_written():
    finished: list[str] = []

    class Draft(Whole):
        def written(self, clock: Stopwatch) -> Any:
            finished.append(cast(str, self.plan))
            return super().written(clock)

    def draft(partial: Partial, _: Stopwatch) -> Draft:
        return Draft(cast(Any, partial.name))

    search = searched(ended(KeyboardInterrupt), 9, [])
    assert best_kept(search, draft, Stopwatch(), None)[0] == "best"
    assert finished == ["best"]
