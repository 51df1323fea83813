"""The command line: `plan --mesh face.obj --max-projectors 3`, and its subcommands.

Heavy packages are imported inside the commands, so that `plan --help` stays quick.
"""

import math
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import click

_NOT_BUILT = {
    "report": "writes one self-contained HTML file",
    "export": "writes poses for OpenCV, COLMAP, glTF, Blender, ROS, USD, CSV",
}


# As in sysexits.h: a bug of ours, nothing that the user did.
_INTERNAL = 70


class _Positive(click.FloatRange):
    """A positive number, perhaps with a largest; NaN and infinity are none."""

    def __init__(self, largest: float | None = None) -> None:
        super().__init__(0.0, largest, min_open=True)

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return the number, or fail as usage."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} isn't a finite number.", param, ctx)
        return number


class _DefaultCommand(click.Command):
    """The command that runs when no subcommand is named; it shows as plain `plan`."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,  # noqa: ANN401
    ) -> click.Context:
        """Return a context whose usage line says `plan`, not `plan rig`."""
        return super().make_context("", args, parent, **extra)


class _DefaultGroup(click.Group):
    """A group whose `rig` command runs when no subcommand is named."""

    default = "rig"

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the default command in front of options that belong to it."""
        own = ("--help", "-h", "--version")
        if args and args[0].startswith("-") and args[0] not in own:
            args = [self.default, *args]
        return super().parse_args(ctx, args)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Show the default command's options below the group's own page."""
        super().format_help(ctx, formatter)
        formatter.write_paragraph()
        formatter.write_text("plan --mesh FILE --max-projectors N")
        self.commands[self.default].format_options(ctx, formatter)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Leave the default command out of the list."""
        return [name for name in self.commands if name != self.default]


@click.group(
    "plan",
    cls=_DefaultGroup,
    context_settings={"help_option_names": ["--help", "-h"], "max_content_width": 100},
)
@click.version_option(package_name="ringrig", prog_name="plan")
def commands() -> None:
    r"""Plan a structured-light scanner: how many projectors and cameras, and where.

    \b
    plan --mesh face.obj --max-projectors 3   plans, checks, writes ./face-plan/
    plan verify face-plan/plan.json           recomputes every claim, checks again
    plan reconstruct face-plan/plan.json      a cloud from rendered or captured images

    Exit: 0 planned and checked, 1 a requirement is missed, 2 usage, 3 bad input,
    4 nothing can be served, 5 time limit, 130 interrupted.
    """


@commands.command("rig", cls=_DefaultCommand)
@click.option(
    "--mesh",
    "meshes",
    multiple=True,
    metavar="FILE",
    help="Surface to measure: OBJ, PLY, STL, OFF, GLB, 3MF; .gz, .bz2, .zip too.",
)
@click.option(
    "--ranges",
    metavar="FILE.csv",
    help="Instead of --mesh: a few points of the object, as seen or measured from "
    "trial views; plans for the least-squares body.",
)
@click.option(
    "--max-projectors",
    type=click.IntRange(1),
    required=True,
    metavar="N",
    help="Projectors at most.",
)
@click.option(
    "--max-cameras",
    type=click.IntRange(1),
    metavar="N",
    help="Cameras at most [default: as many as needed].",
)
@click.option(
    "--unit",
    type=click.Choice(["mm", "cm", "m", "in", "um"]),
    help="Unit of a file that states none [default: mm].",
)
@click.option(
    "--size-mm",
    type=_Positive(),
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
    show_default=True,
    metavar="NAME|rig.toml",
    help="Devices and limits.",
)
@click.option(
    "--light",
    type=click.Choice(["diverging", "parallel"]),
    help="A real projector, or the paper's collimated light [default: the rig's].",
)
@click.option(
    "--pattern",
    type=click.Choice(["rings", "dense", "none"]),
    default="rings",
    show_default=True,
    help="What is projected.",
)
@click.option(
    "--target",
    type=click.Choice(["dominant", "surface"]),
    help="What must be covered [default: dominant; with --ranges surface].",
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
    type=_Positive(1.0),
    metavar="F",
    help="Lit share of the reachable target [default: 0.90].",
)
@click.option(
    "--coverage",
    type=_Positive(1.0),
    metavar="F",
    help="Measured share of the reachable target [default: 0.95].",
)
@click.option(
    "--min-reachable",
    type=_Positive(1.0),
    metavar="F",
    help="Share of the target that must be reachable [default: 0.90].",
)
@click.option(
    "--accuracy",
    "accuracy_mm",
    type=_Positive(),
    metavar="MM",
    help="Largest standard deviation along the normal [default: 0.3].",
)
@click.option(
    "--cameras-by",
    type=click.Choice(["cover", "paper", "both"]),
    default="both",
    show_default=True,
    help="Fewest of the candidates, the paper's largest baselines, or what is better.",
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
    default=0,
    show_default=True,
    help="Of every random draw.",
)
@click.option(
    "--time-limit",
    type=_Positive(),
    metavar="S",
    help="Cut the run after S seconds; the plan is marked truncated.",
)
@click.option(
    "--threads",
    type=click.IntRange(1),
    metavar="N",
    help="Worker threads; no result depends on it [default: all cores].",
)
@click.option("--prove", is_flag=True, help="Spend more work on the continuous bounds.")
@click.option("--no-check", is_flag=True, help="Skip the check from pixels.")
@click.option("--no-patterns", is_flag=True, help="Write no pattern images.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
@click.option("--quiet", is_flag=True, help="No progress on stderr.")
@click.option("--debug", is_flag=True, help="Tracebacks instead of one-line errors.")
def rig_command(**options: Any) -> None:  # noqa: ANN401
    """Plan a rig for a mesh, or for ranges (the default command)."""
    from .commands import plan_command

    _check_source(options)
    if options["unit"] and options["size_mm"] is not None:
        raise click.UsageError("give --unit or --size-mm, not both")
    _check_target(options)
    if options["pattern"] != "rings":
        raise click.UsageError(
            f"--pattern {options['pattern']} isn't built yet: use rings"
        )
    _run(lambda: plan_command(options, sys.argv[1:]), debug=options["debug"])


def _check_source(options: dict[str, Any]) -> None:
    meshes, ranges = options["meshes"], options["ranges"]
    if ranges is None and not meshes:
        raise click.UsageError("give --mesh FILE, or --ranges FILE.csv without a mesh")
    if ranges is not None:
        _check_ranges(options)
        return
    if not meshes[0]:
        raise click.UsageError("--mesh '' names no file")
    # os.path answers for names that the system refuses; Path raises.
    if len(meshes) > 1 or os.path.isdir(meshes[0]):
        raise click.UsageError(
            "several meshes on one rig aren't built yet: give one file"
        )


def _check_ranges(options: dict[str, Any]) -> None:
    if not options["ranges"]:
        raise click.UsageError("--ranges '' names no file")
    if options["meshes"]:
        raise click.UsageError(
            "give --mesh or --ranges, not both: a mesh says where the object is, and "
            "placing a mesh by observations isn't built"
        )
    for name, why in (
        ("unit", "the file is in millimetres"),
        ("size_mm", "the file is in millimetres"),
        ("select", "the body of ranges has no faces to select"),
        ("weight", "the body of ranges has no vertices to weigh"),
    ):
        if options[name] is not None:
            raise click.UsageError(f"--{name.replace('_', '-')} with --ranges: {why}")
    if options["target"] == "dominant":
        raise click.UsageError(
            "--target dominant with --ranges: a sphere has no dominant region; the "
            "target is its whole surface"
        )


def _check_target(options: dict[str, Any]) -> None:
    own = [name for name in ("select", "weight") if options[name] is not None]
    if len(own) == 2:
        raise click.UsageError("give --select or --weight, not both")
    if own and options["target"] == "surface":
        raise click.UsageError(f"give --target surface or --{own[0]}, not both")
    if own and not options[own[0]]:
        raise click.UsageError(f"--{own[0]} '' names no file")


@commands.command()
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
@click.option("--threads", type=click.IntRange(1), metavar="N", help="Worker threads.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
@click.option("--quiet", is_flag=True, help="No progress on stderr.")
@click.option("--debug", is_flag=True, help="Tracebacks instead of one-line errors.")
def verify(**options: Any) -> None:  # noqa: ANN401
    """Recompute every claim from the files alone, then check from pixels."""
    from .commands import verify_command

    _run(lambda: verify_command(options), debug=options["debug"])


@commands.command()
@click.argument(
    "plan_file",
    type=click.Path(path_type=Path),
    metavar="[DIR/plan.json]",
    required=False,
)
@click.option(
    "--experiment",
    type=click.Choice(["box", "face"]),
    help="Instead of a plan: an experiment of the paper's section VII, with its truth.",
)
@click.option(
    "--light",
    type=click.Choice(["diverging", "parallel"]),
    help="Of the experiment [default: parallel, as the paper assumes].",
)
@click.option(
    "--variant",
    type=click.Choice(["printed", "fits"]),
    help="Of the experiment: the paper's focal length and image centre, or a lens that "
    "sees all rings [default: printed].",
)
@click.option(
    "--ambient",
    type=click.FloatRange(0.0, 10.0),
    metavar="A",
    help="Of the experiment: room light as a share of the projector's [default: 0].",
)
@click.option(
    "--distortion",
    type=click.FloatRange(-0.5, 0.5),
    metavar="K1",
    help="Of the experiment: k1 of the cameras' lenses [default: 0].",
)
@click.option(
    "--second-sequence",
    is_flag=True,
    help="Of the experiment: measure again with rings midway between the first ones.",
)
@click.option(
    "--single-shot",
    is_flag=True,
    help="Simulate one image of each camera under each projector; rings are told apart "
    "by a prior mesh: the plan's, or one that is off.",
)
@click.option(
    "--prior-mm",
    type=_Positive(),
    metavar="MM",
    help="With --single-shot: how near the object lies to the prior [default: 1; of an "
    "experiment 6, its prior 5 mm off].",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Where cloud.ply goes [default: the plan's folder].",
)
@click.option(
    "--captures",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Read images that cameras took, FOLDER/C1/P1/00-white.png and so on, instead "
    "of simulating them.",
)
@click.option(
    "--save-captures",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Write the simulated images there, as --captures reads them.",
)
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Poses and optics as measured after mounting [default: the plan's].",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Of samples and noise [default: the plan's]."
)
@click.option("--threads", type=click.IntRange(1), metavar="N", help="Worker threads.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
@click.option("--quiet", is_flag=True, help="No progress on stderr.")
@click.option("--debug", is_flag=True, help="Tracebacks instead of one-line errors.")
def reconstruct(**options: Any) -> None:  # noqa: ANN401
    """Measure the object from images, rendered or captured; write cloud.ply."""
    _check_reconstruct(options)
    if options["experiment"] is not None:
        from .experiment_command import experiment_command

        _run(lambda: experiment_command(options), debug=options["debug"])
    from .reconstruct_command import reconstruct_command

    if options["captures"] is not None and options["save_captures"] is not None:
        raise click.UsageError(
            "give --captures or --save-captures, not both: the one reads images, the "
            "other writes simulated ones"
        )
    _run(lambda: reconstruct_command(options), debug=options["debug"])


def _given(options: dict[str, Any], name: str) -> bool:
    # A number that is 0 is given, and equal to False.
    return options[name] is not None and options[name] is not False


def _check_reconstruct(options: dict[str, Any]) -> None:
    experiment = options["experiment"] is not None
    if experiment == (options["plan_file"] is not None):
        raise click.UsageError("give DIR/plan.json, or --experiment box or face")
    if not options["single_shot"] and options["prior_mm"] is not None:
        raise click.UsageError("--prior-mm goes with --single-shot")
    plan_only = ("captures", "save_captures", "calibration")
    own = ("light", "variant", "ambient", "distortion", "second_sequence")
    for name in plan_only if experiment else own:
        if _given(options, name):
            kind = "an experiment" if experiment else "a plan"
            raise click.UsageError(
                f"--{name.replace('_', '-')} doesn't go with {kind}: it is of "
                f"{'plans' if experiment else 'experiments'}"
            )
    if options["single_shot"]:
        for name in ("captures", "save_captures", "calibration", "second_sequence"):
            if _given(options, name):
                raise click.UsageError(
                    f"give --single-shot or --{name.replace('_', '-')}, not both: "
                    f"it is of coded sequences"
                )


@commands.command()
@click.option("--debug", is_flag=True, help="Tracebacks instead of one-line errors.")
def rigs(debug: bool) -> None:
    """List the rigs that need no file, with the source of every number."""
    from .commands import rigs_command

    _run(rigs_command, debug=debug)


@commands.command()
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default="face.obj",
    show_default=True,
    metavar="FILE",
    help="Where it goes.",
)
@click.option(
    "--faces",
    type=click.IntRange(500, 2_000_000),
    default=40_000,
    show_default=True,
    metavar="N",
    help="Triangles of the closed head, about; the neck is then cut open.",
)
@click.option(
    "--variant",
    type=click.IntRange(0),
    metavar="SEED",
    help="Another head of the population [default: the mean head].",
)
@click.option("--debug", is_flag=True, help="Tracebacks instead of one-line errors.")
def sample(output: Path, faces: int, variant: int | None, debug: bool) -> None:
    """Write the sample head, an OBJ file in millimetres."""
    from .commands import sample_command

    _run(lambda: sample_command(output, faces, variant), debug=debug)


def _not_built(name: str, purpose: str) -> None:
    @commands.command(
        name,
        short_help=f"(not built yet) {purpose}",
        context_settings={
            "ignore_unknown_options": True,
            "help_option_names": ["--help"],
        },
    )
    @click.argument("anything", nargs=-1, type=click.UNPROCESSED)
    def command(anything: tuple[str, ...]) -> None:
        raise click.UsageError(f"`plan {name}` isn't built yet; it {purpose}")

    command.help = f"Not built yet: {purpose}."


for _name, _purpose in _NOT_BUILT.items():
    _not_built(_name, _purpose)


def _run(command: Callable[[], int], *, debug: bool) -> None:
    """Run a command; turn our own errors into one line and the documented exit code."""
    from geometry.mesh.mesh import MeshError
    from planning.model.errors import PlanningError

    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.exit(command())
    except KeyboardInterrupt:
        _stop("interrupted before a first plan stood; nothing was written", 130)
    except BrokenPipeError:
        # Whoever reads stdout has had enough; Python must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except (PlanningError, MeshError, OSError) as error:
        if debug:
            raise
        _stop(str(error), 2 if isinstance(error, OSError) else _exit_code(error))
    except Exception as error:
        if debug or isinstance(error, click.ClickException):
            raise
        name = type(error).__name__
        _stop(
            f"internal error ({name}: {error}); this is a bug: run again with --debug "
            f"and report it",
            _INTERNAL,
        )


def _exit_code(error: Exception) -> int:
    return int(getattr(error, "exit_code", 3))


def _stop(message: str, code: int) -> NoReturn:
    click.echo(f"plan: {' '.join(message.split())}", err=True)
    sys.exit(code)


def main() -> None:
    """Run the command line; the entry point of `plan`."""
    # Sums must not be split differently on another number of cores; set before numpy
    # and IPOPT are loaded. Rays have threads of their own.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    before = signal.signal(signal.SIGINT, _quit)
    try:
        sys.exit(commands.main(prog_name="plan", standalone_mode=False))
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        sys.exit(error.exit_code)
    except click.ClickException as error:
        _stop(f"{error.format_message()} (see `plan --help`)", error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        _stop("interrupted", 130)
    finally:
        signal.signal(signal.SIGINT, before)


def _quit(number: int, frame: object) -> NoReturn:
    """Leave at once: while packages are imported, an exception would be swallowed."""
    os.write(2, b"plan: interrupted before anything was done\n")
    os._exit(130)
