"""Claims of the baseline table: eqs. (9) and (10), row by row."""

import numpy as np

from planning.model.document.device_records import BaselineRow
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .audit_seams import (
    SeamPlane,
    are_normals,
    distance_to_surface,
    is_onward,
    section_of,
)

# Room for lengths and angles written with a few digits, and for E among them.
_LENGTH_M = 5e-5
_ANGLE = 1e-3
_LIMITS = ("camera_field", "camera_incidence")


def audit_baselines(case: AuditCase, findings: AuditFindings) -> None:
    """Recompute each row from the poses and its E; a pair has both orders."""
    cameras = {camera.id: camera for camera in case.plan.cameras}
    rows = case.plan.document.baselines
    pairs = [row.cameras for row in rows]
    for place, (row, pair) in enumerate(zip(rows, pairs, strict=True)):
        key = f"baselines.{place}.cameras"
        if len(set(pair)) != 2 or not set(pair) <= set(cameras):
            findings.fail(key, f"{list(pair)!r} must be two cameras of the plan")
            continue
        first, second = pair
        known = pair not in pairs[:place]
        findings.holds(known, key, f"the row of {first}, {second} stands there twice")
        findings.holds(
            (second, first) in pairs,
            "baselines",
            f"has {first}, {second} but not the order {second}, {first}",
        )
        section = section_of(row, cameras)
        _audit_row(f"baselines.{first}-{second}", row, section, case, findings)


def _audit_row(
    key: str,
    row: BaselineRow,
    section: SeamPlane,
    case: AuditCase,
    findings: AuditFindings,
) -> None:
    """Check a row: its E, its lengths, its angles, and what follows from them."""
    mesh = case.plan.surface.mesh
    apart = distance_to_surface(mesh, section.meeting)
    findings.holds(
        apart <= _LENGTH_M, f"{key}.E", f"lies {1e3 * apart:.3g} mm off the surface"
    )
    if not findings.holds(
        are_normals(section.normals, section.meeting, mesh),
        f"{key}.normals",
        f"{row.normals!r} must be two normals of the surface",
    ) or not findings.holds(
        is_onward(section), f"{key}.onward", f"{row.onward!r} isn't along the surface"
    ):
        return
    largest = case.plan.requirements.camera.max_incidence
    incidence, field = section.incidence_slack(largest), section.field_slack
    lengths = {
        **section.lengths(),
        "standoff1": section.standoffs[0],
        "standoff2": section.standoffs[1],
    }
    angles = {
        "phi": section.phi,
        "phi_max": section.phi + min(field, incidence),
        "slack": row.phi_max - section.phi,
        "delta_axes": section.phi - sum(section.beta),
        "delta_surface": section.delta_surface,
        "max_incidence": largest,
    }
    for truths, tolerance, unit in ((lengths, _LENGTH_M, "m"), (angles, _ANGLE, "rad")):
        for name, truth in truths.items():
            findings.number(f"{key}.{name}", getattr(row, name), truth, tolerance, unit)
    for name in ("beta", "iota", "half_field"):
        for side, (claimed, truth) in enumerate(
            zip(getattr(row, name), getattr(section, name), strict=True)
        ):
            findings.number(f"{key}.{name}.{side}", claimed, truth, _ANGLE, "rad")
    for side, claimed in enumerate((row.C1, row.C2)):
        slope = float(np.tan(row.half_field[side]))
        if abs(row.half_field[side]) < np.pi / 2.0:
            extent = section.standoffs[side] * slope
            slack = _LENGTH_M * (1.0 + abs(slope))
            findings.number(f"{key}.C{side + 1}", claimed, extent, slack, "m")
    findings.holds(
        row.n_seam >= 1, f"{key}.n_seam", f"{row.n_seam!r} must be a positive number"
    )
    first = _LIMITS[0] if incidence > field else _LIMITS[1]
    # Where both limits bind at once, rounding may name either.
    known = _LIMITS if abs(incidence - field) <= 2.0 * _ANGLE else (first,)
    findings.holds(
        row.limit in known, f"{key}.limit", f"{row.limit!r} is claimed, it is {first}"
    )
    _audit_limit(key, row, section, findings)


def _audit_limit(
    key: str, row: BaselineRow, section: SeamPlane, findings: AuditFindings
) -> None:
    """Check covered and d_max against the row's own phi_max."""
    slack = row.phi_max - section.phi
    findings.holds(
        abs(slack) <= _ANGLE or row.covered is (slack > 0.0),
        f"{key}.covered",
        f"{row.covered!r} is claimed, but phi_max - phi = {slack:.6g} rad",
    )
    if not 0.0 < row.phi_max < np.pi:
        findings.holds(
            row.d_max is None,
            f"{key}.d_max",
            f"{row.d_max!r} is claimed, must be null: phi_max {row.phi_max:.6g} rad "
            f"isn't between 0 and pi",
        )
        return
    value = section.baseline_at(row.phi_max)
    findings.number(f"{key}.d_max", row.d_max, value, 4 * _LENGTH_M, "m")
