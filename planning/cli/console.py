"""What the commands share: progress on stderr, JSON on stdout, how many threads."""

import json
import os
from collections.abc import Mapping
from typing import Any

import click

from planning.model.progress import Report


def reporter(*, quiet: bool) -> Report | None:
    """Return what writes a line of progress to stderr; None if nothing shall."""
    return None if quiet else lambda line: click.echo(f"plan: {line}", err=True)


def cores() -> int:
    """Return the number of cores that this process may use; 2 where it isn't told."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2


def print_json(document: Mapping[str, Any]) -> None:
    """Write one JSON object to stdout."""
    click.echo(json.dumps(document, indent=1, allow_nan=False))
