"""HiGHS, run on one thread in a process that others share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .status import WorkBudget


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
