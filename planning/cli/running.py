"""Runs a command; errors become one line and the documented exit code."""

import os
import signal
import sys
from collections.abc import Callable
from typing import NoReturn

import click

# As in sysexits.h: a bug of ours, nothing that the user did.
_INTERNAL = 70


def run(command: Callable[[], int], *, debug: bool) -> None:
    """Run a command; turn our own errors into one line and the documented exit code."""
    from geometry.mesh.mesh import MeshError
    from planning.model.errors import PlanningError

    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.exit(command())
    except KeyboardInterrupt:
        stop("interrupted before a first plan stood; nothing was written", 130)
    except BrokenPipeError:
        # Whoever reads stdout has had enough; Python must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except (PlanningError, MeshError, OSError) as error:
        if debug:
            raise
        stop(str(error), 2 if isinstance(error, OSError) else _exit_code(error))
    except Exception as error:
        if debug or isinstance(error, click.ClickException):
            raise
        name = type(error).__name__
        stop(
            f"internal error ({name}: {error}); this is a bug: run again with --debug "
            f"and report it",
            _INTERNAL,
        )


def _exit_code(error: Exception) -> int:
    return int(getattr(error, "exit_code", 3))


def stop(message: str, code: int) -> NoReturn:
    """Write one line to stderr and leave with an exit code."""
    click.echo(f"plan: {' '.join(message.split())}", err=True)
    sys.exit(code)
