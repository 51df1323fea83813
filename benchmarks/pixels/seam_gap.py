"""Eq. (10) at image level: two cameras over a wall, moved apart past d'_max.

f = 8000 px, 1280 columns, 1 m, rings 0.75 mm apart (pitch 6 px): the images meet at
d'_max = C1 + C2. Both cameras' pixels are rendered, decoded and triangulated; the hole
is the widest stretch across the seam without a point.

    python -m benchmarks.pixels.seam_gap
"""

import numpy as np
from numpy.typing import NDArray
from support import reconstruction_rigs
from support.plain_shapes import grid
from support.reconstruction_rigs import reconstruct_plan

from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import look_at
from planning.cameras.baselines.baseline_rows import half_field
from planning.model.plan import RigPlan
from planning.verify.reconstruction.check.result import Reconstruction

RIGS = reconstruction_rigs
FOCAL, RESOLUTION = 8000.0, (1280, 180)
STANDOFF = 1.0
GAP = 0.75e-3
# Samples lie within one ring gap of the seam, and along the image's height.
_HALF_WIDTH, _HALF_HEIGHT = GAP, 8e-3
_NEAR = 0.03
_UP = np.array([0.0, 1.0, 0.0])


def wall_rig(baseline: float) -> RigPlan:
    """Return two cameras square to a wall, so far apart in [m], and one projector."""
    plan = RIGS.plan_of(
        grid(0.4, 0.12, divisions=(8, 4)),
        [_projector()],
        [_camera("C1", -0.5 * baseline), _camera("C2", 0.5 * baseline)],
    )
    document = plan.to_document()
    document["requirements"]["check"] = RIGS.CHECK | {"tau_m": GAP}
    return RigPlan.from_document(document, plan.surface)


def predicted_limit() -> float:
    """Return d'_max = C1 + C2 as a plan's rows have it [m]."""
    one, two = wall_rig(0.1).cameras
    inwards = np.array([[1.0, 0.0, 0.0]])
    ahead = np.array([[0.0, 0.0, -1.0]])
    extents = [
        STANDOFF * float(np.tan(half_field(camera, ahead, side, np.zeros(1))[0]))
        for camera, side in ((one, inwards), (two, -inwards))
    ]
    return extents[0] + extents[1]


def seam_samples() -> tuple[SurfaceSamples, NDArray[np.bool_]]:
    """Return samples about the seam, all of which are said to be measured."""
    x, y = np.meshgrid(
        np.linspace(-_HALF_WIDTH, _HALF_WIDTH, 81),
        np.linspace(-_HALF_HEIGHT, _HALF_HEIGHT, 81),
    )
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    samples = SurfaceSamples(points, normals, np.zeros(len(points), np.int64), 1.0)
    return samples, np.ones(len(points), dtype=bool)


def check(baseline: float) -> Reconstruction:
    """Reconstruct the wall; samples about the seam are those predicted measured."""
    samples, every = seam_samples()
    return reconstruct_plan(
        wall_rig(baseline), seed=0, threads=1, samples=samples, predicted=every
    )


def hole(found: Reconstruction) -> float:
    """Return the widest stretch along x about the seam without a point [m]."""
    x = np.sort(found.everything.points[:, 0])
    return float(np.diff(x[np.abs(x) < _NEAR]).max())


def _camera(name: str, x: float) -> dict:
    position = np.array([x, 0.0, STANDOFF])
    entry = RIGS.camera(name, position, focal=FOCAL)
    pose = look_at(position, position * [1.0, 1.0, 0.0], _UP)
    entry["world_from_device"] = pose.tolist()
    entry["resolution"] = list(RESOLUTION)
    entry["K"][0][2], entry["K"][1][2] = (0.5 * (n - 1.0) for n in RESOLUTION)
    return entry


def _projector() -> dict:
    """Parallel light from below; rings cross the seam squarely, far from their axis."""
    entry = RIGS.parallel("P1", np.array([0.0, 0.0, 1.0]), 0.2, GAP)
    pose = look_at(np.array([0.0, -0.5, 0.9]), np.zeros(3), _UP)
    shift = np.eye(4)
    shift[1, 3] = 0.1
    radii: NDArray[np.float64] = GAP * np.arange(1, 300)
    ring = {"world_from_ring": (pose @ shift).tolist(), "ring_radii": radii.tolist()}
    return entry | {"world_from_device": pose.tolist()} | ring


def main() -> None:
    """Print the table."""
    limit = predicted_limit()
    print(f"predicted d'_max {1e3 * limit:.2f} mm, ring spacing {1e3 * GAP:g} mm")
    print("| d' - d'_max [mm] | hole [mm] | predicted, but missing | check |")
    print("|---|---|---|---|")
    for beyond in (-5.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0, 10.0):
        found = check(limit + 1e-3 * beyond)
        missing = found.completeness.predicted_missing or 0.0
        verdict = "passed" if found.passed else "FAILED"
        print(
            f"| {beyond:+.1f} | {1e3 * hole(found):.2f} | {100 * missing:.2f} % | "
            f"{verdict} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
