"""Errors of merged clouds against their own `sigma`, in each decile of it.

Plans are rendered with the panel's pixels, sensor noise, texture and room light,
decoded and merged; errors are distances from the mesh. Points that may lie in a step
between surfaces say so (their sigma is of a point anywhere between two rings) and are
counted apart. For each plan (the README's own if none is named):

    python -m benchmarks.pixels.cloud_sigma [DIR/plan.json ...]
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planning import load_mesh, load_rig, plan_rig
from planning.model.plan import RigPlan
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.check.accuracy import measure_accuracy, shown_inside
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.scanner import Scanner

ROOT = Path(__file__).resolve().parents[2]
_FALSE_M = 1e-3
# Deviation of an edge's place that noise alone doesn't reach [px].
_STEP_PX = 0.5


@dataclass(frozen=True, eq=False)
class OverSigma:
    """Errors of the points that a cloud is sure of, in the order of their sigma [m].

    Attributes:
        error: Distance from the mesh, shape (n,).
        sigma: What the point says, shape (n,).
        steps: Share of all points with a sigma that may be steps, and aren't here.
    """

    error: Array
    sigma: Array
    steps: float

    @classmethod
    def of(cls, found: Reconstruction, plan: Scanner) -> "OverSigma":
        """Return them without points of the inside of an open mesh."""
        cloud, sigma = found.merged.cloud, found.merged.sigma
        places = [camera.centre for camera in plan.cameras]
        known = np.isfinite(sigma) & ~shown_inside(cloud, places, plan.mesh)
        step = cloud.noise_px > _STEP_PX
        rows = np.flatnonzero(known & ~step)
        rows = rows[np.argsort(sigma[rows], kind="stable")]
        error = measure_accuracy(cloud.take(rows), plan.mesh).distances
        return cls(error, sigma[rows], float(step[known].mean()))

    @property
    def ratio(self) -> float:
        """Root mean square of error / sigma."""
        return float(np.sqrt(np.mean((self.error / self.sigma) ** 2)))

    @property
    def deciles(self) -> str:
        """That of each tenth of the points."""
        parts = np.array_split(self.error / self.sigma, 10)
        return " ".join(f"{np.sqrt(np.mean(part**2)):.2f}" for part in parts)


def line(name: str, plan: RigPlan) -> str:
    """Return a row of the table."""
    scanner = Scanner.of(plan)
    found = reconstruct(scanner, seed=0, threads=1)
    assert found.accuracy is not None
    sure = OverSigma.of(found, scanner)
    return (
        f"| {name} | {len(found.accuracy)} | {1e3 * found.accuracy.rms_m:.3f} | "
        f"{1e3 * np.median(sure.sigma):.3f} | {sure.deciles} | {sure.ratio:.2f} | "
        f"{sure.steps:.1%} | {found.left_out_fraction:.1%} | "
        f"{found.accuracy.beyond(_FALSE_M):.3%} |"
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
