"""Plan the sample in three rigs with obstacles, and without these, beside each other.

Usage: python -m benchmarks.plans.obstacles [--pictures FOLDER] [--threads N]

The rigs are `docs/use/rigs/*.toml`. Each plan is checked from pixels, `plan verify`
audits it, and rays of trimesh are cast to every measured sample, from the projectors
that light it and the cameras that measure it: none may meet an obstacle. Prints a
table; returns 1 if a ray meets one or an audit fails.
"""

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from geometry.files.interchange import to_trimesh
from planning import RequirementError, Rig, RigPlan, load_mesh, load_rig, plan_rig
from planning.report.drawing.face_colours import face_status
from planning.report.drawing.picture_view import save_picture
from planning.report.drawing.rig_picture import draw_rig
from planning.verify.audit.audit import audit_plan

ROOT = Path(__file__).resolve().parents[2]
RIGS = ROOT / "docs" / "use" / "rigs"
# Rays that end this near before a sample may touch what it lies on [m].
CONTACT_M = 1e-4


def arm() -> trimesh.Trimesh:
    """The robot's arm of `cell.toml` in millimetres: column, upper arm, forearm."""
    ends = [((0, 0, 0), (0, 0, 700)), ((0, 0, 700), (-150, 0, 1150))]
    ends.append(((-150, 0, 1150), (-420, 0, 1000)))
    parts = [
        trimesh.creation.cylinder(radius=radius, segment=np.array(both), sections=24)
        for radius, both in zip((90.0, 70.0, 45.0), ends, strict=True)
    ]
    return trimesh.util.concatenate(parts)


def best(rig: Rig, threads: int) -> tuple[RigPlan, float]:
    """The plan of the sample, and the seconds that it took."""
    begin, mesh = time.monotonic(), load_mesh(ROOT / "face.obj")
    try:
        plan = plan_rig(mesh, rig, max_projectors=6, threads=threads)
    except RequirementError as missed:
        plan = missed.plan
    return plan, time.monotonic() - begin


def blocked_rays(plan: RigPlan) -> tuple[int, int]:
    """Light to measured samples and views of them that meet an obstacle, and all."""
    actual = audit_plan(plan, n_samples=4000).case.actual
    solid = trimesh.util.concatenate(
        [to_trimesh(each.mesh) for each in plan.surface.obstacles]
    )
    met = n = 0
    for device, ends in (
        *zip(plan.projectors, actual.lit_by & actual.measured, strict=True),
        *zip(plan.cameras, actual.measured_by, strict=True),
    ):
        start, points = device.world_from_device[:3, 3], actual.samples.points[ends]
        ways = points - start
        length = np.linalg.norm(ways, axis=1)
        spots, ray, _ = solid.ray.intersects_location(
            np.broadcast_to(start, ways.shape), ways / length[:, None]
        )
        reach = np.linalg.norm(spots - start, axis=1)
        met += len(set(ray[reach < length[ray] - CONTACT_M].tolist()))
        n += len(points)
    return met, n


def row(name: str, plan: RigPlan, seconds: float) -> str:
    """A line of the table."""
    areas, check = plan.coverage.target, plan.document.reconstruction
    proofs = plan.document.certificates
    counts = [
        f"{proof.count} (>= {proof.continuous.lower_bound if proof.continuous else 1})"
        for proof in (proofs.projectors, proofs.cameras)
    ]
    blocked = ", ".join(
        f"{who} {1e4 * area:.2f}"
        for who, area in plan.coverage.blocked_by_obstacle_m2.items()
    )
    whole = areas.area_m2
    shares = (areas.reachable_by_projectors_m2, areas.lit_m2, areas.measured_m2)
    rms = check.accuracy_rms_m if check is not None else None
    cells = [
        name,
        *counts,
        *(f"{100 * share / whole:.1f}" for share in shares),
        blocked or "-",
        "-" if rms is None or check is None else f"{1e3 * rms:.3f}, {check.passed}",
        f"{seconds:.0f}",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    if not (RIGS / "arm.obj").exists():
        arm().export(RIGS / "arm.obj", include_normals=False, header=None)
    print(
        "| rig | projectors (over all poses) | cameras | reachable [%] | lit "
        "| measured | unmeasured behind [cm²] | rms [mm], check | seconds |\n"
        "|---|---|---|---|---|---|---|---|---|"
    )
    failed = False
    for name in ("cell", "booth", "bench"):
        rig = load_rig(RIGS / f"{name}.toml")
        bare = replace(rig, table=rig.table.model_copy(update={"obstacle": []}))
        plan, seconds = best(rig, options.threads)
        print(row(name, plan, seconds), flush=True)
        print(row(f"{name}, without", *best(bare, options.threads)), flush=True)
        met, n = blocked_rays(plan)
        with tempfile.TemporaryDirectory() as folder:
            plan.save(Path(folder) / "plan.json")
            again = audit_plan(RigPlan.load(Path(folder) / "plan.json"))
        failed = failed or met > 0 or bool(again.failures)
        print(
            f"<!-- {met} of {n} rays of light and of sight meet an obstacle; "
            f"{again.failures} -->"
        )
        if options.pictures is not None:
            picture = draw_rig(plan, face_status=face_status(plan))
            small = picture.resize((1000, 625)).quantize(192, dither=Image.Dither.NONE)
            save_picture(small, options.pictures / f"obstacles_{name}.png")
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
