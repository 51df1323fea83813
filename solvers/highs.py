"""HiGHS, run in a process that others share."""

from typing import Any


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
