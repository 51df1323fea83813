"""`plan evaluate --mesh FILE --poses FILE`: its options, most of them the planner's."""

import sys
from pathlib import Path
from typing import Any

import click

from planning.cli.console import run

from .plan_declared import GroupedCommand, check_options, rig_command

# What a rig that stands doesn't take: nothing is sought, and the mesh is known. As if
# they weren't given; `--poses` is what `--fixed` is to a plan.
_OF_PLANS = {
    "align": "given",
    "family_quantile": 1.0,
    "ranges": None,
    "max_projectors": None,
    "max_heads": None,
    "max_cameras": None,
    "fixed": None,
    "robust": None,
    "prove": False,
    "cameras_by": "both",
    "watch": None,
    "pareto": False,
    "take": None,
}


@click.command(
    cls=GroupedCommand,
    params=[p for p in rig_command.params if p.name not in {*_OF_PLANS, "output"}],
)
@click.option(
    "--poses",
    required=True,
    metavar="mounted.csv|plan.json",
    help="Where the devices stand: a CSV file with name, kind, x_mm, y_mm, z_mm and an "
    "aim, angles or a quaternion; or a plan, whose rings are kept, too.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Output folder [default: ./NAME-evaluation].",
)
def evaluate(**options: Any) -> None:  # noqa: ANN401
    """Say what a rig measures as it stands; nothing is sought, moved or proved.

    Writes a folder like that of a plan, NAME-evaluation: coverage, causes, rings and
    the check from pixels. Exit 1 where a requirement is missed.
    """
    from planning.cli.plans.plan_command import plan_command

    as_of_plans(options)
    run(lambda: plan_command(options, sys.argv[1:]), debug=options["debug"])


def as_of_plans(options: dict[str, Any]) -> None:
    """Add what `plan` has besides, as if it weren't given, and check all.

    Raises:
        click.UsageError: If options exclude each other.
    """
    if not options["meshes"] + options["files"]:
        raise click.UsageError("give --mesh FILE")
    options |= _OF_PLANS | {"fixed": options["poses"]}
    check_options(options)
