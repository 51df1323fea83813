"""Claims about ranges that were estimated: points, sphere, and what they tightened.

Nothing is fitted again: each estimate must satisfy the equations that define it in
`docs/use/ranges.md`, so that a Newton step from it leads nowhere.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import gammaincc

from geometry.arrays import Array
from planning.model.document.device_records import BaselineRow
from planning.model.document.input_records import RangePoint, RangesRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .audit_seams import SeamPlane, section_of

# A step that an estimate is still off, in its own standard deviations.
_OFF = 1e-3
_RELATIVE = 1e-6
_LENGTH_M = 1e-9
# Of rows of `baselines` both sides take differences, of different steps, and lengths
# are good to 0.05 mm.
_STEP = 3e-5
_ROW_M = 2e-4
_SHARE = 0.02
_KINK = 2e-5


def audit_ranges(case: AuditCase, findings: AuditFindings) -> None:
    """Check `ranges` and what follows from it; a plan of a mesh has none."""
    claimed = case.plan.document.ranges
    if claimed is None:
        return
    below = findings.at("ranges")
    try:
        _audit_lines(claimed, below)
        for point in claimed.points:
            _audit_point(point, claimed, below.at(f"points.{point.point}"))
        covariance = _audit_sphere(claimed, below)
        _audit_surface(case.plan, claimed, covariance, findings)
        _audit_guard(case.plan, claimed, findings)
        _audit_rows(case.plan, claimed, findings)
    except (KeyError, TypeError, ValueError, np.linalg.LinAlgError) as why:
        below.fail("", f"is broken ({type(why).__name__}: {why})")


def _audit_lines(claimed: RangesRecord, findings: AuditFindings) -> None:
    """Every observation belongs to its own point or is refused, once."""
    stated = {o["line"]: o["point"] for o in claimed.observations}
    used = [
        (line, point.point)
        for point in (*claimed.points, *claimed.refused)
        for line in point.lines
    ]
    findings.holds(
        sorted(used) == sorted(stated.items()),
        "observations",
        "aren't each used or refused once, for their own point",
    )


def _audit_point(
    point: RangePoint, claimed: RangesRecord, findings: AuditFindings
) -> None:
    """The normal equations of the point's lines, their inverse and their chi-square."""
    lines = [o for o in claimed.observations if o["line"] in point.lines]
    at = np.array(point.position_m)
    information, pull, square, free = np.zeros((3, 3)), np.zeros(3), 0.0, -3
    for line in lines:
        look = np.array(line["direction"], dtype=np.float64)
        arm = at - np.array(line["origin_m"], dtype=np.float64)
        aside = np.cross(look, arm)
        weight = 1.0 / (float(arm @ arm) * line["sigma_rad"] ** 2)
        skew = np.cross(np.eye(3), look)
        information += weight * skew @ skew.T
        pull += weight * np.cross(aside, look)
        square += weight * float(aside @ aside)
        free += 2
        if line["range_m"] is not None:
            weight = 1.0 / line["range_sigma_m"] ** 2
            miss = float(look @ arm) - line["range_m"]
            information += weight * np.outer(look, look)
            pull += weight * miss * look
            square += weight * miss * miss
            free += 1
        findings.holds(
            look @ arm > 0.0, "", f"lies behind the viewpoint of line {line['line']}"
        )
    covariance = _inverse(point.covariance_m2, information, findings)
    _still(covariance, pull, findings)
    truth = {"chi_square": square}
    findings.numbers(point, truth, 1e-6 * (1.0 + square), "")
    findings.numbers(point, {"n_free": float(free)}, 0.0, "")
    chance = float(gammaincc(0.5 * free, 0.5 * square)) if free > 0 else 1.0
    findings.holds(
        chance >= claimed.significance * (1.0 - _RELATIVE),
        "chi_square",
        f"{square:.4g} of {free} free is exceeded by chance in {chance:.2g} of cases, "
        f"less than ranges.significance",
    )


def _audit_sphere(claimed: RangesRecord, findings: AuditFindings) -> Array:
    """Check the normal equations of the sphere, and tau; return the covariance."""
    ball, points = claimed.sphere, claimed.points
    centre, tau = np.array(ball.centre_m), ball.shape_sigma_m
    rows, misses, variances = [], [], []
    for point in points:
        arm = np.array(point.position_m) - centre
        reach = float(np.linalg.norm(arm))
        unit = arm / reach
        rows.append(np.append(-unit, -1.0))
        misses.append(reach - ball.radius_m)
        spread = unit @ np.array(point.covariance_m2) @ unit
        variances.append(float(spread) + tau**2)
        truth = {"residual_m": misses[-1]}
        findings.at(f"points.{point.point}").numbers(point, truth, _LENGTH_M, "m")
    design, miss, variance = np.array(rows), np.array(misses), np.array(variances)
    findings = findings.at("sphere")
    information = design.T @ (design / variance[:, None])
    covariance = _inverse(ball.covariance_m2, information, findings)
    _still(covariance, design.T @ (miss / variance), findings)
    square, free = float(np.sum(miss**2 / variance)), len(points) - 4
    slack = 1e-6 * (1.0 + free)
    findings.number("chi_square", ball.chi_square, square, slack, "")
    findings.holds(
        free > 0 and tau >= 0.0 and square <= free + slack,
        "shape_sigma_m",
        f"{tau!r} m leaves chi^2 {square:.6g} of {free} free",
    )
    findings.holds(
        tau == 0.0 or square >= free - slack,
        "shape_sigma_m",
        f"{tau!r} m is more than it takes: chi^2 {square:.6g} of {free} free",
    )
    return covariance


def _audit_surface(
    plan: RigPlan, claimed: RangesRecord, covariance: Array, findings: AuditFindings
) -> None:
    """The surface is the sphere; position_sigma_m is the worst over its vertices."""
    ball = claimed.sphere
    arms = plan.surface.mesh.vertices - np.array(ball.centre_m)
    reach = np.linalg.norm(arms, axis=1)
    off = float(np.abs(reach - ball.radius_m).max())
    findings.holds(
        off <= 1e-6 * ball.radius_m,
        "surface.npz",
        f"lies up to {1e3 * off:.3g} mm off ranges.sphere",
    )
    worst = 0.0
    for unit in arms / reach[:, None]:
        spread = _of_surface(unit, covariance, ball.shape_sigma_m)
        worst = max(worst, float(np.linalg.norm(spread, 2)))
    truth = float(np.sqrt(worst))
    below = findings.at("ranges")
    below.numbers(claimed, {"position_sigma_m": truth}, 1e-4 * truth, "m")


def _of_surface(unit: Array, covariance: Array, tau: float) -> Array:
    """Covariance of c + rho u, from that of (c, rho) and tau, (3, 3)."""
    mixed = np.outer(covariance[:3, 3], unit)
    square = covariance[3, 3] + tau**2
    return covariance[:3, :3] + mixed + mixed.T + square * np.outer(unit, unit)


def _audit_guard(plan: RigPlan, claimed: RangesRecord, findings: AuditFindings) -> None:
    """Two sigma are kept free of what the rig states."""
    rig, limits, stated = plan.document.rig, plan.requirements, claimed.stated
    length, play = claimed.guard_m, stated["standoff_play_m"]
    angle = float(np.arcsin(length / ((rig.standoff_m or np.nan) - play)))
    whose = "(ranges.stated less two sigma)"
    guard = {"guard_m": 2.0 * claimed.position_sigma_m}
    findings.at("ranges").numbers(claimed, guard, _LENGTH_M, "m")
    findings.at("ranges").numbers(claimed, {"guard_rad": angle}, _LENGTH_M, "rad")
    kept = {"standoff_play_m": play - length}
    findings.at("rig").numbers(rig, kept, _LENGTH_M, whose)
    for kind, model, most in (
        ("projector", rig.projector, limits.projector),
        ("camera", rig.camera, limits.camera),
    ):
        low, high = stated[f"{kind}.range_m"]
        for side, truth in enumerate((low + length, high - length)):
            key, value = f"rig.{kind}.range_m.{side}", model.range_m[side]
            findings.number(key, value, truth, _LENGTH_M, whose)
        kept = {"max_incidence": stated[f"{kind}.max_incidence"] - angle}
        findings.at(f"requirements.{kind}").numbers(most, kept, _LENGTH_M, whose)


def _still(covariance: Array, pull: Array, findings: AuditFindings) -> None:
    """Note an estimate from which a Newton step leads elsewhere."""
    off = float(np.max(np.abs(covariance @ pull) / np.sqrt(np.diag(covariance))))
    findings.holds(
        off <= _OFF,
        "",
        f"isn't the least-squares estimate: {off:.3g} of its standard deviation off",
    )


def _inverse(
    claimed: Sequence[Sequence[float]], information: Array, findings: AuditFindings
) -> Array:
    """Check covariance_m2 against the inverse of the information, and return that."""
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    slack = 1e-5 * float(np.abs(covariance).max())
    whose = "the inverse of the information"
    findings.same("covariance_m2", claimed, covariance, whose, slack)
    return covariance


def _audit_rows(plan: RigPlan, claimed: RangesRecord, findings: AuditFindings) -> None:
    """Recompute d_max at the stated limits, its sigma, and the verdict of each row."""
    cameras = {camera.id: camera for camera in plan.cameras}
    for row in plan.document.baselines:
        below = findings.at(f"baselines.{row.cameras[0]}-{row.cameras[1]}")
        _audit_row(row, section_of(row, cameras), claimed, below)


def _audit_row(
    row: BaselineRow, section: SeamPlane, claimed: RangesRecord, findings: AuditFindings
) -> None:
    largest = claimed.stated["camera.max_incidence"]
    limit = _limit(section, largest)
    steps = _STEP * np.eye(3)
    ahead, back = (
        np.array([_limit(section, largest, step) for step in way])
        for way in (steps, -steps)
    )
    gradient = (ahead - back) / (2.0 * _STEP)
    d_max, spread, covered = row.d_max_stated, row.d_max_sigma, row.covered_at_2_sigma
    if not (np.isfinite(limit) and np.all(np.isfinite(gradient))):
        none = d_max is None and spread is None and covered is None
        findings.holds(none, "", "d_max at two sigma must be null")
        return
    ball = claimed.sphere
    unit = section.meeting - np.array(ball.centre_m)
    unit /= np.linalg.norm(unit)
    known = _of_surface(unit, np.array(ball.covariance_m2), ball.shape_sigma_m)
    sigma = float(np.sqrt(gradient @ known @ gradient))
    slack = _SHARE * sigma + _KINK
    findings.number("d_max_stated", d_max, limit, _ROW_M, "m")
    findings.number("d_max_sigma", spread, sigma, slack, "m")
    if d_max is not None and spread is not None:
        findings.holds(
            covered is (row.d < d_max - 2.0 * spread),
            "covered_at_2_sigma",
            f"{covered!r} is claimed of d = {row.d:.6g} m, d_max = {d_max:.6g} m, "
            f"sigma {spread:.3g} m",
        )


def _limit(section: SeamPlane, largest: float, step: Array | float = 0.0) -> float:
    """d_max of eq. (9) under an incidence; NaN where phi_max leaves (0, pi) [m]."""
    section = replace(section, meeting=section.meeting + step)
    room = min(section.field_slack, section.incidence_slack(largest))
    phi = section.phi + room
    return section.baseline_at(phi) if 0.0 < phi < np.pi else np.nan
