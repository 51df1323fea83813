"""What a plan does about a calibration, before and after it is stated.

Of the sample, a face scan and two parts of `../shared/data/meshes`: a plan whose rig
states no calibration, and one whose `[calibration]` is 0.02 degrees and 0.05 mm with
`--accuracy 0.3` (`base = "default"`, nothing else). Printed of each are devices, the
angle between view and light where points are measured best (median, 5 % of them), what
is predicted, the dearest camera (turned by 0.02 degrees about the worst of its axes:
rms along the normals over the target and over what it measures best, by exact
triangulation), what drawn rigs of that calibration measure, edge noise included (median
over the rigs of their rms, and rms of all), and the seconds of planning.

    PYTHONPATH=.:tests python -m benchmarks.pixels.calibrated_plans [MESH ...]
"""

import sys
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from support.simulated_rigs import ONE_EACH, off_by, triangulated

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.pixels.calibration_deciles import BestPairs
from planning import RequirementError, load_mesh, load_rig, plan_rig
from planning.model.devices.calibration_errors import PERFECT
from planning.model.plan import RigPlan
from planning.rig.rig import Rig
from planning.rig.rig_tables import CalibrationTable

NAMES = ("face.obj", "face_scan_james.obj", "tm_fixed_top.ply", "tm_reference.obj")
STATED = CalibrationTable(angle_deg=0.02, position_mm=0.05)
_TURN = np.radians(0.02)
_RIGS, _SEED, MANY = 100, 7, 20


@dataclass(frozen=True, eq=False)
class Found:
    """A plan and its best pairs, with the calibration counted."""

    plan: RigPlan
    pairs: BestPairs
    seconds: float

    def angles(self) -> NDArray[np.float64]:
        """Return the angle between view and light of each best pair [degrees]."""
        between = np.zeros(len(self.pairs.points))
        for k, point in enumerate(self.pairs.points):
            camera = self.plan.cameras[self.pairs.camera[k]]
            source = self.plan.projectors[self.pairs.projector[k]]
            a, b = (
                point - device.world_from_device[:3, 3] for device in (camera, source)
            )
            cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
            between[k] = np.degrees(np.arccos(cosine))
        return between

    def dearest_turn(self) -> tuple[float, float]:
        """Return what turning one camera costs the target, at most, rms [m].

        Then what it costs the points that this camera measures best.
        """
        target = own = 0.0
        for c, camera in enumerate(self.plan.cameras):
            for turn in _TURN * ONE_EACH[:3]:
                square, n = 0.0, 0
                for p, source in enumerate(self.plan.projectors):
                    rows = (self.pairs.projector == p) & (self.pairs.camera == c)
                    points = self.pairs.points[rows]
                    if not len(points):
                        continue
                    there = triangulated(
                        *(points, source, camera),
                        *((source, np.zeros(3)), off_by(camera, turn)),
                    )
                    along = np.sum((there - points) * self.pairs.normals[rows], axis=1)
                    square, n = square + np.nansum(along**2), n + len(points)
                target = max(target, np.sqrt(square / len(self.pairs.points)))
                own = max(own, np.sqrt(square / n) if n else 0.0)
        return float(target), float(own)

    def drawn(self) -> NDArray[np.float64]:
        """Return the rms of each drawn rig [m]."""
        rng, stated = np.random.default_rng(_SEED), STATED.errors() or PERFECT
        rigs = [self.pairs.errors(self.plan, stated, rng) for _ in range(_RIGS)]
        return np.sqrt(np.nanmean(np.square(rigs), axis=1))


def stated_rig(calibration: CalibrationTable) -> Rig:
    """Return the default rig with a calibration."""
    rig = load_rig("default")
    table = rig.table.model_copy(update={"calibration": calibration})
    return replace(rig, table=table)


def planned(job: tuple, calibration: CalibrationTable) -> Found:
    """Plan a mesh with a calibration, and look at its pairs with the stated one."""
    path, options, up = job
    rig = stated_rig(calibration)
    start = time.process_time()
    wishes = {"max_projectors": MANY, "accuracy_mm": 0.3, "up": up, "check": False}
    try:
        plan = plan_rig(load_mesh(path, **options), rig, **wishes)
    except RequirementError as error:
        plan = error.plan
    seconds = time.process_time() - start
    document = plan.to_document()
    document["requirements"]["triangulation"] |= {
        "calibration": vars(STATED.errors()),
        "accuracy_of": "noise" if calibration.errors() is None else "total",
    }
    counted = RigPlan.from_document(document, plan.surface)
    return Found(counted, BestPairs.of(counted), seconds)


def main(names: list[str]) -> None:
    """Print the table."""
    print(
        "| mesh | calibration | projectors + cameras | view to light, median, 5 % "
        "[degrees] | predicted, median, 95 % [mm] | dearest camera turned, of the "
        "target, of its own points [mm] | "
        f"{_RIGS} drawn rigs: median rms, rms [mm] | planned [s] |"
    )
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for job in jobs(names or list(NAMES)):
        for said, calibration in (
            ("not stated", CalibrationTable()),
            ("stated", STATED),
        ):
            found = planned(job, calibration)
            angles, rigs = found.angles(), found.drawn()
            total = 1e3 * np.quantile(found.pairs.total, (0.5, 0.95))
            turned = ", ".join(f"{1e3 * each:.3f}" for each in found.dearest_turn())
            counts = len(found.plan.projectors), len(found.plan.cameras)
            print(
                f"| {job[0].name} | {said} | {counts[0]} + {counts[1]} | "
                f"{np.median(angles):.1f}, {np.quantile(angles, 0.05):.1f} | "
                f"{total[0]:.3f}, {total[1]:.3f} | {turned} | "
                f"{1e3 * np.median(rigs):.3f}, "
                f"{1e3 * np.sqrt(np.mean(rigs**2)):.3f} | {found.seconds:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
