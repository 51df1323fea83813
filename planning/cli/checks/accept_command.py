"""What `plan accept` does: the acceptance test of a plan's rig, simulated.

Exit: 0 measured, 1 of some artefact too little was measured, 3 a bad plan, 4 nothing
was measured of any.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import click

from geometry.parallel import n_threads
from planning.cli.console import print_json, reporter
from planning.experiments.acceptance.acceptance import Acceptance, Quantity, accept
from planning.experiments.acceptance.artefacts import BAR, N_PLATES, PLATE, SPHERE
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.plan import RigPlan
from planning.verify.reconstruction.scanner import Scanner

_MM = 1e3
_READINGS: dict[Quantity, str] = {
    "PF": "probing error, form",
    "PS": "probing error, size",
    "SD": "sphere spacing error",
    "F": "flatness error",
}


def accept_command(options: Mapping[str, Any]) -> int:
    """Measure the artefacts and print what a maker would; return the exit code."""
    plan = RigPlan.load(options["plan_file"])
    plan.require_projectors("`plan accept`")
    scanner = Scanner.of(plan)
    seed = plan.document.seed if options["seed"] is None else options["seed"]
    found = accept(
        scanner,
        seed=seed,
        draws=options["draws"],
        threads=options["threads"] or n_threads(),
        progress=reporter(quiet=options["quiet"]),
    )
    if options["as_json"]:
        print_json(found.to_document())
    else:
        click.echo("\n".join(_lines(found, scanner.calibration)))
    return 1 if found.unmeasured else 0


def _lines(found: Acceptance, calibration: CalibrationErrors | None) -> Iterator[str]:
    size = 2.0 * _MM * found.ball
    yield (
        f"ACCEPTANCE after VDI/VDE 2634 part 2, simulated; measuring volume: the cube "
        f"of {size / 3**0.5:.0f} mm in the ball about the object, L0 = {size:.0f} mm"
    )
    yield (
        f"spheres of {SPHERE * size:.1f} mm, {BAR * size:.1f} mm from centre to "
        f"centre, in 7 places; a plate {PLATE * size:.0f} mm long in {N_PLATES}"
    )
    rigs = max((len(values) for values in found.drawn.values()), default=0)
    head = f"{'':<28}{'places':>8}{'calibrated perfectly':>24}"
    yield head + (f"{f'of {rigs} rigs: half within':>26}{'95 %':>9}" if rigs else "")
    for name, values in found.perfect.items():
        line = f"{name:<4}{_READINGS[name]:<24}{len(values):>8}"
        line += f"{_MM * found.largest(name):>21.3f} mm"
        if name in found.drawn:
            half, most = found.quantiles(name)
            line += f"{_MM * half:>23.3f} mm{_MM * most:>9.3f}"
        yield line
    if calibration is None:
        yield (
            "the plan states no calibration: write [calibration] in the rig file, and "
            "what it leaves is drawn and counted"
        )
    for name in found.unmeasured:
        yield f"NOT MEASURED: {name}: too few points; the rig doesn't reach that place"
    figures = {
        name: found.quantiles(name)[1] if rigs else found.largest(name)
        for name in found.perfect
    }
    stated = ", ".join(f"{name} {_MM * most:.2f} mm" for name, most in figures.items())
    yield (
        f"as a maker would state it, "
        f"{'for 95 % of rigs' if rigs else 'calibrated perfectly'}: {stated}"
    )
