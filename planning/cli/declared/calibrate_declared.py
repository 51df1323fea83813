"""`plan calibrate`: its options."""

from pathlib import Path
from typing import Any

import click

from planning.cli.console import (
    PlanFile,
    Positive,
    output_options,
    run,
    threads_option,
)


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "--board",
    metavar="WxH",
    help="Width and height in mm between the outermost marks [default: a diagonal as "
    "long as the object is wide].",
)
@click.option(
    "--marks", default="12x9", metavar="MxN", help="Dots, or inner corners, on it."
)
@click.option(
    "--mark-px",
    type=Positive(),
    default=0.2,
    metavar="PX",
    help="Reprojection error of a mark that your calibration reaches.",
)
@click.option(
    "--accuracy",
    type=Positive(),
    metavar="MM",
    help="What 95 % of the points keep, calibration included [default: the plan's].",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Where poses go [default: calibration-images.json beside the plan].",
)
@threads_option
@output_options
def calibrate(**options: Any) -> None:  # noqa: ANN401
    """Plan the images of a board that calibrate a rig well enough for its plan."""
    from planning.cli.other_commands import calibrate_command

    run(lambda: calibrate_command(options), debug=options["debug"])
