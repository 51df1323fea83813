"""What a plan says of ranges that were estimated: its entry, and rows at two sigma."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from geometry.shapes.best_sphere import BestSphere
from planning.cameras.baselines.baseline_rows import angles_and_fields
from planning.cameras.baselines.coverage_triangle import largest_baseline
from planning.model.devices.planned import PlannedCamera
from planning.model.document.device_records import BaselineRow
from planning.model.document.input_records import (
    EstimatedSphere,
    RangePoint,
    RangesRecord,
    RefusedPoint,
)
from planning.rig.range_guard import Guard
from planning.scene.ranges.ranged_body import SIGNIFICANCE, RangedBody, refusal_line

_Array = NDArray[np.float64]

# Step of the differences by which d_max is derived [m].
_STEP = 1e-5


def ranges_record(body: RangedBody, guard: Guard) -> RangesRecord:
    """Return the plan's `ranges`; `docs/use/ranges.md` defines every key."""
    ball = body.ball
    return RangesRecord(
        path=body.file.path,
        sha256=body.file.sha256,
        significance=SIGNIFICANCE,
        observations=tuple(asdict(o) for o in body.file.observations),
        points=tuple(
            RangePoint(
                point=point.name,
                lines=point.lines,
                position_m=point.estimate.position.tolist(),
                covariance_m2=point.estimate.covariance.tolist(),
                chi_square=point.estimate.chi_square,
                n_free=point.estimate.n_free,
                residual_m=float(residual),
            )
            for point, residual in zip(body.points, ball.residuals, strict=True)
        ),
        refused=tuple(
            RefusedPoint(point=one.name, lines=one.lines, reason=one.reason)
            for one in body.refused
        ),
        sphere=EstimatedSphere(
            centre_m=ball.centre.tolist(),
            radius_m=ball.radius,
            covariance_m2=ball.covariance.tolist(),
            shape_sigma_m=ball.shape_sigma,
            chi_square=ball.chi_square,
        ),
        position_sigma_m=guard.sigma_m,
        guard_m=guard.length_m,
        guard_rad=guard.angle_rad,
        stated=dict(guard.stated),
    )


def ranges_lines(body: RangedBody) -> list[str]:
    """Return what a body was found to be, a line each, for a person."""
    ball = body.ball
    x, y, z = 1e3 * ball.centre
    radius_sigma = 1e3 * np.sqrt(ball.covariance[3, 3])
    lines = [
        f"{len(body.points)} points of {body.file.path}: least-squares sphere of "
        f"radius {1e3 * ball.radius:.1f} +- {radius_sigma:.1f} mm about "
        f"({x:.1f}, {y:.1f}, {z:.1f}) mm",
        f"  surface known to {1e3 * body.position_sigma_m:.1f} mm (1 sigma, where it "
        f"is known worst); points stray from the sphere by "
        f"{1e3 * ball.shape_sigma:.1f} mm",
    ]
    return lines + [f"  {refusal_line(one)}" for one in body.refused]


def with_spread(
    rows: Sequence[BaselineRow],
    cameras: Sequence[PlannedCamera],
    ball: BestSphere,
    guard: Guard,
) -> tuple[BaselineRow, ...]:
    """Return rows of `baselines` with what the uncertainty of E makes of d_max.

    With theta as the rig states it, not tightened, and S_E the covariance of E::

        sigma^2 = grad_E(d_max)^T S_E grad_E(d_max)
        covered at two sigma <=> d < d_max - 2 sigma
    """
    known = {camera.id: camera for camera in cameras}
    stated = float(guard.stated["camera.max_incidence"])
    return tuple(row.changed(**_spread(row, known, ball, stated)) for row in rows)


def _spread(
    row: BaselineRow,
    cameras: dict[str, PlannedCamera],
    ball: BestSphere,
    max_incidence: float,
) -> dict[str, float | bool | None]:
    one, two = (cameras[name] for name in row.cameras)
    point = np.array(row.E)
    steps = _STEP * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    limit = limits_at(one, two, point + steps, row, max_incidence)
    gradient = (limit[1:4] - limit[4:]) / (2.0 * _STEP)
    outward = (point - ball.centre) / np.linalg.norm(point - ball.centre)
    covariance = ball.point_covariances(outward[None])[0]
    sigma = float(np.sqrt(gradient @ covariance @ gradient))
    if not (np.isfinite(sigma) and np.isfinite(limit[0])):
        return dict.fromkeys(
            ("d_max_stated", "d_max_sigma", "covered_at_2_sigma"), None
        )
    return {
        "d_max_stated": float(limit[0]),
        "d_max_sigma": sigma,
        "covered_at_2_sigma": bool(row.d < limit[0] - 2.0 * sigma),
    }


def limits_at(
    one: PlannedCamera,
    two: PlannedCamera,
    points: _Array,
    row: BaselineRow,
    max_incidence: float,
) -> _Array:
    """Return d_max of eq. (9) if the seam of a row were at other points, (n,) [m]."""
    normals = tuple(np.tile(normal, (len(points), 1)) for normal in row.normals)
    angles, _, half2 = angles_and_fields(
        one, two, points, np.array(row.onward), (normals[0], normals[1])
    )
    reach = [
        np.linalg.norm(points - camera.world_from_device[:3, 3], axis=1)
        for camera in (one, two)
    ]
    return largest_baseline(reach[0], reach[1], angles.largest(half2, max_incidence))
