"""Predicted deviation against rigs that are off as their calibration says.

The sample is planned with `accuracy_of` noise, so that deviations differ widely. Then
rigs are drawn: every device turned, moved, its focal length and principal point off, by
normal deviates of the stated size, and every edge by the edge noise. Each sample is
triangulated anew by its best pair, as if the rig stood as planned and without any
linearisation. Printed is rms of error / predicted in each decile of the prediction,
over rigs and samples, of noise alone and with the calibration, and how often the ray
passed its ring by, so that there was no point.

    PYTHONPATH=.:tests python -m benchmarks.pixels.calibration_deciles [rigs, else 200]
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from support.simulated_rigs import off_by, scales, triangulated

from geometry.files.readers import load_mesh
from planning import RequirementError, load_rig, plan_rig
from planning.model.devices.calibration_errors import PERFECT, CalibrationErrors
from planning.model.plan import RigPlan
from planning.rig.rig_tables import CalibrationTable
from planning.scene.draws import Draw
from planning.scene.measuring.camera_views import view_of
from planning.scene.measuring.measured import lit_samples, pairs_of
from planning.scene.scene import Scene

_Array = NDArray[np.float64]
STATED = CalibrationTable(
    angle_deg=0.02, position_mm=0.05, focal_percent=0.02, principal_px=0.3
)
_SAMPLES, _SEED = 4000, 7


@dataclass(frozen=True, eq=False)
class BestPairs:
    """The best pair of each of n measured samples, and what is predicted of it [m]."""

    points: _Array
    normals: _Array
    projector: NDArray[np.int64]
    camera: NDArray[np.int64]
    incidence_cos: _Array
    noise: _Array
    total: _Array

    @classmethod
    def of(cls, plan: RigPlan) -> "BestPairs":
        """Look at fresh samples of the target."""
        surface = plan.surface
        scene = Scene(
            *(surface.mesh, surface.region, surface.steep, plan.requirements),
            seed=_SEED,
            threads=2,
        )
        lit = lit_samples(
            scene, plan.projectors, scene.target_samples(Draw(_SAMPLES, 9))
        )
        n = len(lit.target)
        figures, best = np.zeros((3, n)), np.full((2, n), -1)
        least = np.full(n, np.inf)
        # Rigs are drawn, and edges; what the panel's pixels do stays out of both sides.
        limits = replace(plan.requirements.triangulation, drawn_edges=None)
        for c, camera in enumerate(plan.cameras):
            view = view_of(scene, camera, lit.target)
            for pair in pairs_of(limits, lit, view):
                total = np.where(pair.measured, pair.quality.total, np.inf)
                better = np.flatnonzero(total < least[pair.samples])
                rows = pair.samples[better]
                least[rows], best[:, rows] = total[better], [[pair.projector], [c]]
                light = pair.quality.light.incidence_cos[better]
                edges = pair.quality.terms["edges"][better]
                figures[:, rows] = light, edges, total[better]
        some = best[0] >= 0
        samples = lit.target.samples
        return cls(
            samples.points[some],
            samples.normals[some],
            *best[:, some],
            *figures[:, some],
        )

    def errors(
        self, plan: RigPlan, stated: CalibrationErrors, rng: np.random.Generator
    ) -> _Array:
        """Return the errors along the normals in one drawn rig [m], (n,)."""
        size = scales(stated)
        projectors, cameras = (
            [off_by(device, size * rng.standard_normal(9)) for device in devices]
            for devices in (plan.projectors, plan.cameras)
        )
        noise = plan.requirements.triangulation.noise_px / self.incidence_cos
        shift = noise[:, None] * rng.standard_normal((len(self.points), 2))
        errors = np.zeros(len(self.points))
        for p, projector in enumerate(plan.projectors):
            for c, camera in enumerate(plan.cameras):
                rows = np.flatnonzero((self.projector == p) & (self.camera == c))
                if not len(rows):
                    continue
                points = self.points[rows]
                there = triangulated(
                    *(points, projector, camera, projectors[p], cameras[c]),
                    noise_px=shift[rows],
                )
                moved = (there - points) * self.normals[rows]
                errors[rows] = moved.sum(axis=1)
        return errors


def by_decile(square: _Array, predicted: _Array) -> _Array:
    """Return the rms of error / predicted in each decile of the prediction, (10,)."""
    order = np.array_split(np.argsort(predicted), 10)
    ratio = square / predicted**2
    return np.sqrt([ratio[rows].mean() for rows in order])


def main(n_rigs: int) -> None:
    """Print the deciles."""
    table = load_rig("default").table
    rig = replace(
        load_rig("default"), table=table.model_copy(update={"calibration": STATED})
    )
    try:
        plan = plan_rig(
            *(load_mesh(Path("face.obj")), rig),
            max_projectors=3,
            accuracy_of="noise",
            check=False,
        )
    except RequirementError as error:
        plan = error.plan
    pairs = BestPairs.of(plan)
    print(f"face.obj, {len(pairs.points)} samples of the target, {n_rigs} rigs")
    print(
        "| errors | predicted, median [mm] | error / predicted by decile | all | "
        "ring missed |"
    )
    print("|---|---|---|---|---|")
    for name, stated, predicted in (
        ("edge noise alone", PERFECT, pairs.noise),
        ("with calibration", STATED.errors() or PERFECT, pairs.total),
    ):
        rng = np.random.default_rng(_SEED)
        drawn = [pairs.errors(plan, stated, rng) ** 2 for _ in range(n_rigs)]
        square, lost = np.nanmean(drawn, axis=0), np.isnan(drawn).mean()
        parts = " ".join(f"{part:.2f}" for part in by_decile(square, predicted))
        whole = np.sqrt(np.mean(square / predicted**2))
        middle = 1e3 * np.median(predicted)
        print(f"| {name} | {middle:.3f} | {parts} | {whole:.3f} | {100 * lost:.2f} % |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
