"""The command line: `plan --mesh face.obj --max-projectors 3`, and its subcommands.

Heavy packages are imported inside the commands, so that `plan --help` stays quick.
"""

import gc
import os
import sys
import time
from collections.abc import Iterator
from typing import NoReturn

import click
from click.shell_completion import CompletionItem, get_completion_class

from planning.cli.declared.batch_declared import batch
from planning.cli.declared.calibrate_declared import calibrate
from planning.cli.declared.evaluate_declared import evaluate
from planning.cli.declared.export_declared import export
from planning.cli.declared.other_declared import (
    accept,
    cache,
    compare,
    report,
    sample,
    show,
    verify,
)
from planning.cli.declared.plan_declared import rig_command
from planning.cli.declared.reconstruct_declared import reconstruct
from planning.cli.declared.rigs_declared import lens, play, rigs, schema
from planning.cli.declared.tolerance_declared import tolerance

from .console import stop, stop_signals

# That have to come before garbage is looked for.
_OBJECTS = 20_000


class _DefaultGroup(click.Group):
    """A group whose `rig` command runs when no subcommand is named."""

    default = "rig"

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the default command in front of what belongs to it: options or a file."""
        group_options = ("--help", "-h", "--version")
        first = args[0] if args else ""
        named = os.path.exists(first) or any(c in first for c in "./\\")
        if (first.startswith("-") or named) and first not in (
            *group_options,
            *self.commands,
        ):
            args = [self.default, *args]
        return super().parse_args(ctx, args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Let the default command show as plain `plan`, not `plan rig`."""
        name, command, others = super().resolve_command(ctx, args)
        return "" if name == self.default else name, command, others

    def shell_complete(
        self, ctx: click.Context, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the default command's options beside the commands."""
        own = super().shell_complete(ctx, incomplete)
        return own + self.commands[self.default].shell_complete(ctx, incomplete)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Show the default command's options below the group's own page."""
        super().format_help(ctx, formatter)
        formatter.write_paragraph()
        formatter.write_text("plan --mesh FILE --max-projectors N [OPTIONS]")
        self.commands[self.default].format_options(ctx, formatter)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Leave the default command out of the list."""
        return [name for name in self.commands if name != self.default]


@click.group(
    "plan",
    cls=_DefaultGroup,
    context_settings={
        "help_option_names": ["--help", "-h"],
        "max_content_width": 100,
        "show_default": True,
    },
)
@click.version_option(package_name="ringrig", prog_name="plan")
def commands() -> None:
    """Plan a structured-light scanner: how many projectors and cameras, and where.

    \b
    plan --mesh face.obj --max-projectors 3   plans, checks, writes ./face-plan/
    plan --mesh heads/ --max-projectors 5     one rig for all of a folder's meshes
    plan batch parts/ -o out/ --max-projectors 4
                                              a plan for each of many parts
    plan evaluate face.obj --poses rig.csv    what a rig measures as it stands
    plan verify face-plan/plan.json           recomputes every claim, checks again
    plan accept face-plan/plan.json           a maker's figures: ball bars, plates
    plan show face-plan/plan.json             every place in mesh axes, camera by camera
    plan compare face-plan other-plan         two plans side by side
    plan report face-plan                     one HTML file: rig, causes, tables
    plan tolerance face-plan --mount 2mm,0.2deg
                                              how well devices must be mounted
    plan rigs                                 rigs and devices to plan with; rigs new
    plan lens --mesh face.obj                 which lens and focus suit an object
    plan calibrate face-plan/plan.json        images of a board that calibrate the rig
    plan play face-plan P1 --hold 1           a projector's frames, and captures of them
    plan reconstruct face-plan/plan.json      a cloud from rendered or captured images
    plan export face-plan --to ros,csv        for ROS, COLMAP, Blender, CAD, builders

    Exit: 0 planned and checked, 1 a requirement is missed, 2 usage, 3 bad input,
    4 nothing can be served, 5 time limit, 130 interrupted.
    """  # noqa: D301 - click wants the character that \b stands for


for _command in (
    *(rig_command, batch, evaluate, verify, accept, show, reconstruct, tolerance),
    *(export, compare, report, lens, calibrate, play, rigs, schema, cache, sample),
):
    commands.add_command(_command)


@commands.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print what completes `plan` in a shell.

    \b
    bash   eval "$(plan completion bash)"              in ~/.bashrc
    zsh    eval "$(plan completion zsh)"               in ~/.zshrc
    fish   plan completion fish | source               in config.fish
    """  # noqa: D301 - click wants the character that \b stands for
    script = get_completion_class(shell)
    if script is not None:
        click.echo(script(commands, {}, "plan", "_PLAN_COMPLETE").source())


def main() -> None:
    """Run the command line; the entry point of `plan`."""
    # Time limits count from here: imports take seconds on a busy machine.
    begin = time.monotonic()
    # Sums must not be split differently on another number of cores; set before numpy
    # and IPOPT are loaded. Rays have threads of their own.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    # Most of what is made while modules are imported stays.
    gc.set_threshold(_OBJECTS, 50, 50)
    try:
        with stop_signals(_quit):
            sys.exit(commands.main(prog_name="plan", standalone_mode=False, obj=begin))
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        sys.exit(error.exit_code)
    except click.ClickException as error:
        told = " ".join(["plan", *_named(sys.argv[1:]), "--help"])
        stop(f"{error.format_message()} (see `{told}`)", error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        stop("interrupted", 130)


def _named(words: list[str]) -> Iterator[str]:
    """Yield the commands that a command line begins with."""
    command: click.Command = commands
    for word in words:
        if not isinstance(command, click.Group) or word not in command.commands:
            return
        yield word
        command = command.commands[word]


def _quit(number: int, frame: object) -> NoReturn:
    """Leave at once: while packages are imported, an exception would be swallowed."""
    os.write(2, b"plan: interrupted before anything was done\n")
    os._exit(130)
