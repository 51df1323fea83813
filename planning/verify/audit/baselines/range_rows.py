"""Claims of `baselines` at two standard deviations of a seam point."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.ledger import Ledger, as_number, entries

from .audit_seams import Section

_STEP = 3e-5
# Both sides take differences, of different steps, and lengths are good to 0.05 mm.
_LENGTH_M = 2e-4
_SHARE = 0.02
_KINK = 2e-5


def audit_range_rows(plan: RigPlan, claimed: Mapping[str, Any], ledger: Ledger) -> None:
    """Recompute d_max at the stated limits, its sigma, and the verdict of each row."""
    cameras = {camera.id: camera for camera in plan.cameras}
    for row in entries(plan.to_document()["baselines"]):
        one, two = row["cameras"]
        section = Section(
            cameras[one],
            cameras[two],
            np.array(row["E"], dtype=np.float64),
            np.array(row["normals"], dtype=np.float64),
            np.array(row["onward"], dtype=np.float64),
        )
        _audit_row(f"baselines.{one}-{two}", row, section, claimed, ledger)


def _audit_row(
    key: str,
    row: Mapping[str, Any],
    section: Section,
    claimed: Mapping[str, Any],
    ledger: Ledger,
) -> None:
    largest = claimed["stated"]["camera.max_incidence"]
    limit = _limit(section, largest)
    gradient = np.array(
        [
            (_at(section, step, largest) - _at(section, -step, largest)) / (2.0 * _STEP)
            for step in _STEP * np.eye(3)
        ]
    )
    if not (np.isfinite(limit) and np.all(np.isfinite(gradient))):
        for name in ("d_max_stated", "d_max_sigma", "covered_at_2_sigma"):
            ledger.holds(row.get(name) is None, f"{key}.{name}", "must be null")
        return
    sigma = float(np.sqrt(gradient @ _spread(section, claimed) @ gradient))
    ledger.number(f"{key}.d_max_stated", row.get("d_max_stated"), limit, _LENGTH_M, "m")
    slack = _SHARE * sigma + _KINK
    ledger.number(f"{key}.d_max_sigma", row.get("d_max_sigma"), sigma, slack, "m")
    own = [as_number(row.get(name)) for name in ("d", "d_max_stated", "d_max_sigma")]
    if None not in own:
        d, least, spread = (float(value or 0.0) for value in own)
        ledger.holds(
            row.get("covered_at_2_sigma") is (d < least - 2.0 * spread),
            f"{key}.covered_at_2_sigma",
            f"{row.get('covered_at_2_sigma')!r} is claimed of d = {d:.6g} m, d_max = "
            f"{least:.6g} m, sigma {spread:.3g} m",
        )


def _spread(section: Section, claimed: Mapping[str, Any]) -> NDArray[np.float64]:
    """Covariance of E, a point c + rho u of the sphere, shape (3, 3)."""
    ball = claimed["sphere"]
    unit = section.meeting - np.array(ball["centre_m"])
    unit /= np.linalg.norm(unit)
    whole = np.array(ball["covariance_m2"], dtype=np.float64)
    motion = np.column_stack([np.eye(3), unit])
    bumps = ball["shape_sigma_m"] ** 2 * np.outer(unit, unit)
    return motion @ whole @ motion.T + bumps


def _at(section: Section, step: NDArray[np.float64], largest: float) -> float:
    return _limit(replace(section, meeting=section.meeting + step), largest)


def _limit(section: Section, largest: float) -> float:
    """d_max of eq. (9) under an incidence; NaN where phi_max leaves (0, pi) [m]."""
    room = min(section.field_slack, section.incidence_slack(largest))
    phi = section.phi + room
    return section.baseline_at(phi) if 0.0 < phi < np.pi else np.nan
