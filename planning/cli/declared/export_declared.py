"""`plan export`, and what it shares with a check by Mitsuba: what the object is of."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from planning.cli.console import Finite, PlanFile, output_options, run

MITSUBA = "mitsuba"
# As `planning.handover.export.export_formats` has them, which is heavy to import.
FORMATS = (
    *("opencv", "colmap", "gltf", "blender", "ros", "usd", "csv"),
    *("step", "drawing", "aim", MITSUBA),
)
_ALL = "all"
_OF_SURFACE = ("albedo", "texture", "ambient")
_OF_MITSUBA = ("material", *_OF_SURFACE, "gamma", "vignetting", "bounces", "spp")
_Command = Callable[..., Any]


def surface_options(command: _Command) -> _Command:
    """Add how much light the object reflects, and how much the room gives."""
    for option in (
        click.option(
            "--ambient",
            type=Finite(0.0, 10.0),
            metavar="A",
            help="Mitsuba: room light as a share of the projector's [default: what the "
            "plan's check assumes].",
        ),
        click.option(
            "--texture",
            type=Finite(0.0, 0.9),
            metavar="T",
            help="Mitsuba: amplitude of a solid texture, as a share of the albedo "
            "[default: 0.2].",
        ),
        click.option(
            "--albedo",
            type=Finite(0.01, 0.99),
            metavar="A",
            help="Mitsuba: share of the light that the object gives back [default: "
            "0.5].",
        ),
    ):
        command = option(command)
    return command


def rendering_options(command: _Command) -> _Command:
    """Add which renderer makes the images, and what Mitsuba is to simulate."""
    for option in (
        click.option(
            "--spp",
            type=click.IntRange(1, 65536),
            metavar="N",
            help="Mitsuba: paths a pixel in each frame [default: 48].",
        ),
        click.option(
            "--bounces",
            type=click.IntRange(0, 64),
            metavar="N",
            help="Mitsuba: times that light may go from surface to surface [default: "
            "2].",
        ),
        click.option(
            "--vignetting",
            type=Finite(0.0, 0.99),
            metavar="V",
            help="Mitsuba: share of the light that is lost in the corners of an image "
            "[default: 0].",
        ),
        click.option(
            "--gamma",
            type=Finite(0.1, 10.0),
            metavar="G",
            help="Mitsuba: of the cameras, which report x^(1/G) [default: 1, linear].",
        ),
        surface_options,
        click.option(
            "--material",
            type=click.Choice(["matt", "gloss", "metal", "skin"]),
            help="Mitsuba: what the object is of [default: matt].",
        ),
        click.option(
            "--renderer",
            type=click.Choice(["builtin", "mitsuba"]),
            default="builtin",
            help="What makes the images; mitsuba: a path tracer that isn't ours, `pip "
            "install 'ringrig[render]'`.",
        ),
    ):
        command = option(command)
    return command


def check_rendering(options: dict[str, Any]) -> None:
    """Refuse what only Mitsuba simulates where it doesn't render.

    Raises:
        click.UsageError: With the first such option.
    """
    given = [name for name in _OF_MITSUBA if options[name] is not None]
    if given and options["renderer"] != "mitsuba":
        raise click.UsageError(f"--{given[0]} goes with --renderer mitsuba")


class _Formats(click.ParamType[tuple[str, ...]]):
    """Formats between commas, or all of them."""

    name = "formats"

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[str, ...]:
        """Return their names, or fail as usage."""
        names = tuple(name.strip() for name in str(value).split(","))
        for name in names:
            if name not in (*FORMATS, _ALL):
                self.fail(f"{name!r} is none of {', '.join((*FORMATS, _ALL))}.")
        return FORMATS if _ALL in names else names


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "--to",
    "targets",
    required=True,
    multiple=True,
    type=_Formats(),
    metavar="FORMAT[,...]",
    help=f"{', '.join(FORMATS)}; several at once, or {_ALL}.",
)
@click.option(
    "--frame",
    metavar="X,Y,Z[,AZ,TILT,ROLL]",
    help="Another origin, in mm and degrees of the mesh's axes; or `floor` (under the "
    "object's centre), or a mounting plane's name [default: the mesh's].",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Each format gets a folder of its name in there [default: `export` beside the "
    "plan]. mitsuba by itself goes into DIR [default: `mitsuba` beside the plan].",
)
@surface_options
@output_options
def export(**options: Any) -> None:  # noqa: ANN401
    """Write a rig for other programs, a builder and a workshop.

    Exit 1: the plan has something (lens shift, distortion, parallel light) that one of
    the formats can't hold; what was left out is told, and stands in its README.txt.
    """
    targets = tuple(dict.fromkeys(name for some in options["targets"] for name in some))
    options["targets"] = targets
    light = [name for name in _OF_SURFACE if options[name] is not None]
    if light and MITSUBA not in targets:
        raise click.UsageError(f"--{light[0]} goes with --to {MITSUBA}")
    from planning.cli.lines.export_lines import export_command

    run(lambda: export_command(options), debug=options["debug"])
