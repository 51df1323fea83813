"""Claims of the baseline table: eqs. (9) and (10), row by row."""

import numpy as np

from geometry.arrays import Array, lengths
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import triangle_distances
from planning.model.document.device_records import BaselineRow
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .audit_seams import (
    SeamPlane,
    are_normals,
    faces_reach,
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
    sections: list[tuple[BaselineRow, SeamPlane]] = []
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
        sections.append((row, section_of(row, cameras)))
    mesh, largest = case.plan.surface.mesh, case.plan.requirements.camera.max_incidence
    reach = faces_reach(mesh)
    for row, section in sections:
        apart_m = _apart(section.meeting, mesh, reach)
        below = findings.at(f"baselines.{'-'.join(row.cameras)}")
        beside = are_normals(section.normals, section.meeting, mesh, reach)
        if _audit_seam(row, section, apart_m, below, beside=beside):
            _audit_row(row, section, largest, below)
            _audit_limit(row, section, largest, below)


def _apart(point: Array, mesh: TriangleMesh, reach: Array) -> float:
    """Return how far a point (3,) is from a mesh whose faces reach so far [m]."""
    away = lengths(mesh.face_centroids - point)
    # No tree: of most faces their middles tell that another one is nearer.
    near = np.flatnonzero(away - reach <= away.min())
    points = np.broadcast_to(point, (len(near), 3))
    return float(triangle_distances(points, mesh.corners[near]).min())


def _audit_seam(
    row: BaselineRow,
    section: SeamPlane,
    apart_m: float,
    findings: AuditFindings,
    *,
    beside: bool,
) -> bool:
    """Check E and the directions there; return whether these hold."""
    findings.holds(
        apart_m <= _LENGTH_M, "E", f"lies {1e3 * apart_m:.3g} mm off the surface"
    )
    return findings.holds(
        beside,
        "normals",
        f"{row.normals!r} must be two normals of the surface",
    ) and findings.holds(
        is_onward(section), "onward", f"{row.onward!r} isn't along the surface"
    )


def _audit_row(
    row: BaselineRow, section: SeamPlane, largest: float, findings: AuditFindings
) -> None:
    standoff1, standoff2 = section.standoffs
    standoffs = {"standoff1": standoff1, "standoff2": standoff2}
    findings.numbers(row, section.lengths() | standoffs, _LENGTH_M, "m")
    slack = min(section.field_slack, section.incidence_slack(largest))
    angles = {
        "phi": section.phi,
        "phi_max": section.phi + slack,
        "slack": row.phi_max - section.phi,
        "delta_axes": section.phi - sum(section.beta),
        "delta_surface": section.delta_surface,
        "max_incidence": largest,
    }
    findings.numbers(row, angles, _ANGLE, "rad")
    for name in ("beta", "iota", "half_field"):
        for side, truth in enumerate(getattr(section, name)):
            claimed = getattr(row, name)[side]
            findings.number(f"{name}.{side}", claimed, truth, _ANGLE, "rad")
    for name, half, standoff in zip(
        ("C1", "C2"), row.half_field, section.standoffs, strict=True
    ):
        slope = float(np.tan(half))
        if abs(half) < np.pi / 2.0:
            room = _LENGTH_M * (1.0 + abs(slope))
            findings.numbers(row, {name: standoff * slope}, room, "m")
    findings.holds(
        row.n_seam >= 1, "n_seam", f"{row.n_seam!r} must be a positive number"
    )


def _audit_limit(
    row: BaselineRow, section: SeamPlane, largest: float, findings: AuditFindings
) -> None:
    """Check which limit binds, and covered and d_max against the row's own phi_max."""
    incidence, field = section.incidence_slack(largest), section.field_slack
    first = _LIMITS[0] if incidence > field else _LIMITS[1]
    # Where both limits bind at once, rounding may name either.
    known = _LIMITS if abs(incidence - field) <= 2.0 * _ANGLE else (first,)
    findings.holds(
        row.limit in known, "limit", f"{row.limit!r} is claimed, it is {first}"
    )
    slack = row.phi_max - section.phi
    findings.holds(
        abs(slack) <= _ANGLE or row.covered is (slack > 0.0),
        "covered",
        f"{row.covered!r} is claimed, but phi_max - phi = {slack:.6g} rad",
    )
    if not 0.0 < row.phi_max < np.pi:
        findings.holds(
            row.d_max is None,
            "d_max",
            f"{row.d_max!r} is claimed, must be null: phi_max {row.phi_max:.6g} rad "
            f"isn't between 0 and pi",
        )
        return
    truth = {"d_max": section.baseline_at(row.phi_max)}
    findings.numbers(row, truth, 4 * _LENGTH_M, "m")
