"""What centred ring axes cost and save, against free ones, in whole plans.

Usage: python -m benchmarks.paper.ring_axes [NAME ...] [--lights diverging parallel]

Plans the sample and the shared meshes (those named, if any) with at most three
projectors, `--ring-axis` free, centred and auto, each with its check from pixels. For
each plan: what auto took; cameras; rings and frames of all projectors; rings that lie
wholly on the object, and that miss it; the mean share of a ring's azimuth on the
object; what is measured of the lit target, and of the lit surface; the median standard
deviation that is predicted; rms and 95th percentile of the check, and whether it was
passed; false claims that the audit found; processor time.
"""

import argparse
import sys
import time

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.machine import machine
from geometry.files.readers import load_mesh
from planning import RequirementError, RigPlan, load_rig, plan_rig
from planning.rings.acquisition import n_frames
from planning.verify.audit.audit import audit_plan

AXES = ("free", "centred", "auto")
HEAD = (
    *("mesh", "light", "axes", "cameras", "rings", "frames", "wholly on it", "miss it"),
    *("mean share", "measured of lit target", "of lit surface", "median sigma [mm]"),
    *("rms / p95 [mm]", "check", "false claims", "CPU [s]"),
)


def main() -> int:
    """Print the table; return 0."""
    parser = argparse.ArgumentParser(description="ring axes in whole plans")
    parser.add_argument("names", nargs="*", metavar="NAME")
    lights = ("diverging", "parallel")
    parser.add_argument("--lights", nargs="+", default=lights[:1], choices=lights)
    given = parser.parse_args()
    print(f"{machine()}\n")
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    for path, options, up in jobs(given.names):
        mesh = load_mesh(path, **options)
        for light in given.lights:
            for axis in AXES:
                begin = time.process_time()
                try:
                    plan = plan_rig(
                        mesh,
                        load_rig("default", light=light),
                        max_projectors=3,
                        up=up,
                        ring_axis=axis,
                        threads=1,
                    )
                except RequirementError as error:
                    plan = error.plan
                seconds = time.process_time() - begin
                cells = [path.name, light, *_cells(plan, axis), f"{seconds:.0f}"]
                print(f"| {' | '.join(cells)} |", flush=True)
    return 0


def _cells(plan: RigPlan, axis: str) -> list[str]:
    document, areas = plan.document, plan.coverage
    shares = np.concatenate([p.ring_shares.on_object for p in document.projectors])
    check, sigma = document.reconstruction, areas.sigma
    taken = document.ring_axes.taken
    return [
        f"auto: {taken}" if axis == "auto" else axis,
        f"{len(plan.cameras)}",
        f"{len(shares)}",
        f"{n_frames(plan.projectors, len(plan.cameras))}",
        f"{np.count_nonzero(shares == 1.0)}",
        f"{np.count_nonzero(shares == 0.0)}",
        f"{100 * shares.mean():.0f} %",
        f"{100 * areas.target.measured_m2 / areas.target.lit_m2:.1f} %",
        f"{100 * areas.surface.measured_m2 / areas.surface.lit_m2:.1f} %",
        f"{1e3 * sigma.median_m:.3f}",
        f"{1e3 * check.accuracy_rms_m:.3f} / {1e3 * check.accuracy_p95_m:.3f}",
        "passed" if check.passed else "failed",
        f"{len(audit_plan(plan, threads=1).failures)}",
    ]


if __name__ == "__main__":
    sys.exit(main())
