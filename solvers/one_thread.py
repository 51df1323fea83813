"""One BLAS thread while a solver runs.

Its products of matrices are many and small: threads that wait for one another cost more
than they gain, and on a busy machine several times the whole.
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

_P = ParamSpec("_P")
_R = TypeVar("_R")


def on_one_thread(solve: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that leaves BLAS one thread until it returns."""

    @wraps(solve)
    def limited(*args: _P.args, **options: _P.kwargs) -> _R:
        with _controller().limit(limits=1, user_api="blas"):
            return solve(*args, **options)

    return limited


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()
