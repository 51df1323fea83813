"""Errors of merged clouds against their own `sigma`, in each decile of it.

Plans are rendered with the panel's pixels, sensor noise, texture and room light,
decoded and merged; errors are distances from the mesh. Points that may lie in a step
between surfaces say so (their sigma is of a point anywhere between two rings) and are
counted apart. For each plan (the README's own if none is named):

    python -m benchmarks.pixels.cloud_sigma [DIR/plan.json ...]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from planning import load_mesh, load_rig, plan_rig
from planning.model.plan import RigPlan
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.scanner import Scanner

ROOT = Path(__file__).resolve().parents[2]
_FALSE_M = 1e-3
# Deviation of an edge's place that noise alone doesn't reach [px].
_STEP_PX = 0.5


def line(name: str, plan: RigPlan) -> str:
    """Return a row of the table."""
    found = reconstruct(Scanner.of(plan), seed=0, threads=1)
    assert found.accuracy is not None
    error, sigma = found.accuracy.distances, found.merged.sigma
    step = found.merged.cloud.noise_px > _STEP_PX
    known = np.isfinite(sigma) & ~step
    order = np.argsort(sigma[known])
    ratio = (error[known] / sigma[known])[order]
    deciles = " ".join(
        f"{np.sqrt(np.mean(part**2)):.2f}" for part in np.array_split(ratio, 10)
    )
    return (
        f"| {name} | {len(error)} | {1e3 * found.accuracy.rms_m:.3f} | "
        f"{1e3 * np.median(sigma[known]):.3f} | {deciles} | "
        f"{np.sqrt(np.mean(ratio**2)):.2f} | {step.mean():.1%} | "
        f"{found.left_out_fraction:.1%} | {np.mean(np.abs(error) > _FALSE_M):.3%} |"
    )


def main(paths: list[str]) -> None:
    """Print the table."""
    print(
        "| plan | points | rms [mm] | sigma, median | error / sigma by decile | all | "
        "may be steps | left out | beyond 1 mm |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for path in paths:
        print(line(Path(path).parent.name, RigPlan.load(path)), flush=True)
    if not paths:
        mesh, rig = load_mesh(ROOT / "face.obj"), load_rig("default")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plan.json"
            plan_rig(mesh, rig, max_projectors=3, seed=0).save(path)
            print(line("README", RigPlan.load(path)))


if __name__ == "__main__":
    main(sys.argv[1:])
