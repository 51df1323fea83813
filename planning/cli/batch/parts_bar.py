"""Progress of a batch: on a terminal a bar with what runs, else lines alone."""

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager

from planning.cli.console import reporter, shows_bar
from planning.model.progress import Report

# Takes how many parts ended, and the names of those that run.
Show = Callable[[int, Sequence[str]], None]

# Parts that run and are named.
_NAMED = 3


@contextmanager
def parts_progress(n_parts: int, *, quiet: bool) -> Generator[tuple[Report, Show]]:
    """Give what writes a line to stderr, and what shows how far the batch is.

    A bar is gone when this ends; lines stay above it.
    """
    if not shows_bar(quiet=quiet):
        yield reporter(quiet=quiet), lambda ended, running: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        SpinnerColumn,
        TextColumn,
    )

    bar = Progress(
        SpinnerColumn(),
        BarColumn(24),
        MofNCompleteColumn(),
        TextColumn("{task.description}", markup=False),
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    task = bar.add_task("", total=n_parts)

    def report(line: str) -> None:
        bar.console.print(f"plan: {line}", markup=False, highlight=False)

    def show(ended: int, running: Sequence[str]) -> None:
        words = _words(running)
        bar.update(task, completed=ended, description=words, refresh=True)

    with bar:
        yield report, show


def _words(running: Sequence[str]) -> str:
    words = ", ".join(running[:_NAMED])
    more = len(running) - _NAMED
    return f"{words} and {more} more" if more > 0 else words
