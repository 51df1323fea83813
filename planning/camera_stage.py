"""Cameras and ring axes together: each is best only given the other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .camera_spread import spread_cameras
from .cameras import CameraStage, lit_samples, measured_by, plan_cameras
from .plan import PlannedCamera, PlannedProjector
from .ring_axes import turn_ring_axes
from .scene import Scene

_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class CameraSolution:
    """Cameras as placed, and the projectors with their ring axes turned for them.

    Attributes:
        projectors: With the ring axes that the cameras were chosen for.
        stage: Candidates, cover and certificate, for exactly these ring axes.
    """

    projectors: tuple[PlannedProjector, ...]
    stage: CameraStage


@dataclass(frozen=True, eq=False)
class Spread:
    """Cameras slid apart to the largest baselines that the coverage allows.

    Attributes:
        cameras: As moved.
        smallest_before_m: Smallest baseline of neighbours before, None for one camera.
        smallest_after_m: The same after.
    """

    cameras: tuple[PlannedCamera, ...]
    smallest_before_m: float | None
    smallest_after_m: float | None


def place_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    template: PlannedCamera,
    n_candidates: int,
    tilt: float,
) -> CameraSolution:
    """Choose cameras, turn the ring axes for them, and choose again until it settles.

    A later round counts only if it needs no more cameras and measures no less, so the
    certificate always belongs to the ring axes that are kept.

    Args:
        scene: Surface and requirements.
        projectors: As planned.
        template: Optics of the camera.
        n_candidates: Poses offered.
        tilt: Tilt of the ring axes, or their shift.
    """
    best = CameraSolution(
        tuple(projectors), plan_cameras(scene, projectors, template, n_candidates)
    )
    for _ in range(_ROUNDS):
        rows = best.stage.rows
        turned = turn_ring_axes(
            scene, best.projectors, best.stage.cameras, rows, tilt
        )
        if all(a is b for a, b in zip(turned, best.projectors, strict=True)):
            break
        stage = plan_cameras(scene, turned, template, n_candidates)
        if not _better(stage, best.stage):
            break
        best = CameraSolution(turned, stage)
    return best


def spread(scene: Scene, solution: CameraSolution) -> Spread:
    """Slide the cameras of a solution apart; no move that loses coverage is taken."""
    cameras = solution.stage.cameras
    rows = solution.stage.rows
    required = int(round(_required_rows(solution.stage)))

    def moved(poses: NDArray[np.float64]) -> tuple[PlannedCamera, ...]:
        return tuple(
            replace(camera, world_from_device=pose)
            for camera, pose in zip(cameras, poses, strict=True)
        )

    def evaluate(poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        return measured_by(scene, moved(poses), rows)

    raise NotImplementedError((required, evaluate, lit_samples, spread_cameras))


def _required_rows(stage: CameraStage) -> float:
    certificate = stage.certificate
    return certificate["required_m2"] / stage.rows.target.samples.weight


def _better(new: CameraStage, old: CameraStage) -> bool:
    a, b = new.certificate, old.certificate
    counts = (a["needed"]["count"], b["needed"]["count"])
    if counts[0] != counts[1]:
        return counts[0] < counts[1]
    return a["best_area"]["value_m2"] > b["best_area"]["value_m2"]
