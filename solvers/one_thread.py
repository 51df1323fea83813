"""One BLAS thread while a solver runs.

Its products of matrices are many and small: threads that wait for one another cost more
than they gain, and on a busy machine several times the whole.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import wraps
from threading import Lock
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

_P = ParamSpec("_P")
_R = TypeVar("_R")


class _Limit:
    """The number belongs to the process: the first solver sets it, the last resets."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._solvers = 0
        self._libraries: ThreadpoolController | None = None
        self._limits: Any = None

    @contextmanager
    def held(self) -> Generator[None]:
        with self._lock:
            # Looking for the libraries takes longer than many a small cover.
            self._libraries = self._libraries or ThreadpoolController()
            if self._solvers == 0:
                self._limits = self._libraries.limit(limits=1, user_api="blas")
            self._solvers += 1
        try:
            yield
        finally:
            with self._lock:
                self._solvers -= 1
                if self._solvers == 0:
                    self._limits.restore_original_limits()


_LIMIT = _Limit()


def on_one_thread(solve: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that leaves BLAS one thread until it returns."""

    @wraps(solve)
    def limited(*args: _P.args, **options: _P.kwargs) -> _R:
        with _LIMIT.held():
            return solve(*args, **options)

    return limited
