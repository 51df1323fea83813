"""What drawn rigs meet of what was asked: plans with and without `--robust 0.95`.

Of the sample, a face scan and two parts of `../shared/data/meshes`: 0.3 mm in all, a
calibration that leaves 0.02 degrees and 0.05 mm of every device, nothing else but the
default rig's. The plan without is the one that the robust plan began as. Printed are
devices, the angle between view and light of the best pairs (median, 5 % of them), the
dearest camera (`benchmarks.pixels.calibrated_plans`), and of 200 rigs that no plan was
made for, of another seed than the plan's, the rms of their points' errors (median, 95 %
of them), how many meet what was asked and what the others miss.

    PYTHONPATH=.:tests python -m benchmarks.plans.robust_rigs [MESH ...]
"""

import sys
import time

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.pixels.calibrated_plans import MANY, NAMES, STATED, Found, stated_rig
from benchmarks.pixels.calibration_deciles import BestPairs
from geometry.parallel import n_threads
from planning import RequirementError, load_mesh, plan_rig
from planning.model.devices.calibration_errors import AS_PLANNED
from planning.model.plan import RigPlan
from planning.report.tolerance.asked import Asked
from planning.report.tolerance.built_case import BuiltCase
from planning.report.tolerance.tolerance import draw, question_of

_QUANTILE, _RIGS, _OTHER_SEED = 0.95, 200, 1


def planned(job: tuple) -> tuple[RigPlan, RigPlan]:
    """Return the plans of a mesh without and with what makes it robust."""
    path, options, up = job
    kept: list[RigPlan] = []
    try:
        plan = plan_rig(
            load_mesh(path, **options),
            stated_rig(STATED),
            max_projectors=MANY,
            accuracy_mm=0.3,
            robust=_QUANTILE,
            up=up,
            check=False,
            threads=n_threads(),
            keep=kept.append,
        )
    except RequirementError as error:
        plan = error.plan
    return kept[0], plan


def row(name: str, plan: RigPlan, seconds: str) -> str:
    """Return a line of the table."""
    found = Found(plan, BestPairs.of(plan), 0.0)
    angles = found.angles()
    case = BuiltCase.of(plan).shared()
    question = question_of(plan, AS_PLANNED, None, _OTHER_SEED)
    rigs = draw(case, question, range(_RIGS), threads=n_threads())
    asked = Asked.of(plan.requirements)
    missed = [asked.missed(rig) for rig in rigs]
    names = [name for each in missed for name in each]
    turned = ", ".join(f"{1e3 * each:.3f}" for each in found.dearest_turn())
    rms = 1e3 * np.array([rig.rms_m or np.inf for rig in rigs])
    each = ", ".join(f"{one} {names.count(one)}" for one in dict.fromkeys(names))
    return (
        f"| {name} | {len(plan.projectors)} + {len(plan.cameras)} | "
        f"{np.median(angles):.1f}, {np.quantile(angles, 0.05):.1f} | "
        f"{turned} | {np.median(rms):.3f}, "
        f"{np.quantile(rms, 0.95):.3f} | {missed.count(())} of {_RIGS} | {each or '-'} "
        f"| {seconds} |"
    )


def main(names: list[str]) -> None:
    """Print the table, an object as soon as it is planned."""
    print(
        "| mesh, plan | projectors + cameras | view to light, median, 5 % [degrees] | "
        "dearest camera turned, of the target, of its own points [mm] | "
        f"{_RIGS} drawn rigs: rms, median, 95 % [mm] | "
        "meet what was asked | missed by | planned [s] |"
    )
    print("|---" * 8 + "|", flush=True)
    for job in jobs(names or list(NAMES)):
        start = time.process_time()
        without, robust = planned(job)
        seconds = f"{time.process_time() - start:.0f}"
        print(row(f"{job[0].name}, as asked", without, ""), flush=True)
        print(row(f"--robust {_QUANTILE:g}", robust, seconds), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
