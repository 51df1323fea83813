"""The fewest images of a board, one after the other, that calibrate a rig well enough.

With K what is known before and I_b what an image tells, errors have the covariance (K +
sum I_b)^-1, and points A of them. One image must be dispensable, for else nothing would
show that it was taken badly: of the images so far the one without which most is left is
set aside, and the next is the one that then leaves the least mean square of the points'
errors (A-optimal), until 95 % of the points are as exact as they must be, whichever
image is set aside and what edge noise does included. Greedy, so the number may not be
the least.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.plan import RigPlan

from .board import Board, board_poses
from .device_errors import N_ERRORS, known_before
from .information import BoardImage, board_image
from .point_errors import PointErrors, point_errors

N_SAMPLES = 2000
MOST_IMAGES = 40


@dataclass(frozen=True, eq=False)
class BoardPlan:
    """Images of a board and what they leave.

    Attributes:
        board: What is held.
        mark_px: Deviation of a mark's position in an image, or on a panel [px].
        limit_m: What 95 % of the points must keep.
        images: In the order of their choice.
        left_m: Root mean square of what they leave of points' errors, without noise.
        p95_m: What 95 % of the points deviate by at most, noise included.
        p95_without_m: Likewise, the worst image set aside.
        points: What errors of devices do.
        covariance: Of the errors of all devices, projectors first, without a motion of
            the whole rig, (10 d, 10 d).
    """

    board: Board
    mark_px: float
    limit_m: float
    images: tuple[BoardImage, ...]
    left_m: float
    p95_m: float
    p95_without_m: float
    points: PointErrors
    covariance: Array

    @property
    def suffices(self) -> bool:
        """Whether the points keep the limit with any one image set aside."""
        return self.p95_without_m <= self.limit_m

    def left_of(self, k: int) -> CalibrationErrors:
        """Return the deviations of device k, each by itself, as a rig file has them.

        They go with each other, so they do less to points than if they didn't.
        """
        rows = np.diag(self.covariance)[N_ERRORS * k : N_ERRORS * (k + 1)]
        return CalibrationErrors(
            float(np.sqrt(rows[:3].sum())),
            float(np.sqrt(rows[3:6].sum())),
            float(np.sqrt(rows[6])),
            float(np.sqrt(rows[7:9].sum())),
        )

    @property
    def stated_share(self) -> float | None:
        """What these images leave of points' errors, of what the plan counts on.

        `[calibration]` times this does as much to points; None: it states none.
        """
        stated = float(np.sqrt(np.mean(self.points.stated_m**2)))
        return self.left_m / stated if stated > 0.0 else None


def plan_images(
    plan: RigPlan,
    board: Board,
    *,
    mark_px: float,
    limit_m: float,
    threads: int,
    report: Callable[[str], None],
) -> BoardPlan:
    """Choose images for a plan.

    Raises:
        PlanFileError: If it measures nothing of its target.
    """
    devices, space = (*plan.projectors, *plan.cameras), plan.requirements.workspace
    points = point_errors(plan, n_samples=N_SAMPLES, threads=threads)
    by_errors, settled = points.settled(devices)
    marks = board.points()
    poses = board_poses(
        np.array(space.centre), space.object_radius_m, np.array(space.up)
    )
    offered = [
        board_image(devices, plan.requirements, pose, marks, mark_px) for pose in poses
    ]
    offered = [image for image in offered if image.marks.any()]
    weight = by_errors.T @ by_errors / len(by_errors)

    def variances(information: Array) -> Array:
        covariance = _inverse(information)
        return np.einsum("ni,ij,nj->n", by_errors, covariance, by_errors)

    def p95(information: Array) -> float:
        whole = variances(information) + points.noise_m**2
        return float(np.sqrt(np.quantile(whole, 0.95)))

    before, chosen = known_before(devices), []
    while True:
        known = before + sum(image.told for image in chosen)
        without = [known - image.told for image in chosen] or [known]
        ends = [p95(information) for information in without]
        report(f"{len(chosen)} images leave {1e3 * max(ends):.3f} mm without one")
        if max(ends) <= limit_m or len(chosen) == MOST_IMAGES or not offered:
            break
        short = without[int(np.argmax(ends))]
        left = [np.sum(_inverse(short + image.told) * weight) for image in offered]
        chosen.append(offered.pop(int(np.argmin(left))))
    return BoardPlan(
        *(board, mark_px, limit_m, tuple(chosen)),
        *(float(np.sqrt(variances(known).mean())), p95(known), max(ends)),
        *(points, settled @ _inverse(known) @ settled.T),
    )


def _inverse(information: Array) -> Array:
    """Invert, scaled: turns and pixels differ by orders of magnitude."""
    scale = 1.0 / np.sqrt(np.diag(information))
    return np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
