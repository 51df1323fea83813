"""BLAS and HiGHS on one thread while a solver runs.

Its products of matrices are many and small: threads that wait for one another cost more
than they gain, and on a busy machine several times the whole.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import wraps
from threading import Lock
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from threadpoolctl import ThreadpoolController

from .status import WorkBudget

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


def quiet_highs(**options: object) -> Any:  # noqa: ANN401
    """Return an empty instance that says nothing, on one thread."""
    import highspy

    solver: Any = highspy.Highs()
    common = {"output_flag": False, "threads": 1, "parallel": "off", "random_seed": 0}
    for name, value in (common | options).items():
        solver.setOptionValue(name, value)
    return solver


def row_program(
    costs: NDArray[np.float64],
    rows: sparse.csr_array,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
) -> Any:  # noqa: ANN401
    """Return `HighsLp` of: minimise c x, lower <= A x <= upper, 0 <= x <= 1."""
    import highspy

    lp: Any = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = costs.size, lower.size
    lp.col_cost_ = costs
    lp.col_lower_, lp.col_upper_ = np.zeros(costs.size), np.ones(costs.size)
    lp.row_lower_, lp.row_upper_ = lower, upper
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_ = rows.indptr.astype(np.int32)
    lp.a_matrix_.index_ = rows.indices.astype(np.int32)
    lp.a_matrix_.value_ = rows.data.astype(np.float64)
    return lp


def seconds_left(budget: WorkBudget) -> float:
    """Return what the clock leaves a run, as HiGHS takes it, in [s]."""
    return float(max(0.01, min(budget.time_left, 1e7)))


def run_highs(solver: Any) -> None:  # noqa: ANN401
    """Run a HiGHS instance, also where another has run with more threads.

    Raises:
        RuntimeError: If HiGHS refuses for another reason.
    """
    import highspy

    if solver.run() != highspy.HighsStatus.kError:
        return
    # Its scheduler belongs to the process and refuses another number of threads.
    highspy.Highs.resetGlobalScheduler(True)
    if solver.run() == highspy.HighsStatus.kError:
        raise RuntimeError(f"HiGHS failed: {solver.getModelStatus()}")
