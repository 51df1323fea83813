"""`--pareto` and `--take`: the front, and a point of it that is planned."""

from collections.abc import Callable
from typing import Any

import click

_Command = Callable[..., Any]


class _Point(click.ParamType[tuple[int, int]]):
    """Numbers of projectors and cameras, P,C."""

    name = "point"

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return both numbers, or fail as usage."""
        words = [word.strip() for word in str(value).split(",")]
        counts = [int(w) for w in words if w.isascii() and w.isdigit()]
        if len(words) != 2 or len(counts) != 2 or not all(counts):
            self.fail(
                f"{value!r} must be P,C, numbers of projectors and cameras from 1, "
                f"as 3,4",
                param,
                ctx,
            )
        return counts[0], counts[1]


def front_options(command: _Command) -> _Command:
    """Declare the front and what is taken of it."""
    pareto = click.option(
        "--pareto",
        is_flag=True,
        help="Instead of one plan: what each number of projectors and cameras gives, "
        "up to --max-projectors and --max-cameras or to where all that can be is "
        "covered; of one visibility matrix, not checked.",
    )
    take = click.option(
        "--take",
        type=_Point(),
        metavar="P,C",
        help="Plan the point of P projectors and C cameras of the front that -o keeps "
        "[default: ./NAME-front], without its matrix again.",
    )
    return pareto(take(command))


def check_front_options(options: dict[str, Any]) -> None:
    """Refuse what a front, or a point of it, isn't made with.

    Raises:
        click.UsageError: It names both.
    """
    pareto, take = options["pareto"], options["take"]
    if pareto and take is not None:
        raise click.UsageError("give --pareto or --take, not both: first the front")
    asked = "--pareto" if pareto else "--take"
    if (n := len(options["meshes"])) > 1:
        raise click.UsageError(f"{asked} is of one mesh, and there are {n}: give one")
    if options["watch"] is not None:
        raise click.UsageError(
            f"{asked} with --watch: a front is of one rig; give --rig instead"
        )
    counts = ("max_heads",) if pareto else ("max_projectors", "max_cameras")
    for name in ("max_heads", *counts):
        if options[name] is not None:
            raise click.UsageError(
                f"{asked} with --{name.replace('_', '-')}: "
                + (
                    "a front is of single devices"
                    if name == "max_heads"
                    else "the point says how many"
                )
                + "; leave one of them out"
            )
    if options["cameras_by"] == "paper":
        raise click.UsageError(
            f"{asked} with --cameras-by paper: the paper's route has no rig of fewer "
            f"cameras; leave one of them out"
        )
    if pareto and options["max_projectors"] == 0:
        raise click.UsageError("--max-projectors 0 with --pareto: give 1 or more")
