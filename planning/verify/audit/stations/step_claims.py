"""Claims about steps: whether devices stand as the turntable turns them back."""

import numpy as np

from planning.model.document.head_records import TurntableRecord
from planning.model.document.station_records import StationsRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.workspace_claims import turned_back
from planning.verify.audit.devices.zone_claims import origin_of

from .sweep_claims import audit_sweep

# Poses are written to 0.01 mm, of devices and of what carries them.
_POSITION_M = 3e-5
_ROUNDING = 1e-6


def audit_steps(plan: RigPlan, told: StationsRecord, findings: AuditFindings) -> None:
    """The devices of a step are those of the first, turned back about the axis."""
    if told.axis is None or told.point_m is None or not told.stations:
        findings.fail("axis", "a turntable needs its axis and a point of it")
        return
    axis, point = np.array(told.axis), np.array(told.point_m)
    table = plan.document.rig.turntable
    if table is None:
        findings.fail("kind", "'turntable' without one in the rig")
        return
    there = np.array(table.point_m) + origin_of(plan)
    for key, claimed, truth in (("axis", axis, table.axis), ("point_m", point, there)):
        findings.holds(
            float(np.abs(claimed - np.array(truth)).max()) <= _ROUNDING,
            key,
            f"{claimed.tolist()} is claimed, the rig's turntable has {list(truth)}",
        )
    _audit_angles(table, told, findings)
    audit_sweep(plan, told, findings)
    each = table.seconds_per_step
    truth = None if each is None else each * (len(told.stations) - 1)
    slack = _ROUNDING * (1.0 + (truth or 0.0))
    findings.same("move_s", told.move_s, truth, "rig.turntable", slack)
    poses = {d.id: d.world_from_device for d in (*plan.projectors, *plan.cameras)}
    first = told.stations[0]
    for one in told.stations:
        world = np.array(one.world_from_station)
        truth = turned_back(axis, point, one.angle or 0.0)
        off = float(np.abs(world - truth).max())
        findings.holds(
            off <= _POSITION_M,
            f"{one.id}.world_from_station",
            f"is {off:.3g} off a turn by minus {one.angle} about the axis",
        )
        back = truth @ np.linalg.inv(turned_back(axis, point, first.angle or 0.0))
        pairs = zip(
            (*first.projectors, *first.cameras),
            (*one.projectors, *one.cameras),
            strict=False,
        )
        for name, again in pairs:
            gap = np.abs(back @ poses[name] - poses[again]).max()
            findings.holds(
                gap <= 2.0 * _POSITION_M,
                f"{one.id}.{again}",
                f"is {1e3 * gap:.3g} mm off {name} as the part sees it",
            )


def _audit_angles(
    table: TurntableRecord, told: StationsRecord, findings: AuditFindings
) -> None:
    """Steps are different angles that the rig's table has, and no more of them."""
    angles = np.array([one.angle or 0.0 for one in told.stations])
    findings.holds(
        bool(((angles >= 0.0) & (angles < 2.0 * np.pi)).all())
        and bool((np.diff(np.sort(angles)) > _ROUNDING).all()),
        "",
        f"angles {angles.tolist()} must be different, from 0 to less than a turn",
    )
    findings.holds(
        len(angles) <= (table.max_steps or len(angles)),
        "",
        f"{len(angles)} steps, and the rig's turntable may have {table.max_steps}",
    )
    if table.steps is not None:
        places = angles * table.steps / (2.0 * np.pi)
        findings.holds(
            bool((np.abs(places - np.round(places)) <= _ROUNDING * table.steps).all()),
            "",
            f"angles {angles.tolist()} are none of {table.steps} evenly over a turn",
        )
