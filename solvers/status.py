"""How a solve ended, and the work that it may spend."""

import enum
import signal
import time
from collections.abc import Generator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType


class SolveStatus(enum.Enum):
    """Why a solver stopped, and hence what its answer proves."""

    OPTIMAL = "proven optimal"
    LOCALLY_OPTIMAL = "locally optimal; no global claim"
    FEASIBLE = "feasible; stopped at a limit before a proof"
    INFEASIBLE = "proven infeasible"
    UNKNOWN = "stopped at a limit or failed without a usable point"

    @property
    def has_point(self) -> bool:
        """Whether a feasible point came back."""
        return self in (
            SolveStatus.OPTIMAL,
            SolveStatus.LOCALLY_OPTIMAL,
            SolveStatus.FEASIBLE,
        )


class WorkBudget:
    """Counted work, so that a slower machine gives the same answer.

    One unit is one matrix entry touched (about 1 ns). The clock only cuts: an answer
    that it cut says so and is exempt from being reproducible.
    """

    def __init__(self, units: float, *, time_limit: float = float("inf")) -> None:
        units, time_limit = _amount("budget", units), _amount("time limit", time_limit)
        if not units >= 0:
            raise ValueError(f"work budget is {units}, must be at least 0")
        if not time_limit >= 0:
            raise ValueError(f"time limit is {time_limit} s, must be at least 0")
        # No more than can be counted down from.
        self.units = min(float(units), 1e18)
        self.spent = 0.0
        self._deadline = time.monotonic() + time_limit
        self._parent: WorkBudget | None = None

    def part(self, units: float) -> "WorkBudget":
        """Return a smaller budget whose work counts here too."""
        child = WorkBudget(max(0.0, min(units, self.remaining)))
        child._deadline = self._deadline
        child._parent = self
        return child

    def renew(self, units: float) -> None:
        """Allow so much more work, that counts in no larger budget."""
        self.units, self._parent = self.spent + units, None

    def spend(self, units: float) -> None:
        """Count work that was done."""
        self.spent += units
        if self._parent is not None:
            self._parent.spend(units)

    @property
    def remaining(self) -> float:
        """Work left, at least 0."""
        return max(0.0, self.units - self.spent)

    @property
    def time_left(self) -> float:
        """Wall time until the clock cuts, in [s]."""
        return self._deadline - time.monotonic()

    @property
    def out_of_time(self) -> bool:
        """Whether the clock cut the solve."""
        return time.monotonic() > self._deadline

    @property
    def exhausted(self) -> bool:
        """Whether to stop, because of work or of the clock."""
        return self.spent >= self.units or self.out_of_time

    @property
    def reason(self) -> str:
        """What ended the work, for people."""
        return "time limit" if self.out_of_time else "work budget"


def _amount(name: str, number: object) -> float:
    try:
        return float(number)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a number, got {number!r}") from None


@contextmanager
def interruptible() -> Generator[None]:
    """Let a Ctrl-C through that CasADi takes for itself and then forgets.

    CasADi catches the KeyboardInterrupt that a signal raises inside a callback, warns,
    and lets the solve end as if it had failed; here it is raised again.
    """
    before = signal.getsignal(signal.SIGINT)
    if (
        before is not signal.default_int_handler
        or current_thread() is not main_thread()
    ):
        yield
        return
    seen: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        seen.append(number)
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if seen:
        raise KeyboardInterrupt
