"""`plan verify`: its options."""

from pathlib import Path
from typing import Any

import click

from planning.cli.options import output_options, threads_option
from planning.cli.running import run


@click.command()
@click.argument("plan_file", type=click.Path(path_type=Path), metavar="DIR/plan.json")
@click.option(
    "--mesh",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Hold the plan's surface against this mesh; if it differs, render with it.",
)
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    metavar="other-plan.json",
    help="Render with another plan's devices and surface: what really stands there.",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Of the audit [default: the plan's]."
)
@threads_option
@output_options
def verify(**options: Any) -> None:  # noqa: ANN401
    """Recompute every claim from the files alone, then check from pixels."""
    from planning.cli.verify_command import verify_command

    run(lambda: verify_command(options), debug=options["debug"])
