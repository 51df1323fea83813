"""`plan tolerance`: its options."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from planning.cli.console import PlanFile, Share, output_options, run, threads_option
from planning.model.devices.calibration_errors import MOST_FOCAL

_LENGTHS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
_ANGLES = {"deg": math.pi / 180.0, "mrad": 1e-3, "rad": 1.0}
_SHARES = {"%": 1e-2}
_PIXELS = {"px": 1.0}


class Quantities(click.ParamType):  # pyright: ignore[reportMissingTypeArgument]
    """Numbers with units, at most one of a kind: 2mm,0.2deg.

    Kinds are by name, and of each the units with their factors to metres, radians,
    shares and pixels; the value is a number for each name that was given.
    """

    name = "quantities"

    def __init__(self, example: str, **kinds: Mapping[str, float]) -> None:
        self._example, self._kinds = example, kinds

    def convert(
        self,
        value: Any,  # noqa: ANN401
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """Return the numbers by name, or fail as usage."""
        if not isinstance(value, str):
            return value
        found: dict[str, float] = {}
        for word in value.split(","):
            kind, number = self._read(word.strip(), param, ctx)
            if kind in found:
                self.fail(
                    f"{value!r} says {kind} twice; write {self._example}", param, ctx
                )
            found[kind] = number
        return found

    def _read(
        self, word: str, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, float]:
        figure = word.rstrip("%abcdefghijklmnopqrstuvwxyz").strip()
        unit = word[len(figure) :].strip()
        try:
            number = float(figure)
        except ValueError:
            self.fail(
                f"{word!r} isn't a number with a unit; write {self._example}",
                param,
                ctx,
            )
        for kind, units in self._kinds.items():
            if unit in units:
                if not (math.isfinite(number) and number >= 0.0):
                    self.fail(f"{word!r} must be 0 or more, and finite.", param, ctx)
                if kind == "focal" and number * units[unit] > MOST_FOCAL:
                    most = f"{100 * MOST_FOCAL:g} %"
                    self.fail(f"{word!r} must be at most {most}.", param, ctx)
                return kind, number * units[unit]
        known = ", ".join(unit for units in self._kinds.values() for unit in units)
        self.fail(
            f"{word!r} has {f'the unit {unit!r}' if unit else 'no unit'}, must be one "
            f"of {known}; write {self._example}",
            param,
            ctx,
        )


@click.command()
@click.argument("plan_file", type=PlanFile(), metavar="DIR[/plan.json]")
@click.option(
    "--mount",
    type=Quantities("2mm,0.2deg", position=_LENGTHS, angle=_ANGLES),
    metavar="MM,DEG",
    help="How far each device may stand beside its place, along and about each of its "
    "axes, and be known to: bounds, 2mm,0.2deg.",
)
@click.option(
    "--focal",
    type=Quantities("0.5%", focal=_SHARES),
    metavar="PERCENT",
    help="How far each focal length may be off, and be known to: a bound, 0.5%.",
)
@click.option(
    "--calibrated",
    type=Quantities(
        "0.05mm,0.01deg",
        position=_LENGTHS,
        angle=_ANGLES,
        focal=_SHARES,
        principal=_PIXELS,
    ),
    metavar="MM,DEG[,%,PX]",
    help="What a calibration leaves unknown of each device, rms: 0.05mm,0.01deg "
    "[default: the plan's [calibration]].",
)
@click.option(
    "--draws",
    type=click.IntRange(1, 1_000_000),
    default=200,
    metavar="N",
    help="Rigs to draw; those that are kept from before count.",
)
@click.option(
    "--quantile",
    type=Share(),
    default=0.95,
    metavar="Q",
    help="Share of the drawn rigs that must meet every requirement.",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Of the drawn rigs [default: the plan's]."
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder of tolerance.json, which keeps the drawn rigs [default: the plan's].",
)
@threads_option
@output_options
def tolerance(**options: Any) -> None:  # noqa: ANN401
    """Say how well a rig must be mounted and calibrated: Monte Carlo over rigs.

    Coverage, accuracy and completeness at 5, 50 and 95 % of the drawn rigs, the
    loosest mounting that will do, and what matters most. A second run with more draws
    goes on. Exit 1 where fewer rigs than --quantile meet every requirement.
    """
    from planning.cli.checks.tolerance_command import tolerance_command

    run(lambda: tolerance_command(options), debug=options["debug"])
