"""`plan export`, and what it shares with a check by Mitsuba: what the object is of."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from planning.cli.console import Finite, PlanFile, output_options, run

_BUILT = ("mitsuba",)
_PLANNED = ("opencv", "colmap", "gltf", "blender", "ros", "usd", "csv", "step")
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


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "--to",
    "target",
    required=True,
    type=click.Choice((*_BUILT, *_PLANNED)),
    help="Format; only mitsuba is built yet.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Where it goes [default: a folder named like the format in the plan's].",
)
@surface_options
@output_options
def export(**options: Any) -> None:  # noqa: ANN401
    """Write a rig for another program: a scene that Mitsuba 3 renders."""
    if options["target"] in _PLANNED:
        raise click.UsageError(
            f"`plan export --to {options['target']}` isn't built yet; built is "
            f"{', '.join(_BUILT)}"
        )
    from planning.cli.other_commands import export_command

    run(lambda: export_command(options), debug=options["debug"])
