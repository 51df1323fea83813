"""`plan verify`, `accept`, `show`, `report`, `cache` and `sample`: their options."""

from collections.abc import Callable
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

# Of `plan show`, as `planning.report.summary.sections` has them, which takes longer to
# import than `plan show --help` may.
_SECTIONS = {
    "places": "Object, zones and devices in the axes of the mesh.",
    "stations": "Heads, their stations, or steps of a turntable, with their devices.",
    "cameras": "Of each camera mm per pixel, image filled, distances, angles.",
    "family": "Members of a family, what each gets, and what bounds their rig.",
    "coverage": "Areas that are lit and measured, and what is left out.",
    "proofs": "What was proved of the numbers of devices.",
    "marginal": "What one device more or fewer would change.",
    "regions": "Every region, where it lies, what of it is measured.",
    "rings": "How circles are spaced, and what becomes of them.",
    "check": "The reconstruction from pixels.",
    "cost": "How long a scan takes; eq. (8).",
    "all": "All of these.",
}


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
@click.option(
    "--strict",
    is_flag=True,
    help="Exit 1 if anything is taken on trust, too: what that is, is always told.",
)
@click.option(
    "--replan",
    is_flag=True,
    help="Plan again from the words of the plan's command, and hold every figure to "
    "the last digit; as long as planning took.",
)
@click.option(
    "--rig",
    metavar="NAME|FILE",
    help="With --replan, the rig in place of the command's.",
)
@click.option(
    "--proofs",
    is_flag=True,
    help="Derive the bounds over all poses again, too, which may take minutes.",
)
@rendering_options
@threads_option
@output_options
def verify(**options: Any) -> None:  # noqa: ANN401
    """Recompute every claim from the files alone, then check from pixels."""
    check_rendering(options)
    if options["rig"] is not None and not options["replan"]:
        raise click.UsageError("--rig is what --replan plans with: give both")
    from planning.cli.checks.verify_command import verify_command

    from .asked_again import asked_again

    run(lambda: verify_command(options, asked_again), debug=options["debug"])


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
    from planning.cli.checks.accept_command import accept_command

    run(lambda: accept_command(options), debug=options["debug"])


def section_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add an option for each section of `plan show`."""
    for name, says in reversed(_SECTIONS.items()):
        command = click.option(f"--{name}", is_flag=True, help=says)(command)
    return command


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@section_options
@threads_option
@output_options
def show(**options: Any) -> None:  # noqa: ANN401
    """Print what the summary leaves out: places and cameras, or sections by name.

    Without an option: every place in the axes of the mesh, and of each camera mm per
    pixel, image filled, distances, triangulation angles.
    """
    from planning.cli.show_command import show_command

    run(lambda: show_command(options), debug=options["debug"])


@click.command()
@click.argument("first", type=PlanFile(), metavar="A[/plan.json]")
@click.argument("second", type=PlanFile(), metavar="B[/plan.json]")
@output_options
def compare(**options: Any) -> None:  # noqa: ANN401
    """Tell two plans side by side; what differs is marked.

    What was asked, what stands, what is proved of fewer, what is measured and what the
    check found, each as the plan says: `plan verify` holds it true.
    """
    from planning.cli.show_command import compare_command

    run(lambda: compare_command(options), debug=options["debug"])


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Where it goes, by itself [default: report.html beside the plan, and beside "
    "each member's].",
)
@threads_option
@output_options
def report(**options: Any) -> None:  # noqa: ANN401
    """Write one HTML file that needs no network: the rig, why triangles aren't
    measured, tables, and a sheet for the wall.
    """  # noqa: D205 - click cuts the short help at a blank line
    from planning.cli.show_command import report_command

    run(lambda: report_command(options), debug=options["debug"])


@click.command()
@click.argument("clear", type=click.Choice(["clear"]), required=False)
@debug_option
def cache(clear: str | None, debug: bool) -> None:
    """Say where earlier runs left what later ones use, and its size; or clear it."""
    from planning.cli.other_commands import cache_command

    run(lambda: cache_command(clear=clear is not None), debug=debug)


@click.command()
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE|DIR",
    help="Where it goes [default: face.obj; of a family ./heads].",
)
@click.option(
    "--family",
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Instead, so many heads from child to adult, in a folder.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    metavar="S",
    default=0,
    help="Of the family's draws.",
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
def sample(
    output: Path | None,
    family: int | None,
    seed: int,
    faces: int,
    variant: int | None,
    debug: bool,
) -> None:
    """Write the sample head, an OBJ file in millimetres, or a family of heads."""
    from planning.cli.other_commands import sample_command, sample_family_command

    if family is None:
        head = output or Path("face.obj")
        run(lambda: sample_command(head, faces, variant), debug=debug)
        return
    if variant is not None:
        raise click.UsageError("give --family or --variant, not both")
    folder = output or Path("heads")
    run(lambda: sample_family_command(folder, faces, family, seed), debug=debug)
