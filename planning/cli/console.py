"""What the commands share: options, progress, output, and how errors end a run.

Imported by `plan --help`, so nothing heavy is.
"""

import json
import math
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn, cast

import click

from planning.model.progress import Report
from planning.model.words import percent_as_share, printable

_Command = Callable[..., Any]
# As in sysexits.h: a bug of ours, nothing that the user did.
_INTERNAL = 70
_INTERRUPTED = 130
_STOPS = (signal.SIGINT, signal.SIGTERM)

debug_option = click.option(
    "--debug", is_flag=True, help="Tracebacks instead of one-line errors."
)
threads_option = click.option(
    "--threads",
    type=click.IntRange(1),
    metavar="N",
    help="Worker threads; no result depends on it [default: all cores].",
)


def output_options(command: _Command) -> _Command:
    """Add what every command that computes says of its output."""
    for option in (
        debug_option,
        click.option("--quiet", is_flag=True, help="No progress on stderr."),
        click.option(
            "--json", "as_json", is_flag=True, help="One JSON object on stdout."
        ),
    ):
        command = option(command)
    return command


class Finite(click.FloatRange):
    """A number in a range; NaN and infinity are none."""

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return the number, or fail as usage."""
        try:
            value = float(value)
        except ValueError:
            self.fail(f"{value!r} isn't a number.", param, ctx)
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} isn't a finite number.", param, ctx)
        return number


class Positive(Finite):
    """A positive number."""

    def __init__(self) -> None:
        super().__init__(0.0, min_open=True)


class Share(Finite):
    """A share over 0 and at most 1, in percent if it says so: 0.95, 95% or "95 %"."""

    def __init__(self, *, or_none: bool = False) -> None:
        super().__init__(0.0, 1.0, min_open=not or_none)

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return the share, or fail as usage."""
        share = value
        with suppress(ValueError):
            share = percent_as_share(value)
            if share is value and 1.0 < float(value) <= 100.0:
                self.fail(f"{value} is over 1; did you mean {value}%?", param, ctx)
        return super().convert(share, param, ctx)


class PlanFile(click.Path):
    """A plan file; of a folder the plan.json in it."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return the path of the file, whether or not there is one."""
        path = cast(Path, super().convert(value, param, ctx))
        # os.path answers for names that the system refuses; Path raises.
        return path / "plan.json" if os.path.isdir(path) else path


def signed_limits(
    context: click.Context, option: click.Parameter, value: str | None
) -> tuple[float, float] | None:
    """Read LOW,HIGH about zero, or one number for both sides: in mm, returned in m."""
    if value is None:
        return None
    try:
        numbers = [float(word) for word in value.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 1:
        numbers = [-numbers[0], numbers[0]]
    finite = all(math.isfinite(number) for number in numbers)
    if len(numbers) != 2 or not finite or not numbers[0] < 0.0 < numbers[1]:
        raise click.BadParameter(
            f"{value!r} must be a lower and an upper limit in mm about zero, as "
            f"-0.2,0.5, or one positive number for both sides"
        )
    return 1e-3 * numbers[0], 1e-3 * numbers[1]


def panel_size(
    context: click.Context, option: click.Parameter, value: str | None
) -> tuple[int, int] | None:
    """Read WIDTHxHEIGHT in pixels."""
    if value is None:
        return None
    sides = value.lower().split("x")
    if len(sides) != 2 or not all(
        side.isascii() and side.isdigit() and 2 <= int(side) <= 16384 for side in sides
    ):
        raise click.BadParameter(
            f"{value!r} must be width and height in pixels, 2 to 16384, as 1024x768"
        )
    return int(sides[0]), int(sides[1])


def given(options: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return those of some options that have a value."""
    return {name: options[name] for name in names if options[name] is not None}


def reporter(*, quiet: bool) -> Report:
    """Return what writes a line of progress to stderr, or nothing."""

    def report(line: str) -> None:
        if not quiet:
            click.echo(f"plan: {printable(line)}", err=True)

    return report


def shows_bar(*, quiet: bool) -> bool:
    """Return whether progress is shown as a bar: on a terminal."""
    return not quiet and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


@contextmanager
def progress(*, quiet: bool) -> Generator[Report]:
    """Give what shows progress on stderr: a bar on a terminal, else lines.

    A bar is gone when this ends, so that results stand alone.
    """
    if not shows_bar(quiet=quiet):
        yield reporter(quiet=quiet)
        return
    from rich.console import Console

    from planning.report.live_bar import live_bar

    with live_bar(Console(stderr=True)) as bar:
        yield bar


def print_json(document: Mapping[str, Any]) -> None:
    """Write one JSON object to stdout."""
    click.echo(json.dumps(document, indent=1, allow_nan=False))


@contextmanager
def writable(folder: Path, *names: str) -> Generator[None]:
    """Fail before the work, not after it; leave no empty folder where it fails.

    Args:
        folder: Where files go.
        names: Of files that will be there.

    Raises:
        click.UsageError: If nothing can be written into the folder, or a folder has
            one of these names.
    """
    try:
        missing = [f for f in (folder, *folder.parents) if not f.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise click.UsageError(
            f"can't write to {folder}: {error.strerror}; choose another folder with -o"
        ) from None
    for path in (folder / name for name in names):
        if path.is_dir():
            raise click.UsageError(
                f"{path} is a folder, and a file is to be there; move it, or choose "
                f"another folder with -o"
            )
    try:
        yield
    except BaseException:
        for made in missing:
            with suppress(OSError):
                made.rmdir()
        raise


@contextmanager
def writable_file(path: Path) -> Generator[None]:
    """Fail before the work where `-o` names no file that can be written.

    Raises:
        click.UsageError: If it is a folder, or nothing can be written into its own.
    """
    if os.path.isdir(path):
        raise click.UsageError(f"{path} is a folder; give a file's name with -o")
    with writable(path.parent):
        yield


@contextmanager
def stop_signals(handler: Callable[[int, Any], Any]) -> Generator[None]:
    """Handle Ctrl-C and SIGTERM in another way meanwhile."""
    before = [signal.signal(number, handler) for number in _STOPS]
    try:
        yield
    finally:
        for number, handled in zip(_STOPS, before, strict=True):
            signal.signal(number, handled)


def run(command: Callable[[], int], *, debug: bool) -> None:
    """Run a command; turn our own errors into one line and the documented exit code."""
    from geometry.mesh.mesh import MeshError
    from geometry.parallel import abandoned
    from planning.model.errors import PlanningError, TimeLimitError

    try:
        for number in _STOPS:
            signal.signal(number, signal.default_int_handler)
        code = command()
        if code == _INTERRUPTED or abandoned():
            leave(code)
        sys.exit(code)
    except KeyboardInterrupt as interrupt:
        nothing = "interrupted before there was anything to keep; nothing was written"
        tell(str(interrupt) or nothing)
        leave(_INTERRUPTED)
    except BrokenPipeError:
        # Whoever reads stdout has had enough; Python must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except (PlanningError, MeshError, OSError) as error:
        if debug:
            raise
        if isinstance(error, TimeLimitError):
            tell(str(error))
            leave(error.exit_code)
        code = 2 if isinstance(error, OSError) else getattr(error, "exit_code", 3)
        stop(str(error), code)
    except Exception as error:
        if debug or isinstance(error, click.ClickException):
            raise
        name = type(error).__name__
        stop(
            f"internal error ({name}: {error}); this is a bug: run again with --debug "
            f"and report it",
            _INTERNAL,
        )


def stop(message: str, code: int) -> NoReturn:
    """Write a line to stderr for each line of a message; leave with an exit code."""
    tell(message)
    sys.exit(code)


def leave(code: int) -> NoReturn:
    """End the process where work was cut: no thread of it is waited for."""
    with suppress(BrokenPipeError):
        sys.stdout.flush()
    os._exit(code)


def tell(message: str) -> None:
    """Write a line to stderr for each line of a message."""
    for line in message.splitlines():
        click.echo(f"plan: {printable(' '.join(line.split()))}", err=True)
