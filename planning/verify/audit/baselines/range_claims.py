"""Claims about ranges that were estimated: points, sphere, and what they tightened.

Nothing is fitted again: each estimate must satisfy the equations that define it in
`docs/use/ranges.md`, so that a Newton step from it leads nowhere.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from planning.model.document.input_records import RangePoint, RangesRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .range_rows import audit_range_rows

_Array = NDArray[np.float64]

# A step that an estimate is still off, in its own standard deviations.
_OFF = 1e-3
_RELATIVE = 1e-6
_LENGTH_M = 1e-9


def audit_ranges(case: AuditCase, findings: AuditFindings) -> None:
    """Check `ranges` and what follows from it; a plan of a mesh has none."""
    claimed = case.plan.document.ranges
    if claimed is None:
        return
    try:
        _audit_lines(claimed, findings)
        for point in claimed.points:
            _audit_point(point, claimed, findings)
        covariance = _audit_sphere(claimed, findings)
        _audit_surface(case.plan, claimed, covariance, findings)
        _audit_guard(case.plan, claimed, findings)
        audit_range_rows(case.plan, claimed, findings)
    except (KeyError, TypeError, ValueError, np.linalg.LinAlgError) as why:
        findings.fail("ranges", f"is broken ({type(why).__name__}: {why})")


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
        "ranges.observations",
        "aren't each used or refused once, for their own point",
    )


def _audit_point(
    point: RangePoint, claimed: RangesRecord, findings: AuditFindings
) -> None:
    """The normal equations of the point's lines, their inverse and their chi-square."""
    key = f"ranges.points.{point.point}"
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
            look @ arm > 0.0, key, f"lies behind the viewpoint of line {line['line']}"
        )
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    _still(key, covariance, pull, findings)
    _same(f"{key}.covariance_m2", point.covariance_m2, covariance, findings)
    findings.number(
        f"{key}.chi_square", point.chi_square, square, 1e-6 * (1.0 + square), ""
    )
    findings.number(f"{key}.n_free", point.n_free, float(free), 0.0, "")
    chance = float(gammaincc(0.5 * free, 0.5 * square)) if free > 0 else 1.0
    findings.holds(
        chance >= claimed.significance * (1.0 - _RELATIVE),
        f"{key}.chi_square",
        f"{square:.4g} of {free} free is exceeded by chance in {chance:.2g} of cases, "
        f"less than ranges.significance",
    )


def _audit_sphere(claimed: RangesRecord, findings: AuditFindings) -> _Array:
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
        key = f"ranges.points.{point.point}.residual_m"
        findings.number(key, point.residual_m, misses[-1], _LENGTH_M, "m")
    design, miss, variance = np.array(rows), np.array(misses), np.array(variances)
    information = design.T @ (design / variance[:, None])
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    _still("ranges.sphere", covariance, design.T @ (miss / variance), findings)
    _same("ranges.sphere.covariance_m2", ball.covariance_m2, covariance, findings)
    square, free = float(np.sum(miss**2 / variance)), len(points) - 4
    slack = 1e-6 * (1.0 + free)
    findings.number("ranges.sphere.chi_square", ball.chi_square, square, slack, "")
    findings.holds(
        free > 0 and tau >= 0.0 and square <= free + slack,
        "ranges.sphere.shape_sigma_m",
        f"{tau!r} m leaves chi^2 {square:.6g} of {free} free",
    )
    findings.holds(
        tau == 0.0 or square >= free - slack,
        "ranges.sphere.shape_sigma_m",
        f"{tau!r} m is more than it takes: chi^2 {square:.6g} of {free} free",
    )
    return covariance


def _audit_surface(
    plan: RigPlan, claimed: RangesRecord, covariance: _Array, findings: AuditFindings
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
    key = "ranges.position_sigma_m"
    findings.number(key, claimed.position_sigma_m, truth, 1e-4 * truth, "m")


def _of_surface(unit: _Array, covariance: _Array, tau: float) -> _Array:
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
    tightened: list[tuple[str, float | None, float, str]] = [
        ("ranges.guard_m", length, 2.0 * claimed.position_sigma_m, "m"),
        ("ranges.guard_rad", claimed.guard_rad, angle, "rad"),
        ("rig.standoff_play_m", rig.standoff_play_m, play - length, whose),
    ]
    for kind, model, most in (
        ("projector", rig.projector, limits.projector),
        ("camera", rig.camera, limits.camera),
    ):
        low, high = stated[f"{kind}.range_m"]
        steepest = stated[f"{kind}.max_incidence"] - angle
        near, far = model.range_m
        tightened += [
            (f"rig.{kind}.range_m.0", near, low + length, whose),
            (f"rig.{kind}.range_m.1", far, high - length, whose),
            (
                f"requirements.{kind}.max_incidence",
                most.max_incidence,
                steepest,
                whose,
            ),
        ]
    for key, value, truth, unit in tightened:
        findings.number(key, value, truth, _LENGTH_M, unit)


def _still(key: str, covariance: _Array, pull: _Array, findings: AuditFindings) -> None:
    """Note an estimate from which a Newton step leads elsewhere."""
    off = float(np.max(np.abs(covariance @ pull) / np.sqrt(np.diag(covariance))))
    findings.holds(
        off <= _OFF,
        key,
        f"isn't the least-squares estimate: {off:.3g} of its standard deviation off",
    )


def _same(
    key: str, claimed: Sequence[object], covariance: _Array, findings: AuditFindings
) -> None:
    """Check a covariance against the inverse of the information."""
    slack = 1e-5 * float(np.abs(covariance).max())
    findings.array(key, claimed, covariance, slack, "the inverse of the information")
