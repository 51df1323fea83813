"""Run independent pieces of work on all cores; results don't depend on how many."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def n_threads() -> int:
    """Return how many cores this process may use."""
    # Not everywhere can it be asked which ones are allowed.
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def mapped(
    function: Callable[[_Item], _Result], items: Iterable[_Item]
) -> list[_Result]:
    """Return the results of a function for all items, in their order.

    The items go to threads: it pays where the function spends its time in numpy and
    scipy, which let go of the interpreter. What an item gives must not depend on the
    others, so that the number of threads changes nothing; nor may it call this again,
    since it would wait for a thread that waits for it.
    """
    todo = list(items)
    threads = min(n_threads(), len(todo))
    if threads < 2:
        return [function(item) for item in todo]
    # One thread takes every second item, say: handing them out one by one costs more.
    shares = [todo[k::threads] for k in range(threads)]

    def done(share: list[_Item]) -> list[_Result]:
        return [function(item) for item in share]

    parts = list(_pool(os.getpid()).map(done, shares))
    return [parts[i % threads][i // threads] for i in range(len(todo))]


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    # A forked process has none of its parent's threads, hence the key.
    return ThreadPoolExecutor(n_threads(), thread_name_prefix="geometry")
