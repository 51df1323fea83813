"""Progress on a terminal: one live line with stage, percent and time left."""

import time
from collections.abc import Generator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

from planning.model.progress import Report

# How a stage's line begins, and its share of a run in percent: of the sample, checked.
_STAGES = {
    "reading": 0,
    "curvature": 2,
    "projectors:": 10,
    "bounds over all poses of the workspace": 9,
    "projector poses": 5,
    "cameras:": 28,
    "baselines": 8,
    "rings": 9,
    "bounds over all poses of the cameras": 2,
    "coverage, recomputed": 6,
    "check": 21,
}
# Before that it is too early to say how long the rest takes [percent].
_EARLY = 10
_PAIR = "pixels: pair "
# What stays above the bar.
_TOLD = "written", "changed"


class LiveBar:
    """Shows lines of progress as one bar, and keeps above it what isn't progress.

    Args:
        console: Where it is shown.
    """

    def __init__(self, console: Console) -> None:
        self._progress = Progress(
            SpinnerColumn(),
            BarColumn(24),
            TextColumn("{task.percentage:>3.0f} %"),
            TextColumn("{task.description}", markup=False),
            console=console,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._task = self._progress.add_task("", total=100)
        self._begin, self._stage, self._done, self._share = time.monotonic(), "", 0, 0
        self._progress.start()

    def __call__(self, line: str) -> None:
        """Take a line of progress."""
        share = next((n for k, n in _STAGES.items() if line.startswith(k)), None)
        if share is not None:
            self._done = min(self._done + self._share, 99)
            self._share, self._stage = share, line
        elif line.startswith(_PAIR):
            self._pair(line)
            return
        elif self._stage.startswith("reading") or line.startswith(_TOLD):
            self._progress.console.print(f"plan: {line}", markup=False, highlight=False)
        self._show(self._done)

    def _pair(self, line: str) -> None:
        """Go on within the check, which counts its pairs of devices."""
        words = line.removeprefix(_PAIR).replace(",", "").split()
        k, n = int(words[0]), int(words[2])
        self._show(self._done + self._share * (k - 1) / n)

    def _show(self, done: float) -> None:
        words = self._stage
        if done >= _EARLY:
            spent = time.monotonic() - self._begin
            words += f", about {spent * (100 - done) / done:.0f} s left"
        self._progress.update(self._task, completed=done, description=words)

    def stop(self) -> None:
        """Take the bar away."""
        self._progress.stop()


@contextmanager
def live_bar(console: Console) -> Generator[Report]:
    """Show a bar, which is gone when this ends."""
    bar = LiveBar(console)
    try:
        yield bar
    finally:
        bar.stop()


@contextmanager
def shown(progress: Report | bool) -> Generator[Report | None]:
    """Give what receives lines of progress: a bar if it is True, None if False."""
    if not isinstance(progress, bool):
        yield progress
        return
    if not progress:
        yield None
        return
    with live_bar(Console()) as bar:
        yield bar
