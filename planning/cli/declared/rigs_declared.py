"""`plan lens`, `rigs`, `schema` and `play`: their options."""

from pathlib import Path
from typing import Any

import click

from planning.cli.console import Finite, Positive, debug_option, run

from .plan_declared import rig_command

# What says which object and which rig there are.
_OF_OBJECTS = ("meshes", "files", "unit", "size_mm", "rig_name", "light")


@click.command(
    params=[p for p in rig_command.params if p.name in _OF_OBJECTS],
)
@debug_option
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def lens(**options: Any) -> None:  # noqa: ANN401
    """Say which lens, throw, f-number and focus suit an object, without planning."""
    from planning.cli.devices.lens_command import lens_command

    meshes = (*options.pop("meshes"), *options.pop("files"))
    if len(meshes) != 1 or not meshes[0]:
        raise click.UsageError(f"give --mesh FILE, one; {len(meshes)} were given")
    if options["unit"] and options["size_mm"] is not None:
        raise click.UsageError("give --unit or --size-mm, not both")
    run(lambda: lens_command(options | {"mesh": meshes[0]}), debug=options["debug"])


@click.group(invoke_without_command=True)
@click.pass_context
@debug_option
def rigs(context: click.Context, debug: bool) -> None:
    """List the rigs that need no file; show one, list devices, write a new one."""
    if context.invoked_subcommand is None:
        from planning.cli.devices.rigs_command import rigs_command

        run(rigs_command, debug=debug)


@rigs.command("show")
@click.argument("name")
@click.option(
    "--sources", is_flag=True, help="Every number with its source, not the file."
)
@debug_option
def show_rig(name: str, sources: bool, debug: bool) -> None:
    """Print a rig as the file that it is: to read, or to change.

    Of a device, a calibration or a sensor: every number with its source.
    """
    from planning.cli.devices.rigs_command import show_rig_command

    run(lambda: show_rig_command(name, sources=sources), debug=debug)


@rigs.command("devices")
@click.argument(
    "kind", type=click.Choice(["projectors", "cameras", "lenses"]), required=False
)
@debug_option
def devices(kind: str | None, debug: bool) -> None:
    """List projectors, cameras and lenses that a rig file may name."""
    from planning.cli.devices.rigs_command import devices_command

    run(lambda: devices_command(kind), debug=debug)


class Pixels(click.ParamType):  # pyright: ignore[reportMissingTypeArgument]
    """Width and height in pixels: 1920x1080."""

    name = "pixels"

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return both, or fail as usage."""
        from planning.cli.devices.new_rig_command import pixels

        try:
            return pixels(value) if isinstance(value, str) else value
        except ValueError as error:
            self.fail(str(error), param, ctx)


@rigs.command("new")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default="rig.toml",
    metavar="FILE",
    help="Where it goes; an existing file is never overwritten.",
)
@click.option(
    "--object-mm", type=Positive(), metavar="S", help="Longest side of the object."
)
@click.option(
    "--projector", metavar="NAME", help="A projector of `plan rigs devices`, or:"
)
@click.option(
    "--throw-ratio",
    type=Positive(),
    metavar="T",
    help="Distance over image width, as its maker says.",
)
@click.option("--projector-px", type=Pixels(), metavar="WxH", help="Its pixels.")
@click.option(
    "--offset-percent",
    type=Finite(-1000.0, 1000.0),
    metavar="P",
    help="Vertical offset: from the image's middle to the lens, of half its height.",
)
@click.option(
    "--camera",
    multiple=True,
    metavar="NAME[ + LENS][:N]",
    help="A camera of `plan rigs devices`, with a lens or a focal length: + 16mm, and "
    "how many there are: :4. Several times for several models. Or:",
)
@click.option("--sensor-px", type=Pixels(), metavar="WxH", help="Pixels of a camera.")
@click.option("--pixel-um", type=Positive(), metavar="UM", help="Size of its pixels.")
@click.option(
    "--focal-mm",
    type=Positive(),
    metavar="F",
    help="Its lens [default: the longest whose image holds the object].",
)
@click.option(
    "--distance-mm",
    type=Positive(),
    metavar="D",
    help="From device to surface [default: the least at which lenses focus and an "
    "image holds the object].",
)
@debug_option
def new(**options: Any) -> None:  # noqa: ANN401
    """Write a rig file of your devices: commented, and ready to plan with.

    Without flags, on a terminal, it asks. What you don't say is chosen, and said.
    """
    from planning.cli.devices.new_rig_command import new_rig_command

    run(lambda: new_rig_command(options), debug=options["debug"])


@click.command()
@click.option(
    "--of",
    type=click.Choice(["plan", "rig"]),
    default="plan",
    help="Of which file: plan.json, or a rig file in TOML.",
)
@debug_option
def schema(of: str, debug: bool) -> None:
    """Print the JSON Schema of plan.json, or of rig files."""
    from planning.cli.devices.rigs_command import schema_command

    run(lambda: schema_command(of), debug=debug)


class Corner(click.ParamType):  # pyright: ignore[reportMissingTypeArgument]
    """A place on the desktop in pixels: 1920,0."""

    name = "corner"

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return both, or fail as usage."""
        if not isinstance(value, str):
            return value
        parts = value.split(",")
        if len(parts) != 2 or not all(p.isascii() and p.isdigit() for p in parts):
            self.fail(f"{value!r} must be two whole numbers, as 1920,0", param, ctx)
        return int(parts[0][:6]), int(parts[1][:6])


@click.command()
@click.argument("directory", type=click.Path(path_type=Path), metavar="DIR")
@click.argument("projector", metavar="P1")
@click.option(
    "--at",
    type=Corner(),
    default="0,0",
    metavar="X,Y",
    help="Upper left corner of the projector's screen on the desktop, in pixels.",
)
@click.option(
    "--hold",
    type=Finite(0.0, 3600.0),
    metavar="S",
    help="Seconds that a frame stands, before a capture [default: until a key is "
    "pressed; with --capture 0.3].",
)
@click.option(
    "--capture",
    metavar="COMMAND",
    help="Takes an image of each frame, once for each camera: {file}, {camera}, "
    "{projector} and {frame} are filled in.",
)
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    metavar="F",
    help="Where images go, as `plan reconstruct --captures F` reads them.",
)
@click.option(
    "--cameras", metavar="C1,C2", help="Of which cameras [default: all of the plan]."
)
@click.option("--quiet", is_flag=True, help="No progress on stderr.")
@debug_option
def play(**options: Any) -> None:  # noqa: ANN401
    """Show a projector's frames in order, full-screen, and capture each.

    Escape ends it; without --hold any other key shows the next frame.
    """
    from planning.cli.devices.play_command import play_command

    directory: Path = options["directory"]
    if directory.name == "plan.json":
        options["directory"] = directory.parent
    run(lambda: play_command(options), debug=options["debug"])
