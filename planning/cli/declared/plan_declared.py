"""`plan --mesh FILE --max-projectors N`: its options, and which exclude each other."""

import sys
from pathlib import Path
from typing import Any

import click

from planning.cli.console import (
    Finite,
    Positive,
    Share,
    output_options,
    run,
    threads_option,
)

from .front_options import check_front_options, front_options
from .plan_checks import check_options, check_projectors, check_watch
from .survival_options import survival_options

# What `plan --help` puts together; an option of none of these is told last.
_GROUPS = {
    "What is measured": (
        *("meshes", "align", "family_quantile", "ranges", "unit", "size_mm", "up"),
        *("target", "select", "weight"),
    ),
    "With what, and where": (
        *("max_projectors", "max_cameras", "max_heads"),
        *("rig_name", "watch", "light", "pattern"),
        *("ring_axis", "fixed", "poses"),
    ),
    "How well": (
        *("dominant_coverage", "coverage", "min_reachable", "region_coverage"),
        *("accuracy_mm", "accuracy_of", "robust", "views", "survive"),
    ),
    "How it is sought": (
        *("pareto", "take", "cameras_by", "joint", "prove"),
        *("seed", "time_limit", "threads", "no_check", "no_cache"),
    ),
    "Output": (
        *("output", "no_patterns", "no_report"),
        *("verbose", "as_json", "quiet", "debug"),
    ),
}
# As `planning.steps.refused` has it, which is heavy to import.
_MOST = 1_000_000
_EXAMPLES = (
    "plan --mesh part.stl --max-projectors 4 --target surface --coverage 98%",
    "plan --mesh part.stl --max-projectors 4 --rig bench.toml --accuracy 0.1 -o out",
)


class GroupedCommand(click.Command):
    """A command whose help puts options together by what they are about."""

    def format_options(
        self, ctx: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the groups, each with its options, then examples."""
        rows = {
            param.name: row
            for param in self.get_params(ctx)
            if (row := param.get_help_record(ctx)) is not None
        }
        for title, names in _GROUPS.items():
            told = [rows.pop(name) for name in names if name in rows]
            if told:
                with formatter.section(title):
                    formatter.write_dl(told)
        if rows:
            with formatter.section("Others"):
                formatter.write_dl(list(rows.values()))
        if self.name == "rig":
            with formatter.section("Examples"):
                for line in _EXAMPLES:
                    formatter.write_text(line)


@click.command("rig", cls=GroupedCommand)
@click.argument("files", nargs=-1, metavar="[FILE]")
@click.option(
    "--mesh",
    "meshes",
    multiple=True,
    type=click.Path(),
    metavar="FILE",
    help="Surface to measure: OBJ, PLY, STL, OFF, GLB, 3MF; .gz, .bz2, .zip too. "
    "Several times, a folder or a pattern: one rig for all of them.",
)
@click.option(
    "--align",
    type=click.Choice(["given", "axes", "icp"]),
    default="given",
    help="Lay several meshes over the first: as they are, by principal axes, or by ICP "
    "[default: given].",
)
@click.option(
    "--family-quantile",
    type=Share(),
    metavar="F",
    default="1.0",
    help="Share of several meshes that the rig must serve [default: 1].",
)
@click.option(
    "--ranges",
    metavar="FILE.csv",
    help="Instead of --mesh: a few points of the object, as seen or measured from "
    "trial views; plans for the least-squares body.",
)
@click.option(
    "--max-projectors",
    type=click.IntRange(0, _MOST),
    metavar="N",
    help="Projectors at most; needed unless --max-heads, --pareto or --pattern none is "
    "given.",
)
@click.option(
    "--max-cameras",
    type=click.IntRange(1, _MOST),
    metavar="N",
    help="Cameras at most [default: as many as needed].",
)
@click.option(
    "--max-heads",
    type=click.IntRange(1, _MOST),
    metavar="N",
    help="Of a rig with a [head]: heads at most, or its [stations].",
)
@click.option(
    "--unit",
    type=click.Choice(["mm", "cm", "m", "in", "um"]),
    help="Unit of a file that states none [default: mm].",
)
@click.option(
    "--size-mm",
    type=Positive(),
    metavar="S",
    help="Instead of --unit: longest side of the bounding box.",
)
@click.option(
    "--up",
    type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
    help="Axis that points up [default: z].",
)
@click.option(
    "--rig",
    "rig_name",
    default="default",
    metavar="NAME|rig.toml",
    help="Devices and limits.",
)
@click.option(
    "--watch",
    metavar="rig.toml",
    help="Instead of --rig: plan, and plan again whenever this file or the mesh is "
    "saved, telling what changed, until Ctrl-C.",
)
@click.option(
    "--light",
    type=click.Choice(["diverging", "parallel"]),
    help="A real projector, or the paper's collimated light [default: the rig's].",
)
@click.option(
    "--pattern",
    type=click.Choice(["rings", "dense", "none"]),
    help="Rings, a code of every pixel (see [dense] of the rig file), or none: cameras "
    "alone, by the object's texture [default: rings; of a head or a turntable dense].",
)
@click.option(
    "--ring-axis",
    type=click.Choice(["centred", "free", "auto"]),
    help="Circles about the middle of what a projector lights, about axes where errors "
    "are smallest, or the first where they take no more cameras [default: the rig's].",
)
@click.option(
    "--target",
    type=click.Choice(["dominant", "surface", "outside"]),
    help="What must be covered: what bends most, all, or all but what lies inside the "
    "body [default: dominant; with --ranges surface].",
)
@click.option(
    "--select",
    metavar="FILE|ply:NAME",
    help="Cover these faces instead: indices from 0, or a PLY property that isn't 0.",
)
@click.option(
    "--weight",
    metavar="FILE|ply:NAME",
    help="Cover the fifth of the area of highest weight: a number for each vertex.",
)
@click.option(
    "--dominant-coverage",
    type=Share(),
    metavar="F",
    help="Lit share of the reachable target [default: 0.90].",
)
@click.option(
    "--coverage",
    type=Share(),
    metavar="F",
    help="Measured share of the reachable target [default: 0.95].",
)
@click.option(
    "--min-reachable",
    type=Share(),
    metavar="F",
    help="Share of the target that must be reachable [default: 0.90].",
)
@click.option(
    "--region-coverage",
    type=Share(or_none=True),
    metavar="F",
    help="Floor of every dominant region: lit and measured share of what is reachable "
    "of it; 0: none [default: 0.50].",
)
@click.option(
    "--accuracy",
    "accuracy_mm",
    type=Finite(0.0, 1e9, min_open=True),
    metavar="MM",
    help="Largest standard deviation along the normal [default: 0.3].",
)
@click.option(
    "--accuracy-of",
    type=click.Choice(["total", "noise"]),
    default="total",
    help="What --accuracy limits: with what the rig's [calibration] leaves, or noise "
    "alone.",
)
@click.option(
    "--robust",
    type=Share(),
    metavar="Q",
    help="Tighten the requirements until this share of drawn rigs meets them, mounted "
    "and calibrated as the rig's [mounting] and [calibration] say [default: none].",
)
@survival_options
@front_options
@click.option(
    "--cameras-by",
    type=click.Choice(["cover", "paper", "both"]),
    default="both",
    help="Fewest of the candidates, the paper's largest baselines, or what is better.",
)
@click.option(
    "--fixed",
    metavar="plan.json[:P1,C1]",
    help="Keep these devices of an earlier plan, or of a CSV file of poses, and plan "
    "the rest; they count.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Output folder [default: ./NAME-plan].",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    metavar="N",
    default=0,
    help="Of every random draw.",
)
@click.option(
    "--time-limit",
    type=Positive(),
    metavar="S",
    help="Cut the run after S seconds; the plan is marked truncated.",
)
@threads_option
@click.option("--prove", is_flag=True, help="Spend more work on the continuous bounds.")
@click.option("--no-check", is_flag=True, help="Skip the check from pixels.")
@click.option(
    "--no-cache",
    is_flag=True,
    help="Compute all anew; else what an earlier run left is used (`plan cache`).",
)
@click.option("--no-patterns", is_flag=True, help="Write no pattern images.")
@click.option(
    "--verbose",
    is_flag=True,
    help="Print all that `plan show --all` does, and not the most important lines.",
)
@click.option("--no-report", is_flag=True, help="Write no report.html.")
@output_options
def rig_command(**options: Any) -> None:  # noqa: ANN401
    """Plan a rig for a mesh, or for ranges (the default command)."""
    from planning.cli.plans.front_command import front_command
    from planning.cli.plans.plan_command import plan_command

    check_options(options)
    if options["pareto"] or options["take"] is not None:
        check_front_options(options)
    else:
        check_projectors(options)
    if options["pareto"]:
        run(lambda: front_command(options), debug=options["debug"])
    if options["watch"] is not None:
        check_watch(options)
        from planning.cli.plans.watch_command import watch_command as plan_command
    run(lambda: plan_command(options, sys.argv[1:]), debug=options["debug"])
