"""Progress, stage times, and the limits that end a run early."""

import math
import signal
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

from .errors import TimeLimitError

Report = Callable[[str], None]


class Cut(BaseException):
    """The time limit has passed; no handler of errors takes it for one of its own."""


# What ends work when the time limit passes, where it looks at the clock or not.
TIME_IS_UP = TimeLimitError, Cut

# A run with a time limit looks at the clock so often [s] ...
_TICK_S = 0.1
# ... and is cut again where the first cut was swallowed, or is still cleaning up [s].
_AGAIN_S = 1.0
# Not in a solver of CasADi, which warns of exceptions, nor in a callback of a weak
# reference, which swallows them, nor where threads are begun: one that is unknown to
# its pool is waited for in vain. Nor amid an import.
_ALWAYS = "casadi.py", "weakref.py", "concurrent/futures/thread.py"
_WHOLE = (*_ALWAYS, "<frozen importlib._bootstrap>")
# A stage that has said nothing for so long says that it still runs [s].
_SILENCE_S = 30.0


class Stopwatch:
    """Times stages and tells whoever listens which one runs.

    Args:
        report: Receives one line when a stage begins; None for silence.
        time_limit: Wall time in [s] after which `check` raises; None for no limit.
        begin: When that time began, on the monotonic clock [s]; None: now.

    Attributes:
        limited: Whether there is a time limit.
        seconds: Wall time of each stage [s].
        processor: Processor time of each stage, over all threads [s].
    """

    def __init__(
        self,
        report: Report | None = None,
        *,
        time_limit: float | None = None,
        begin: float | None = None,
    ) -> None:
        self._report = report
        self._begin = time.monotonic() if begin is None else begin
        self._limit = self._deadline = math.inf if time_limit is None else time_limit
        self._next_cut = -math.inf
        self._said = time.monotonic()
        self.limited = time_limit is not None
        self.seconds: dict[str, float] = {}
        self.processor: dict[str, float] = {}

    @contextmanager
    def ticking(self) -> Generator[None]:
        """Raise `Cut` within, wherever the main thread is when the time limit passes.

        What leaves is a TimeLimitError. In another thread, and where systems have no
        timer, only `check` raises.
        """
        main = threading.current_thread() is threading.main_thread()
        if not (self.limited and main and hasattr(signal, "setitimer")):
            yield
            return
        self._next_cut = -math.inf
        handler = signal.signal(signal.SIGALRM, self._tick)
        timer = signal.setitimer(signal.ITIMER_REAL, _TICK_S, _TICK_S)
        try:
            yield
        except Cut as cut:
            raise TimeLimitError(str(cut)) from None
        finally:
            self._next_cut = math.inf
            signal.setitimer(signal.ITIMER_REAL, *timer)
            signal.signal(signal.SIGALRM, handler)

    def _tick(self, _: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        # What was planned is still to be written, with whole packages.
        whole = _WHOLE if self._deadline < self._limit else _ALWAYS
        if now < self._next_cut or _runs(frame, whole):
            return
        try:
            self.check()
        except TimeLimitError as error:
            self._next_cut = now + _AGAIN_S
            raise Cut(str(error)) from None

    @contextmanager
    def stage(self, name: str, line: str) -> Generator[None]:
        """Time a stage; it starts only while there is time left.

        Raises:
            TimeLimitError: If the time limit has passed.
        """
        self.check()
        self.say(line)
        begin, worked = time.monotonic(), time.process_time()
        ended = threading.Event()
        teller = threading.Thread(target=self._tell, args=(line, ended), daemon=True)
        teller.start()
        try:
            yield
        finally:
            ended.set()
            teller.join()
            for times, spent in (
                (self.seconds, time.monotonic() - begin),
                (self.processor, time.process_time() - worked),
            ):
                times[name] = round(times.get(name, 0.0) + spent, 3)

    def _tell(self, line: str, ended: threading.Event) -> None:
        """Say in a thread of its own how long a stage has run, when nothing else is."""
        begin = time.monotonic()
        while not ended.wait(self._said + _SILENCE_S - time.monotonic()):
            if time.monotonic() - self._said >= _SILENCE_S:
                self.say(f"  {line}: {time.monotonic() - begin:.0f} s so far")

    def say(self, line: str) -> None:
        """Report one line of progress."""
        self._said = time.monotonic()
        if self._report is not None:
            self._report(line)

    def say_in_time(self, line: str) -> None:
        """Report one line of progress, unless the time limit has passed."""
        self.check()
        self.say(line)

    @property
    def remaining(self) -> float | None:
        """What is left of the time limit [s], more than nothing; None: no limit."""
        left = self._limit - (time.monotonic() - self._begin)
        return max(left, 1e-9) if self.limited else None

    def check(self) -> None:
        """Raise TimeLimitError once the time limit has passed."""
        spent = time.monotonic() - self._begin
        if spent > self._deadline:
            raise TimeLimitError(
                f"the time limit came before a first plan was written, after "
                f"{spent:.1f} s; allow more (--time-limit)"
            )

    def reserve(self, seconds: float) -> None:
        """Keep so much of the time limit for writing what was planned."""
        self._deadline = self._limit - seconds

    def extend(self) -> None:
        """Give all of the time limit: what was planned is written."""
        self._deadline = self._limit

    def lift(self) -> None:
        """Let the rest run whatever the time: a plan is being saved."""
        self._deadline = math.inf


@contextmanager
def untimed() -> Generator[None]:
    """Let no time limit cut what is done within."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    _, every = signal.getitimer(signal.ITIMER_REAL)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, every, every)


def _runs(frame: FrameType | None, files: tuple[str, ...]) -> bool:
    """Whether code of these files runs, or is waited for."""
    while frame is not None:
        if frame.f_code.co_filename.endswith(files):
            return True
        frame = frame.f_back
    return False
