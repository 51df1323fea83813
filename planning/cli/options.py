"""Options that several commands share, and the types of their values."""

import math
from collections.abc import Callable
from typing import Any

import click

_Command = Callable[..., Any]

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


class Positive(click.FloatRange):
    """A positive number, perhaps with a largest; NaN and infinity are none."""

    def __init__(self, largest: float | None = None) -> None:
        super().__init__(0.0, largest, min_open=True)

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return the number, or fail as usage."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} isn't a finite number.", param, ctx)
        return number
