"""Does each constraint hold at every sample that a projector is said to light?

Usage: python -m benchmarks.plans.projector_claims [NAME ...] [--lights parallel
    diverging]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any),
at the default requirements: projectors as planned and posed, their poses rounded as
they are written, and 12,000 fresh samples of the target. What the planner says is lit
is held against the audit's predicates (`planning/verify/audit`, which shares none with
the planner): beam, range, incidence, tangent angle and shadow. Printed are the samples
said to be lit, those of them that break a limit by the audit, those that only the audit
calls lit, and the margins of what is lit: the least, and that at the required share.
"""

import argparse
import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs, ready_for
from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from planning.model.devices.device_poses import moved_to, rounded_pose
from planning.model.errors import InfeasibleLimitsError
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import plan_projectors
from planning.projectors.share_margin import margin_at_share
from planning.report.partial_plan import Prepared
from planning.scene.draws import Draw
from planning.scene.lighting import lit_stages
from planning.scene.limits import projector_limits
from planning.scene.samples import Target
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import LIT, light_margin, light_steps

ROWS = 12_000
STREAM = 800


def main() -> int:
    """Print the table; return 1 if a sample said to be lit breaks a limit."""
    given = _arguments()
    print(f"{machine()}\n")
    print(
        "| mesh | faces | light | projectors | lit samples | break a limit | only by "
        "the audit | least margin | at the share | stage [s] |\n"
        "|---|---|---|---|---|---|---|---|---|---|"
    )
    broken = 0
    for path, options, up in jobs(given.names):
        mesh, _ = cut_for_curvature(load_mesh(path, **options))
        for light in given.lights:
            row, false = _row(ready_for(mesh, light, up, None, None))
            print(f"| {path.name} | {len(mesh.faces):,} | {light} | {row}", flush=True)
            broken += false
    print(f"\n{broken} samples said to be lit break a limit")
    return int(broken > 0)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="limits held at samples said lit")
    parser.add_argument("names", nargs="*", metavar="NAME")
    lights = ("parallel", "diverging")
    parser.add_argument("--lights", nargs="+", default=lights, choices=lights)
    return parser.parse_args()


def _row(ready: Prepared) -> tuple[str, int]:
    scene, rig = ready.scene, ready.request.rig
    number = rig.n_projector_poses
    begin = time.perf_counter()
    try:
        stage = plan_projectors(scene, ready.templates, number)
    except InfeasibleLimitsError:
        return "nothing lit |", 0
    posed = widen_margins(scene, stage)
    seconds = time.perf_counter() - begin
    written = [
        replace(
            moved_to(projector, rounded_pose(projector.world_from_device)),
            world_from_ring=rounded_pose(projector.world_from_ring),
        )
        for projector in posed
    ]
    target = scene.target_samples(Draw(ROWS, STREAM))
    said = lit_stages(scene, written, target) == projector_limits.LIT
    samples = _for_the_audit(target)
    shadow = Shadow(scene.mesh, threads=scene.threads)
    limits = scene.requirements.projector
    lamps = [
        AuditProjector(p.device, p.world_from_device, p.world_from_ring, p.ring_radii)
        for p in written
    ]
    found = np.stack(
        [light_steps(lamp, samples, limits, shadow) == LIT for lamp in lamps], axis=1
    )
    margins = np.stack([light_margin(lamp, samples, limits) for lamp in lamps], axis=1)
    margins = np.where(found, margins, -np.inf)
    lit = found.any(axis=1)
    least = np.degrees(margins[lit].max(axis=1).min()) if lit.any() else np.nan
    required = int(stage.certificate.required_m2 / target.samples.weight)
    share = np.degrees(margin_at_share(margins, max(1, min(required, int(lit.sum())))))
    false = int((said & ~found).any(axis=1).sum())
    return (
        f"{len(written)} | {int(said.any(axis=1).sum())} | {false} | "
        f"{int((found & ~said).any(axis=1).sum())} | {least:.2f}° | {share:.2f}° | "
        f"{seconds:.1f} |"
    ), false


def _for_the_audit(target: Target) -> AuditSamples:
    """The same places, as the audit's predicates take them."""
    n, own = len(target), target.samples
    return AuditSamples(
        own.points,
        own.normals,
        own.faces,
        target.steep,
        np.zeros(n, dtype=np.int64),
        np.ones(n, dtype=bool),
        np.full(n, own.weight),
    )


if __name__ == "__main__":
    sys.exit(main())
