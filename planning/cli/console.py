"""What the commands share: progress on stderr, and how many threads to use."""

import os

import click

from planning.model.progress import Report


def reporter(*, quiet: bool) -> Report | None:
    """Return what writes a line of progress to stderr; None if nothing shall."""
    return None if quiet else lambda line: click.echo(f"plan: {line}", err=True)


def cores() -> int:
    """Return the number of cores that this process may use; 2 where it isn't told."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2
