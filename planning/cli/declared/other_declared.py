"""`plan verify`, `accept`, `show`, `report`, `rigs` and others: their options."""

from pathlib import Path
from typing import Any

import click

from planning.cli.console import (
    PlanFile,
    debug_option,
    output_options,
    run,
    threads_option,
)

from .export_declared import check_rendering, rendering_options
from .plan_declared import rig_command

# What says which object and which rig there are.
_OF_OBJECTS = ("meshes", "files", "unit", "size_mm", "rig_name", "light")


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "--mesh",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Hold the plan's surface against this mesh; if it differs, render with it.",
)
@click.option(
    "--truth",
    type=PlanFile(),
    metavar="other-plan.json",
    help="Render with another plan's devices and surface: what really stands there.",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Of the audit [default: the plan's]."
)
@rendering_options
@threads_option
@output_options
def verify(**options: Any) -> None:  # noqa: ANN401
    """Recompute every claim from the files alone, then check from pixels."""
    check_rendering(options)
    from planning.cli.verify_command import verify_command

    run(lambda: verify_command(options), debug=options["debug"])


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "--draws",
    type=click.IntRange(0, 100_000),
    default=200,
    metavar="N",
    help="Rigs drawn from what the plan's calibration leaves.",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Of noise and rigs [default: the plan's]."
)
@threads_option
@output_options
def accept(**options: Any) -> None:  # noqa: ANN401
    """Measure spheres, ball bars and plates in the plan's volume, as a maker would.

    Simulated after VDI/VDE 2634 part 2: probing error (form and size), sphere spacing
    error and flatness, calibrated perfectly and with what the calibration leaves.
    """
    from planning.cli.accept_command import accept_command

    run(lambda: accept_command(options), debug=options["debug"])


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "--regions",
    is_flag=True,
    help="Instead: every dominant region, where it lies and what of it is reached, lit "
    "and measured.",
)
@threads_option
@output_options
def show(**options: Any) -> None:  # noqa: ANN401
    """Print what the summary leaves out: every place in the axes of the mesh, and of
    each camera mm per pixel, image filled, distances, triangulation angles.
    """  # noqa: D205 - click cuts the short help at a blank line
    from planning.cli.show_command import show_command

    run(lambda: show_command(options), debug=options["debug"])


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Where it goes [default: report.html beside the plan].",
)
@threads_option
@output_options
def report(**options: Any) -> None:  # noqa: ANN401
    """Write one HTML file that needs no network: the rig, why triangles aren't
    measured, tables, and a sheet for the wall.
    """  # noqa: D205 - click cuts the short help at a blank line
    from planning.cli.show_command import report_command

    run(lambda: report_command(options), debug=options["debug"])


@click.command(
    params=[p for p in rig_command.params if p.name in _OF_OBJECTS],
)
@debug_option
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def lens(**options: Any) -> None:  # noqa: ANN401
    """Say which lens, throw, f-number and focus suit an object, without planning."""
    from planning.cli.lens_command import lens_command

    meshes = (*options.pop("meshes"), *options.pop("files"))
    if len(meshes) != 1 or not meshes[0]:
        raise click.UsageError(f"give --mesh FILE, one; {len(meshes)} were given")
    if options["unit"] and options["size_mm"] is not None:
        raise click.UsageError("give --unit or --size-mm, not both")
    run(lambda: lens_command(options | {"mesh": meshes[0]}), debug=options["debug"])


@click.command()
@click.argument("action", type=click.Choice(["show", "new"]), required=False)
@click.argument("name", required=False)
@debug_option
def rigs(action: str | None, name: str | None, debug: bool) -> None:
    """List the rigs that need no file, with the source of every number.

    `plan rigs show NAME` prints one as the file that it is: to read, or to change.
    """
    from planning.cli.other_commands import rigs_command

    if action == "new":
        raise click.UsageError(
            "`plan rigs new` isn't built yet; change what `plan rigs show default` "
            "prints"
        )
    if (action is None) != (name is None):
        raise click.UsageError("`plan rigs show` needs the NAME of a rig")
    run(lambda: rigs_command(name), debug=debug)


@click.command()
@debug_option
def schema(debug: bool) -> None:
    """Print the JSON Schema of plan.json."""
    from planning.cli.other_commands import schema_command

    run(schema_command, debug=debug)


@click.command()
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default="face.obj",
    metavar="FILE",
    help="Where it goes.",
)
@click.option(
    "--faces",
    type=click.IntRange(500, 2_000_000),
    default=40_000,
    metavar="N",
    help="Triangles of the closed head, about; the neck is then cut open.",
)
@click.option(
    "--variant",
    type=click.IntRange(0),
    metavar="SEED",
    help="Another head of the population [default: the mean head].",
)
@debug_option
def sample(output: Path, faces: int, variant: int | None, debug: bool) -> None:
    """Write the sample head, an OBJ file in millimetres."""
    from planning.cli.other_commands import sample_command

    run(lambda: sample_command(output, faces, variant), debug=debug)
