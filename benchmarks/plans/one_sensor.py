"""View planning as peers state it: one sensor, on the same candidates as greedy.

Usage: python -m benchmarks.plans.one_sensor [ANGLE ...]   (ringrig installed, from a
    checkout, with ../shared beside it)

The rig `one_sensor.toml` is a camera and a projector at one place, nearly; its poses
stand on a sphere about the Stanford bunny. A sample of the whole surface is measured
where it is met at no more than an angle from its normal, from 20 to 70 degrees. Asked
is a share of what some candidate measures. Prints the views of the plan, which fresh
samples confirm; the fewest found on the planner's own samples, and what greedy takes of
the same candidates there, and then until the samples of the plan's claims confirm it,
too; what is proved; and how many claims the audit finds false.
"""

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from support import shared_meshes

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from planning.cameras.stations.heads.head_cover import HeadSets
from planning.cameras.stations.heads.head_poses import HeadSource, widened
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.pipeline import plan_rig
from planning.report.partial_plan import PlanRequest
from planning.rig.rig import Rig, load_rig
from planning.rig.wishes import Wishes
from planning.scene.draws import DRAWS
from planning.steps.prepare import prepared
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
        "| angle [deg] | asked | views | greedy, confirmed "
        "| on its samples | greedy on them "
        "| least: candidates | all poses "
        "| candidates | samples | proof | measured of the target | false | seconds |"
    )
    print("|" + 14 * "---|")
    well = True
    for angle in [int(word) for word in sys.argv[1:]] or _ANGLES_DEG:
        limits = {
            "projector_max_incidence_deg": float(angle),
            "camera_max_incidence_deg": float(angle),
        }
        for share in _SHARES:
            begin, limited = time.perf_counter(), rig.replace(limits=limits)
            asked: dict[str, Any] = {
                "max_heads": _MANY,
                "target": "surface",
                "dominant_coverage": share,
                "coverage": share,
                "min_reachable": 0.01,
            }
            plan = plan_rig(mesh, limited, check=False, on_miss="return", **asked)
            seconds = time.perf_counter() - begin
            greedy = _confirmed(mesh, limited, plan, asked)
            well &= _row(angle, share, plan, greedy, seconds)
    return int(not well)


def _confirmed(
    mesh: TriangleMesh, rig: Rig, plan: RigPlan, asked: dict[str, Any]
) -> int:
    """How many of the plan's candidates greedy takes until fresh samples confirm them.

    Those of the plan's claims; each time that which adds most of the planner's samples,
    and once these are served of the fresh ones.
    """
    lamps = sum(asked["max_heads"] for _ in rig.head.projectors) if rig.head else 0
    wishes = Wishes(max_projectors=lamps, pattern="dense", **asked)
    ready = prepared(PlanRequest(mesh, rig, wishes), Stopwatch())
    space, head, told = ready.scene.requirements.workspace, rig.head, plan.document
    assert head is not None
    assert told.stations is not None
    scene = ready.scene.within(widened(space, head))
    source = HeadSource(scene, head, space, ready.templates, ready.cameras)
    device = np.linalg.inv(head.projectors[0].head_from_device)
    poses = plan.surface.reference_projectors[len(told.stations.stations) :] @ device
    heads = [source.at(pose) for pose in poses]
    fresh = HeadSets.of(scene, heads, scene.target_samples(DRAWS.claims))
    draws = [DRAWS.cameras, *(DRAWS.fresh_cameras.later(1 + k) for k in range(4))]
    assert told.stations.count is not None
    own = HeadSets.of(scene, heads, scene.target_samples(draws[0]))
    for draw in draws[1:]:
        if len(own.target) >= told.stations.count.n_samples:
            break
        own = own.with_samples(HeadSets.of(scene, heads, scene.target_samples(draw)))
    chosen: list[int] = []
    for sets in (own, fresh):
        for covers in (sets.lit, sets.measured):
            least = asked["coverage"] * np.any(covers, axis=1).sum()
            while (served := covers[:, chosen].any(axis=1)).sum() < least:
                chosen.append(int(np.argmax(covers[~served].sum(axis=0))))
    return len(chosen)


def _row(angle: int, share: float, plan: RigPlan, greedy: int, seconds: float) -> bool:
    """Print a line; return whether greedy takes no fewer and no claim is false."""
    told, areas = plan.document.stations, plan.coverage.target
    assert told is not None
    count = told.count
    assert count is not None
    false = len(audit_plan(plan).failures)
    print(
        f"| {angle} | {share:.0%} | {count.count} | {greedy} "
        f"| {count.needed} | {count.greedy} "
        f"| {count.lower_bound} | {count.everywhere} | {count.n_candidates} "
        f"| {count.n_samples} | {count.proof} "
        f"| {areas.measured_m2 / areas.area_m2:.1%} | {false} | {seconds:.0f} |",
        flush=True,
    )
    fewer = count.greedy is None or count.needed <= count.greedy
    return not false and fewer and count.count <= greedy


if __name__ == "__main__":
    sys.exit(main())
