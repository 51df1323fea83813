"""What `plan tolerance` does."""

from collections.abc import Mapping
from typing import Any

import click
from threadpoolctl import threadpool_limits

from geometry.parallel import n_threads
from planning.cli.console import print_json, reporter, writable
from planning.model.devices.calibration_errors import CalibrationErrors, Mounting
from planning.model.errors import InputError
from planning.model.plan import RigPlan
from planning.report.tolerance.studies import FILE, StudyFile
from planning.report.tolerance.tolerance import question_of, tolerance_of
from planning.report.tolerance.tolerance_lines import tolerance_lines


def tolerance_command(options: Mapping[str, Any]) -> int:
    """Draw rigs and print what becomes of the plan; 0 if enough meet what is asked."""
    path = options["plan_file"]
    plan = RigPlan.load(path)
    if plan.document.family is not None:
        raise InputError(
            f"{path}: rigs are drawn for one mesh, and this plan is a family's: name "
            f"the plan of a member (members/NAME)"
        )
    if not plan.projectors or not plan.cameras:
        raise InputError(
            f"{path}: a rig without projectors or cameras measures nothing"
        )
    mounting = None
    if options["mount"] is not None or options["focal"] is not None:
        moved = (options["mount"] or {}) | (options["focal"] or {})
        names = ("position", "angle", "focal")
        mounting = Mounting(*(moved.get(name, 0.0) for name in names))
    left = options["calibrated"]
    calibration = None
    if left is not None:
        names = ("angle", "position", "focal", "principal")
        calibration = CalibrationErrors(*(left.get(name, 0.0) for name in names))
    question = question_of(plan, mounting, calibration, options["seed"])
    folder = options["output"] or path.parent
    with writable(folder), threadpool_limits(1):
        found = tolerance_of(
            plan,
            question,
            n=options["draws"],
            quantile=options["quantile"],
            file=StudyFile(folder / FILE, question),
            threads=options["threads"] or n_threads(),
            report=reporter(quiet=options["quiet"]),
        )
    if options["as_json"]:
        print_json(found.to_document())
    else:
        click.echo("\n".join(tolerance_lines(found)))
    if found.interrupted:
        return 130
    return 0 if found.passed else 1
