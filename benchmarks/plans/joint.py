"""Plans of projectors and cameras together beside those of one kind after the other.

Of the sample and four meshes of `../shared/data/meshes` (those named, if any), each in
the unit or size that `tests/support/shared_meshes.py` states, with the default rig.
Printed are numbers of projectors and cameras of either plan, what found the joint ones,
the bound on both together over the devices on offer, the margin before and after both
kinds moved together, what fresh samples say is lit and measured of what can be, false
claims that the audit finds, requirements missed, and processor seconds of the plan of
two stages and of the rest.

    PYTHONPATH=.:tests python -m benchmarks.plans.joint [--calibrated] [--dear] [MESH]

With `--calibrated` a calibration leaves 0.02 degrees and 0.05 mm, which takes more
cameras; with `--dear` a projector costs three of them.
"""

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from support import shared_meshes

from geometry.parallel import n_threads
from planning import load_mesh, load_rig, plan_rig
from planning.model.plan import RigPlan
from planning.report.summary.shortfall import shortfalls
from planning.verify.audit.audit import audit_plan

ROOT = Path(__file__).parents[2]
_SOME = (
    "mediapipe_canonical_face_model.obj",
    "tm_reference.obj",
    "tm_fixed_top.ply",
    "vtk_bunny.ply",
)
_MANY = 12


def main(words: list[str]) -> None:
    """Print the table, a mesh as soon as it is planned."""
    changes: dict[str, dict[str, float]] = {}
    if "--calibrated" in words:
        changes["calibration"] = {"angle_deg": 0.02, "position_mm": 0.05}
    if "--dear" in words:
        changes |= {"projector": {"cost": 3.0}, "camera": {"cost": 1.0}}
    names = [word for word in words if not word.startswith("--")]
    print(
        "| mesh | two stages | together | found by | bound over (projectors, cameras, "
        "samples) | margin | lit, measured | false claims | missed | seconds: two "
        "stages, together |"
    )
    print("|---" * 10 + "|", flush=True)
    for name, path, options, up in _meshes(names):
        print(_row(name, path, options, up, changes), flush=True)


def _meshes(
    names: list[str],
) -> Iterator[tuple[str, Path, dict[str, Any], str | None]]:
    if not names or "face.obj" in names:
        yield "face.obj", ROOT / "face.obj", {}, None
    for mesh in shared_meshes.MESHES:
        if mesh.path.is_file() and mesh.name in (names or _SOME):
            words = mesh.words
            up = words[words.index("--up") + 1] if "--up" in words else None
            yield mesh.name, mesh.path, mesh.options, up


def _row(
    name: str,
    path: Path,
    options: dict[str, Any],
    up: str | None,
    changes: dict[str, dict[str, float]],
) -> str:
    """Plan a mesh and return its line."""
    rig = load_rig("default").replace(**changes)
    first: list[float] = []
    begin = time.process_time()
    plan = plan_rig(
        load_mesh(path, **options),
        rig,
        max_projectors=_MANY,
        up=up,
        joint=True,
        cameras_by="cover",
        check=False,
        threads=n_threads(),
        on_miss="return",
        keep=lambda plan: first.append(time.process_time()),
    )
    ends = first[0], time.process_time()
    audit = audit_plan(plan, threads=n_threads())
    return _told(name, plan, len(audit.failures), ends[0] - begin, ends[1] - ends[0])


def _told(name: str, plan: RigPlan, n_false: int, first: float, rest: float) -> str:
    record, areas = plan.document.joint, plan.coverage.target
    assert record is not None
    counts = [
        f"{one.projectors} + {one.cameras} = {one.cost:g}"
        for one in (record.two_stage, record.joint)
    ]
    over = record.over
    margins = [
        "-" if margin is None else f"{100 * margin:.1f} %"
        for margin in (record.margin_before, record.margin)
    ]
    lit = areas.lit_m2 / areas.reachable_by_projectors_m2
    measured = areas.measured_m2 / areas.reachable_by_cameras_m2
    return (
        f"| {name} | {counts[0]} | {counts[1]} | {record.found} | "
        f"{record.lower_bound:g} of {record.needed:g}, {record.status} "
        f"({over.projectors}, {over.cameras}, {over.samples}) | "
        f"{margins[0]} -> {margins[1]} | {100 * lit:.1f} %, {100 * measured:.1f} % | "
        f"{n_false} | {len(shortfalls(plan))} | {first:.0f}, {rest:.0f} |"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
