"""View planning as peers state it: one sensor, on the same candidates as greedy.

Usage: python -m benchmarks.plans.one_sensor   (ringrig installed, from a checkout,
    with ../shared beside it)

The rig `one_sensor.toml` is a camera and a projector at one place, nearly; its poses
stand on a sphere about the Stanford bunny. A sample of the whole surface is measured
where it is met at no more than an angle from its normal, from 20 to 70 degrees. Asked
is a share of what some candidate measures. Prints the views of the plan, which fresh
samples confirm; the fewest found on the planner's own samples, and what greedy takes of
the same candidates there; what is proved; and how many claims the audit finds false.
"""

import sys
import time
from pathlib import Path

from support import shared_meshes

from geometry.files.readers import load_mesh
from planning.model.plan import RigPlan
from planning.pipeline import plan_rig
from planning.rig.rig import load_rig
from planning.verify.audit.audit import audit_plan

_RIG = Path(__file__).with_name("one_sensor.toml")
_BUNNY = shared_meshes.BY_NAME["vtk_bunny.ply"]
_ANGLES_DEG, _SHARES, _MANY = (20, 30, 40, 50, 60, 70), (0.95, 0.99), 400


def main() -> int:
    """Print the table; return 1 if greedy takes fewer, or a claim is false."""
    if not _BUNNY.path.is_file():
        print(f"skipped: {_BUNNY.path.name} isn't beside the project")
        return 0
    mesh, rig = load_mesh(_BUNNY.path, unit="m"), load_rig(_RIG)
    print(
        "| angle [deg] | asked | views | on its samples | greedy on them "
        "| least: candidates | all poses "
        "| candidates | samples | proof | measured of the target | false | seconds |"
    )
    print("|" + 13 * "---|")
    well = True
    for angle in _ANGLES_DEG:
        limits = {
            "projector_max_incidence_deg": float(angle),
            "camera_max_incidence_deg": float(angle),
        }
        for share in _SHARES:
            begin = time.perf_counter()
            plan = plan_rig(
                mesh,
                rig.replace(limits=limits),
                max_heads=_MANY,
                target="surface",
                dominant_coverage=share,
                coverage=share,
                min_reachable=0.01,
                check=False,
                on_miss="return",
            )
            well &= _row(angle, share, plan, time.perf_counter() - begin)
    return int(not well)


def _row(angle: int, share: float, plan: RigPlan, seconds: float) -> bool:
    """Print a line; return whether greedy takes no fewer and no claim is false."""
    told, areas = plan.document.stations, plan.coverage.target
    assert told is not None
    count = told.count
    assert count is not None
    false = len(audit_plan(plan).failures)
    print(
        f"| {angle} | {share:.0%} | {count.count} | {count.needed} | {count.greedy} "
        f"| {count.lower_bound} | {count.everywhere} | {count.n_candidates} "
        f"| {count.n_samples} | {count.proof} "
        f"| {areas.measured_m2 / areas.area_m2:.1%} | {false} | {seconds:.0f} |",
        flush=True,
    )
    return not false and (count.greedy is None or count.needed <= count.greedy)


if __name__ == "__main__":
    sys.exit(main())
