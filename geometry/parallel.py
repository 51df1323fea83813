"""Run independent pieces of work on all cores; results don't depend on how many."""

import os
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_ABANDONABLE = "ringrig-pairs"


def n_threads() -> int:
    """Return how many cores this process may use."""
    # Not everywhere can it be asked which ones are allowed.
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def mapped(
    function: Callable[[_Item], _Result],
    items: Iterable[_Item],
    threads: int | None = None,
) -> list[_Result]:
    """Return the results of a function for all items, in their order.

    The items go to threads: it pays where the function spends its time in numpy, scipy
    or embree, which let go of the interpreter. What an item gives must not depend on
    the others, so that the number of threads (default: all cores) changes nothing.
    """
    todo = list(items)
    results: dict[int, _Result] = {}
    queue = iter(range(len(todo)))

    def drain() -> None:
        try:
            for index in queue:
                results[index] = function(todo[index])
        except BaseException:
            # Where one fails, the others begin nothing more.
            deque(queue, maxlen=0)
            raise

    helpers = min(threads or n_threads(), len(todo)) - 1
    others = [_pool(os.getpid()).submit(drain) for _ in range(helpers)]
    # The caller works too: no thread has to be woken for the last item, and one that
    # calls this from a thread needs no other.
    try:
        drain()
    finally:
        for other in others:
            if not other.cancel():
                other.result()
    return [results[index] for index in range(len(todo))]


@contextmanager
def abandonable(threads: int) -> Generator[ThreadPoolExecutor]:
    """Give threads for long pieces of work; none is waited for after an exception."""
    pool = ThreadPoolExecutor(threads, thread_name_prefix=_ABANDONABLE)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def abandoned() -> bool:
    """Return whether work goes on that nobody waits for."""
    return any(t.name.startswith(_ABANDONABLE) for t in threading.enumerate())


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    # A forked process has none of its parent's threads, hence the key.
    return ThreadPoolExecutor(n_threads(), thread_name_prefix="geometry")
