"""A turntable before one projector and two cameras, beside the shell's free devices.

Usage: python -m benchmarks.plans.turntable   (ringrig installed, from a checkout)

Plans the sample head with coded pixels: by projectors and cameras over the whole shell,
and before a turntable of 24 angles with the same devices. Prints what each measures,
the fewest steps for every number of devices with their proved bounds, and how many
steps each device more saves.
"""

import sys
from pathlib import Path

from geometry.files.readers import load_mesh
from planning.model.plan import RigPlan
from planning.pipeline import plan_rig
from planning.rig.rig import load_rig
from planning.verify.audit.audit import audit_plan

_MESH = Path(__file__).parents[2] / "face.obj"
_TABLE = {"point_mm": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "steps": 24}
_SHELL, _DEVICES, _MOST = 3, (1, 2), (2, 3)


def main() -> int:
    """Print the tables; return 1 if the audit finds a claim false."""
    mesh, rig = load_mesh(_MESH), load_rig("default")
    shell = plan_rig(mesh, rig, max_projectors=_SHELL, pattern="dense", check=False)
    table = rig.replace(turntable=_TABLE)
    few, many = (
        plan_rig(
            mesh, table, max_projectors=p, max_cameras=c, check=False, on_miss="return"
        )
        for p, c in (_DEVICES, _MOST)
    )
    print("| plan | projectors | cameras | steps (proved) | lit | measured | false |")
    print("|" + 7 * "---|")
    false = [_row(name, plan) for name, plan in (("shell", shell), ("table", few))]
    _savings(many)
    return int(any(false))


def _row(name: str, plan: RigPlan) -> int:
    told, areas = plan.document.stations, plan.coverage.target
    counts, steps = (len(plan.projectors), len(plan.cameras)), "-"
    if told is not None and told.count is not None:
        one = told.stations[0]
        counts = len(one.projectors), len(one.cameras)
        steps = f"{told.count.count} ({told.count.lower_bound})"
    lit, measured = (
        100.0 * a / areas.area_m2 for a in (areas.lit_m2, areas.measured_m2)
    )
    false = len(audit_plan(plan).failures)
    print(
        f"| {name} | {counts[0]} | {counts[1]} | {steps} | {lit:.1f} % "
        f"| {measured:.1f} % | {false} |"
    )
    return false


def _savings(plan: RigPlan) -> None:
    """Print the fewest steps of every number of devices, and what one more saves."""
    told = plan.document.stations
    rows = {(r.projectors, r.cameras): r for r in told.steps} if told else {}
    print(
        "\n| projectors | cameras | fewest steps | proved | saved by the last device |"
    )
    print("|" + 5 * "---|")
    for (p, c), row in rows.items():
        fewer = [rows[k].steps for k in ((p - 1, c), (p, c - 1)) if k in rows]
        known = [n for n in fewer if n is not None]
        saved = "-"
        if row.steps is not None and known:
            saved = str(min(known) - row.steps)
        steps = "none" if row.steps is None else row.steps
        print(f"| {p} | {c} | {steps} | {row.lower_bound} | {saved} |")


if __name__ == "__main__":
    sys.exit(main())
