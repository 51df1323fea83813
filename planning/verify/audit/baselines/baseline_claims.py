"""Claims of the baseline table: eqs. (9) and (10), row by row."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera
from planning.verify.audit.ledger import Ledger, as_number, entries

from .audit_seams import Section, distance_to_surface, normals_of_row, onward_of_row

# Room for lengths and angles written with a few digits, and for E among them.
_LENGTH_M = 5e-5
_ANGLE = 1e-3
_LIMITS = ("camera_field", "camera_incidence")


def audit_baselines(plan: RigPlan, ledger: Ledger) -> None:
    """Recompute each row from the poses and its E; a pair has both orders."""
    cameras = {camera.id: camera for camera in plan.cameras}
    seen: set[tuple[str, str]] = set()
    for place, row in enumerate(entries(plan.to_document()["baselines"])):
        names = row.get("cameras")
        named = list(names) if isinstance(names, list) else []
        if len(set(named)) != 2 or not set(named) <= set(cameras):
            key = f"baselines.{place}.cameras"
            ledger.fail(key, f"{names!r} must be two cameras of the plan")
            continue
        first, second = named
        ledger.holds(
            (first, second) not in seen,
            f"baselines.{place}.cameras",
            f"the row of {first}, {second} stands there twice",
        )
        seen.add((first, second))
        key = f"baselines.{first}-{second}"
        _audit_row(key, row, cameras[first], cameras[second], plan, ledger)
    for first, second in sorted(seen):
        ledger.holds(
            (second, first) in seen,
            "baselines",
            f"has {first}, {second} but not the order {second}, {first}",
        )


def _audit_row(
    key: str,
    row: Mapping[str, Any],
    camera1: PlannedCamera,
    camera2: PlannedCamera,
    plan: RigPlan,
    ledger: Ledger,
) -> None:
    meeting = _meeting_point(key, row, plan.surface.mesh, ledger)
    if meeting is None:
        return
    normals = normals_of_row(row, meeting, plan.surface.mesh)
    if normals is None:
        ledger.fail(
            f"{key}.normals",
            f"{row.get('normals')!r} must be two normals of the surface",
        )
        return
    section = Section(camera1, camera2, meeting, normals)
    if row.get("onward") is not None:
        onward = onward_of_row(row, section)
        if onward is None:
            ledger.fail(f"{key}.onward", f"{row['onward']!r} isn't along the surface")
            return
        section = replace(section, onward=onward)
    for name, value in section.lengths().items():
        claimed = row.get(name)
        if name == "d_axial" and as_number(claimed) is not None:
            claimed = abs(row[name])
        ledger.number(f"{key}.{name}", claimed, value, _LENGTH_M, "m")
    ledger.number(f"{key}.phi", row.get("phi"), section.phi, _ANGLE, "rad")
    largest = plan.requirements.camera.max_incidence
    room = min(section.field_slack, section.incidence_slack(largest))
    ledger.number(
        f"{key}.phi_max", row.get("phi_max"), section.phi + room, _ANGLE, "rad"
    )
    _audit_limit(key, row, section, ledger)
    _audit_angles(key, row, section, ledger)
    _audit_standoffs(key, row, section, ledger)
    _audit_seam(key, row, section, largest, ledger)


def _audit_angles(
    key: str, row: Mapping[str, Any], section: Section, ledger: Ledger
) -> None:
    """Check beta, iota and half_field of both cameras, delta_axes, delta_surface."""
    for name, truth in (
        ("beta", section.beta),
        ("iota", section.iota),
        ("half_field", section.half_field),
    ):
        claimed = _pair(row.get(name))
        for side in (0, 1):
            ledger.number(
                f"{key}.{name}.{side}", claimed[side], truth[side], _ANGLE, "rad"
            )
    turn = section.phi - sum(section.beta)
    ledger.number(f"{key}.delta_axes", row.get("delta_axes"), turn, _ANGLE, "rad")
    bend = section.delta_surface
    ledger.number(f"{key}.delta_surface", row.get("delta_surface"), bend, _ANGLE, "rad")


def _audit_standoffs(
    key: str, row: Mapping[str, Any], section: Section, ledger: Ledger
) -> None:
    """Check the depths of E, and C_i = standoff_i tan(b_i) with the row's own b_i."""
    fields = _pair(row.get("half_field"))
    for side in (0, 1):
        depth, name = section.standoffs[side], f"standoff{side + 1}"
        ledger.number(f"{key}.{name}", row.get(name), depth, _LENGTH_M, "m")
        half = as_number(fields[side])
        if half is not None and abs(half) < np.pi / 2.0:
            extent, name = depth * float(np.tan(half)), f"C{side + 1}"
            slack = _LENGTH_M * (1.0 + abs(float(np.tan(half))))
            ledger.number(f"{key}.{name}", row.get(name), extent, slack, "m")


def _audit_seam(
    key: str,
    row: Mapping[str, Any],
    section: Section,
    largest: float,
    ledger: Ledger,
) -> None:
    """Check max_incidence, which limit binds, and the number of seam samples."""
    ledger.number(
        f"{key}.max_incidence", row.get("max_incidence"), largest, _ANGLE, "rad"
    )
    count = row.get("n_seam")
    ledger.holds(
        isinstance(count, int) and not isinstance(count, bool) and count >= 1,
        f"{key}.n_seam",
        f"{count!r} must be a positive whole number",
    )
    ahead = section.incidence_slack(largest) - section.field_slack
    first = _LIMITS[0] if ahead > 0.0 else _LIMITS[1]
    # Where both limits bind at once, rounding may name either.
    known = _LIMITS if abs(ahead) <= 2.0 * _ANGLE else (first,)
    limit = row.get("limit")
    ledger.holds(limit in known, f"{key}.limit", f"{limit!r} is claimed, it is {first}")


def _pair(value: object) -> tuple[object, object]:
    """Two values of a row, for camera 1 and camera 2; None for what isn't there."""
    if isinstance(value, list) and len(value) == 2:
        return value[0], value[1]
    return None, None


def _meeting_point(
    key: str, row: Mapping[str, Any], mesh: TriangleMesh, ledger: Ledger
) -> NDArray[np.float64] | None:
    try:
        meeting = np.asarray(row.get("E"), dtype=np.float64)
    except (TypeError, ValueError):
        meeting = np.full(3, np.nan)
    if meeting.shape != (3,) or not np.all(np.isfinite(meeting)):
        ledger.fail(f"{key}.E", f"{row.get('E')!r} must be a point")
        return None
    apart = distance_to_surface(mesh, meeting)
    ledger.holds(
        apart <= _LENGTH_M, f"{key}.E", f"lies {1e3 * apart:.3g} mm off the surface"
    )
    return meeting


def _audit_limit(
    key: str, row: Mapping[str, Any], section: Section, ledger: Ledger
) -> None:
    """Check slack, covered and d_max against the row's own phi_max."""
    limit = as_number(row.get("phi_max"))
    if limit is None:
        return
    slack = limit - section.phi
    ledger.number(f"{key}.slack", row.get("slack"), slack, _ANGLE, "rad")
    if not abs(slack) <= _ANGLE:
        ledger.holds(
            row.get("covered") is (slack > 0.0),
            f"{key}.covered",
            f"{row.get('covered')!r} is claimed, but phi_max - phi = {slack:.6g} rad",
        )
    if not 0.0 < limit < np.pi:
        ledger.holds(
            row.get("d_max") is None,
            f"{key}.d_max",
            f"{row.get('d_max')!r} is claimed, must be null: phi_max {limit:.6g} rad "
            f"isn't between 0 and pi",
        )
        return
    value = section.baseline_at(limit)
    ledger.number(f"{key}.d_max", row.get("d_max"), value, 4 * _LENGTH_M, "m")
