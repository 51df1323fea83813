"""`plan batch parts/ -o out/`: its options, most of them the planner's."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from planning.cli.console import output_options, run

from .plan_checks import check_each, check_projectors
from .plan_declared import GroupedCommand, rig_command

# What is said of one mesh, or of the whole batch.
_NOT_OF_PARTS = {
    *("meshes", "files", "align", "family_quantile", "ranges", "select", "weight"),
    *(
        "fixed",
        "output",
        "watch",
        "pareto",
        "take",
        "verbose",
        "as_json",
        "quiet",
        "debug",
        "threads",
    ),
}
_OF_PARTS = [p for p in rig_command.params if p.name not in _NOT_OF_PARTS]


@click.command(cls=GroupedCommand, params=[*_OF_PARTS])
@click.argument("given", nargs=-1, required=True, metavar="DIR|FILE...")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Where plans go, a folder for each part, with batch.csv and index.html.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1),
    metavar="N",
    help="Parts planned at a time here [default: half the cores].",
)
@click.option(
    "--scheduler",
    metavar="tcp://...",
    help="Instead: a dask scheduler, on whose workers parts are planned.",
)
@click.option(
    "--threads",
    type=click.IntRange(1),
    metavar="N",
    help="Of each part [default: cores over jobs; 1 on a scheduler's workers].",
)
@click.option("--again", is_flag=True, help="Plan finished parts again, too.")
@output_options
def batch(given: tuple[str, ...], **options: Any) -> None:  # noqa: ANN401
    """Plan many parts, each with the same rig and requirements.

    Run again, it goes on where it ended: a part whose plan stands whole, of the same
    file and options, is left. Exit 1 where any part failed or misses a requirement.
    """
    from planning.cli.batch.batch_command import batch_command

    check_each(options)
    check_projectors(options)
    words = list(_words(click.get_current_context()))
    run(lambda: batch_command(options, given, words), debug=options["debug"])


def _words(context: click.Context) -> Iterator[str]:
    """Yield the planner's options as they were given, but for a rig file."""
    for param in _OF_PARTS:
        name = param.name or ""
        source = context.get_parameter_source(name)
        value = context.params.get(name)
        # By identity: 0 is False's equal, and an answer.
        if source is not ParameterSource.COMMANDLINE or value is None or value is False:
            continue
        if name == "rig_name" and str(value).endswith(".toml"):
            continue
        option = max(param.opts, key=len)
        yield from (option,) if value is True else (option, str(value))
