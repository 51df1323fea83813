"""`plan evaluate --mesh FILE --poses FILE`: its options, most of them the planner's."""

import sys
from typing import Any

import click

from planning.cli.console import run

from .plan_declared import check_options, rig_command

# What devices that stand don't take: there is nothing to seek, and no body of ranges.
_OF_PLANS = {"ranges", "max_projectors", "max_cameras", "prove", "cameras_by", "fixed"}


@click.command(params=[p for p in rig_command.params if p.name not in _OF_PLANS])
@click.option(
    "--poses",
    required=True,
    metavar="mounted.csv|plan.json",
    help="Where the devices stand: a CSV file with name, kind, x_mm, y_mm, z_mm and an "
    "aim, angles or a quaternion, or the plan whose devices and rings are kept.",
)
def evaluate(**options: Any) -> None:  # noqa: ANN401
    """Say what a rig measures as it stands; nothing is sought, moved or proved.

    Writes a folder like that of a plan, NAME-evaluation: coverage, causes, rings and
    the check from pixels. Exit 1 where a requirement is missed.
    """
    from planning.cli.plan_command import plan_command

    if not options["meshes"]:
        raise click.UsageError("give --mesh FILE")
    options |= dict.fromkeys(_OF_PLANS)
    check_options(options)
    run(lambda: plan_command(options, sys.argv[1:]), debug=options["debug"])
