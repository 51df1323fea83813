"""What of 200 drawn rigs meets what was asked: plans with and without `--robust`.

The sample, three projectors, 0.3 mm in all, a calibration that leaves 0.02 degrees and
0.05 mm of every device, nothing else but the default rig's. Drawn are other rigs than
those that the robust plan was made for. Planning takes long: plans that were written
are taken where their folders are given, the one without `--robust` first.

    PYTHONPATH=. python -m benchmarks.plans.robust_rigs [DIR DIR]
"""

import sys
from dataclasses import replace
from pathlib import Path

from geometry.files.readers import load_mesh
from geometry.parallel import n_threads
from planning import RequirementError, load_rig, plan_rig
from planning.model.calibration_errors import AS_PLANNED
from planning.model.plan import RigPlan
from planning.report.tolerance.asked import Asked
from planning.report.tolerance.built_case import BuiltCase
from planning.report.tolerance.drawn_rigs import DRAWN
from planning.report.tolerance.tolerance import (
    as_planned,
    draw,
    question_of,
)
from planning.rig.rig_tables import CalibrationTable

_STATED = CalibrationTable(angle_deg=0.02, position_mm=0.05)
_ACCURACY_MM, _QUANTILE, _RIGS = 0.3, 0.95, 200


def planned(robust: float | None) -> RigPlan:
    """Plan the sample."""
    rig = load_rig("default")
    rig = replace(rig, table=rig.table.model_copy(update={"calibration": _STATED}))
    try:
        return plan_rig(
            load_mesh(Path("face.obj")),
            rig,
            max_projectors=3,
            accuracy_mm=_ACCURACY_MM,
            robust=robust,
            check=False,
            threads=n_threads(),
        )
    except RequirementError as error:
        return error.plan


def row(name: str, plan: RigPlan) -> str:
    """Return a line of the table."""
    case = BuiltCase.of(plan).shared()
    question = question_of(plan, AS_PLANNED, None, None)
    rigs = draw(case, question, range(_RIGS), threads=n_threads(), stream=DRAWN)
    asked = Asked.of(plan.requirements)
    met = sum(not asked.missed(rig) for rig in rigs)
    errors = sorted(1e3 * (rig.rms_m or 0.0) for rig in rigs)
    sigma = plan.requirements.triangulation.max_sigma_m or 0.0
    low, middle, high = (errors[int(_RIGS * q)] for q in (0.05, 0.5, 0.95))
    record = plan.document.robust
    own = "" if record is None else f"{record.n_met} of {record.n_drawn}"
    return (
        f"| {name} | {len(plan.projectors)} + {len(plan.cameras)} | {1e3 * sigma:.3f} "
        f"| {100 * plan.requirements.coverage:.2f} % "
        f"| {100 * as_planned(case).coverage:.2f} % "
        f"| {1e3 * (case.predicted_rms_m() or 0.0):.3f} | {low:.3f} | {middle:.3f} "
        f"| {high:.3f} | {met} of {_RIGS} | {own} |"
    )


def main(folders: list[str]) -> None:
    """Print the table."""
    print(
        "| plan | devices | sigma limit [mm] | coverage required | as planned |", end=""
    )
    print(
        " rms to first order [mm] | drawn 5 % | 50 % | 95 % | meet what was asked |",
        end="",
    )
    print(" of the planner's rigs |")
    print("|---" * 11 + "|")
    for index, robust in enumerate((None, _QUANTILE)):
        path = Path(folders[index]) / "plan.json" if folders else None
        plan = planned(robust) if path is None else RigPlan.load(path)
        print(row("as asked" if robust is None else f"--robust {robust:g}", plan))


if __name__ == "__main__":
    main(sys.argv[1:])
