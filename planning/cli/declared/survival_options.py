"""`--views`, `--survive` and `--joint`: pairs that count, losses, devices together."""

from collections.abc import Callable
from typing import Any

import click

_Command = Callable[..., Any]


def survival_options(command: _Command) -> _Command:
    """Declare how many views count, how many may be lost, and the joint plan."""
    views = click.option(
        "--views",
        type=click.IntRange(1, 8),
        metavar="K",
        help="Count as covered what at least K different pairs of projector and camera "
        "measure [default: 1]; with --pattern none what K cameras see, some pair of "
        "them well [default: 2].",
    )
    survive = click.option(
        "--survive",
        type=click.IntRange(0, 1),
        default=0,
        metavar="N",
        help="1: when any one projector or camera is lost, the others still meet the "
        "requirements [default: 0].",
    )
    joint = click.option(
        "--joint",
        is_flag=True,
        help="Then seek the cheapest projectors and cameras together, and move them "
        "together; `cost` of devices in the rig file counts.",
    )
    return views(survive(joint(command)))
