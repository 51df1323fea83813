"""Progress, stage times, and the limits that end a run early."""

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

from .errors import TimeLimitError

Report = Callable[[str], None]

# What planning may take of a time limit; the rest is for writing what was planned.
_PLANNING = 0.8


class Stopwatch:
    """Times stages and tells whoever listens which one runs.

    Args:
        report: Receives one line when a stage begins; None for silence.
        time_limit: Wall time in [s] after which `check` raises; None for no limit.

    Attributes:
        seconds: Wall time of each stage [s].
        processor: Processor time of each stage, over all threads [s].
    """

    def __init__(
        self, report: Report | None = None, *, time_limit: float | None = None
    ) -> None:
        self._report = report
        self._begin = time.monotonic()
        self._limit = None if time_limit is None else _PLANNING * time_limit
        self.seconds: dict[str, float] = {}
        self.processor: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str, line: str) -> Generator[None]:
        """Time a stage; it starts only while there is time left.

        Raises:
            TimeLimitError: If the time limit has passed.
        """
        self.check()
        self.say(line)
        begin, worked = time.monotonic(), time.process_time()
        try:
            yield
        finally:
            for times, spent in (
                (self.seconds, time.monotonic() - begin),
                (self.processor, time.process_time() - worked),
            ):
                times[name] = round(times.get(name, 0.0) + spent, 3)

    def say(self, line: str) -> None:
        """Report one line of progress."""
        if self._report is not None:
            self._report(line)

    def say_in_time(self, line: str) -> None:
        """Report one line of progress, unless the time limit has passed."""
        self.check()
        self.say(line)

    def check(self) -> None:
        """Raise TimeLimitError once the time limit has passed."""
        spent = time.monotonic() - self._begin
        if self._limit is not None and spent > self._limit:
            raise TimeLimitError(
                f"the time limit came before a first plan stood, after {spent:.1f} s "
                f"of planning; allow more (--time-limit)"
            )

    def extend(self) -> None:
        """Give all of the time limit: what was planned is written."""
        if self._limit is not None:
            self._limit /= _PLANNING

    def lift(self) -> None:
        """Let the rest run whatever the time: a plan is being saved."""
        self._limit = None
