"""Claims of `baselines` at two standard deviations of a seam point."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.document.device_records import BaselineRow
from planning.model.document.input_records import RangesRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_findings import AuditFindings

from .audit_seams import SeamPlane, section_of

_STEP = 3e-5
# Both sides take differences, of different steps, and lengths are good to 0.05 mm.
_LENGTH_M = 2e-4
_SHARE = 0.02
_KINK = 2e-5


def audit_range_rows(
    plan: RigPlan, claimed: RangesRecord, findings: AuditFindings
) -> None:
    """Recompute d_max at the stated limits, its sigma, and the verdict of each row."""
    cameras = {camera.id: camera for camera in plan.cameras}
    for row in plan.document.baselines:
        key = f"baselines.{row.cameras[0]}-{row.cameras[1]}"
        _audit_row(key, row, section_of(row, cameras), claimed, findings)


def _audit_row(
    key: str,
    row: BaselineRow,
    section: SeamPlane,
    claimed: RangesRecord,
    findings: AuditFindings,
) -> None:
    """Check d_max, its sigma and the verdict of one row."""
    largest = claimed.stated["camera.max_incidence"]
    limit = _limit(section, largest)
    gradient = np.array(
        [
            (_at(section, step, largest) - _at(section, -step, largest)) / (2.0 * _STEP)
            for step in _STEP * np.eye(3)
        ]
    )
    d_max, spread, covered = row.d_max_stated, row.d_max_sigma, row.covered_at_2_sigma
    if not (np.isfinite(limit) and np.all(np.isfinite(gradient))):
        none = d_max is None and spread is None and covered is None
        findings.holds(none, key, "d_max at two sigma must be null")
        return
    sigma = float(np.sqrt(gradient @ _spread(section, claimed) @ gradient))
    slack = _SHARE * sigma + _KINK
    findings.number(f"{key}.d_max_stated", d_max, limit, _LENGTH_M, "m")
    findings.number(f"{key}.d_max_sigma", spread, sigma, slack, "m")
    if d_max is not None and spread is not None:
        findings.holds(
            covered is (row.d < d_max - 2.0 * spread),
            f"{key}.covered_at_2_sigma",
            f"{covered!r} is claimed of d = {row.d:.6g} m, d_max = {d_max:.6g} m, "
            f"sigma {spread:.3g} m",
        )


def _spread(section: SeamPlane, claimed: RangesRecord) -> NDArray[np.float64]:
    """Covariance of E, a point c + rho u of the sphere, shape (3, 3)."""
    ball = claimed.sphere
    unit = section.meeting - np.array(ball.centre_m)
    unit /= np.linalg.norm(unit)
    whole = np.array(ball.covariance_m2)
    motion = np.column_stack([np.eye(3), unit])
    bumps = ball.shape_sigma_m**2 * np.outer(unit, unit)
    return motion @ whole @ motion.T + bumps


def _at(section: SeamPlane, step: NDArray[np.float64], largest: float) -> float:
    """d_max with E moved by a step [m]."""
    return _limit(replace(section, meeting=section.meeting + step), largest)


def _limit(section: SeamPlane, largest: float) -> float:
    """d_max of eq. (9) under an incidence; NaN where phi_max leaves (0, pi) [m]."""
    room = min(section.field_slack, section.incidence_slack(largest))
    phi = section.phi + room
    return section.baseline_at(phi) if 0.0 < phi < np.pi else np.nan
