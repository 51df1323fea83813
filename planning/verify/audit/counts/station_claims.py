"""Claims about heads, stations and steps: who stands where, and how many are needed."""

from itertools import combinations

import numpy as np

from geometry.arrays import Array
from planning.model.document.head_records import HeadRecord
from planning.model.document.station_records import (
    StationCount,
    StationRecord,
    StationsRecord,
)
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.body_claims import audit_body_zones
from planning.verify.audit.devices.zone_claims import origin_of
from planning.verify.audit.predicates.occlusion import Block, Shadow, touches

# Poses are written to 0.01 mm, of devices and of what carries them.
_POSITION_M = 3e-5
_TURN = 1e-9
_ROUNDING = 1e-6


def audit_stations(case: AuditCase, findings: AuditFindings) -> None:
    """Check that devices stand where their stations say, and the count of these."""
    plan, told = case.plan, case.plan.document.stations
    below = findings.at("stations")
    if told is None:
        named = [d.id for d in (*plan.projectors, *plan.cameras) if d.station]
        below.holds(not named, "", f"{named} name a station, and there is none")
        return
    _audit_members(plan, told, below)
    if told.kind == "turntable":
        _audit_steps(plan, told, below)
    else:
        _audit_heads(plan, told, case.shadow, below)
    _audit_reference(plan, told, below)
    if told.count is not None:
        _audit_count(told, told.count, below.at("count"))


def _audit_members(
    plan: RigPlan, told: StationsRecord, findings: AuditFindings
) -> None:
    """Every device is at one station, and names it unless heads count across."""
    kinds = (("projectors", plan.projectors), ("cameras", plan.cameras))
    for kind, devices in kinds:
        names = [name for one in told.stations for name in getattr(one, kind)]
        there = [device.id for device in devices]
        findings.holds(
            names == there, kind, f"stations hold {names}, the plan has {there}"
        )
        at = {name: one.id for one in told.stations for name in getattr(one, kind)}
        for device in devices:
            claimed = "" if told.cross else at.get(device.id, "")
            findings.holds(
                device.station == claimed,
                f"{device.id}.station",
                f"{device.station!r} is claimed, but stations put it at {claimed!r}",
            )


def _audit_heads(
    plan: RigPlan, told: StationsRecord, shadow: Shadow, findings: AuditFindings
) -> None:
    """Devices of a head stand as the rig's head says, wherever it stands."""
    head = plan.document.rig.head
    if head is None:
        findings.fail("kind", f"{told.kind!r} without a head in the rig")
        return
    poses = {d.id: d.world_from_device for d in (*plan.projectors, *plan.cameras)}
    findings.same("head", told.head, head.name, "the rig's head")
    for one in told.stations:
        members = [poses.get(name) for name in (*one.projectors, *one.cameras)]
        _audit_rigid(head, one, members, findings)
    _audit_housings(plan, head, told, shadow, findings)
    if told.kind == "stations":
        places = np.array(
            [np.array(s.world_from_station)[:3, 3] for s in told.stations]
        )
        way = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        slack = 2.0 * len(places) * _POSITION_M
        findings.number("way_m", told.way_m or 0.0, way, slack, "m")


def _audit_housings(
    plan: RigPlan,
    head: HeadRecord,
    told: StationsRecord,
    shadow: Shadow,
    findings: AuditFindings,
) -> None:
    """Housings keep off object, obstacles, zones, and each other where all stand."""
    body, space = head.body, plan.requirements.workspace
    if body is None:
        return
    blocks: dict[str, Block] = {}
    for one in told.stations:
        world = np.array(one.world_from_station)
        centre = world[:3, :3] @ np.array(body.centre_m) + world[:3, 3]
        half = np.array(body.half_m)
        blocks[one.id] = Block(one.id, world[:3, :3], centre, half).shrunk()
        below = findings.at(f"{one.id}.body")
        for name, caster in (
            ("object", shadow.caster),
            *((f"obstacle {h.name!r}", h.caster) for h in shadow.hindrances),
        ):
            below.holds(not touches(blocks[one.id], caster), "", f"touches the {name}")
        audit_body_zones(blocks[one.id], space, below)
    pairs = combinations(blocks.items(), 2) if told.kind == "heads" else ()
    for (name, a), (other, b) in pairs:
        findings.holds(
            not a.overlaps(b) and a.gap(b) >= space.clearance_m,
            f"{name}.body",
            f"comes nearer to that of {other} than {1e3 * space.clearance_m:g} mm",
        )


def _audit_rigid(
    head: HeadRecord,
    one: StationRecord,
    members: list[Array | None],
    findings: AuditFindings,
) -> None:
    world = np.array(one.world_from_station)
    if not findings.holds(
        len(members) == len(head.devices),
        one.id,
        f"{len(members)} devices, the head has {len(head.devices)}",
    ):
        return
    for device, pose in zip(head.devices, members, strict=True):
        if pose is None:
            continue
        off = np.abs(world @ np.array(device.head_from_device) - pose)
        findings.holds(
            off[:3, 3].max() <= _POSITION_M and off[:3, :3].max() <= _TURN,
            f"{one.id}.{device.name}",
            f"stands {1e3 * off[:3, 3].max():.3g} mm beside where the head holds it",
        )


def _audit_steps(plan: RigPlan, told: StationsRecord, findings: AuditFindings) -> None:
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
    poses = {d.id: d.world_from_device for d in (*plan.projectors, *plan.cameras)}
    first = told.stations[0]
    for one in told.stations:
        world = np.array(one.world_from_station)
        truth = _turned_back(axis, point, one.angle or 0.0)
        off = float(np.abs(world - truth).max())
        findings.holds(
            off <= _POSITION_M,
            f"{one.id}.world_from_station",
            f"is {off:.3g} off a turn by minus {one.angle} about the axis",
        )
        back = truth @ np.linalg.inv(_turned_back(axis, point, first.angle or 0.0))
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


def _turned_back(axis: Array, point: Array, angle: float) -> Array:
    """What takes the room to the part's frame when the table has turned by an angle.

    By quaternion: q = (cos(a / 2), -sin(a / 2) axis).
    """
    w, (x, y, z) = np.cos(0.5 * angle), -np.sin(0.5 * angle) * axis
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    pose = np.eye(4)
    pose[:3, :3] = turn
    pose[:3, 3] = point - turn @ point
    return pose


def _audit_reference(
    plan: RigPlan, told: StationsRecord, findings: AuditFindings
) -> None:
    """Reference heads are the rig's head at as many poses."""
    n, head, surface = told.n_reference, plan.document.rig.head, plan.surface
    if told.kind == "turntable" or head is None:
        findings.same("n_reference", n, 0, "no head")
        return
    worst = 0.0
    of_head: list[Array] = []
    for kind, poses in (
        ("projector", surface.reference_projectors),
        ("camera", surface.reference_cameras),
    ):
        devices = [np.array(d.head_from_device) for d in head.devices if d.kind == kind]
        if not findings.holds(
            n > 0 and len(poses) == n * len(devices),
            "n_reference",
            f"{n} heads of {len(devices)} {kind}s, surface.npz holds {len(poses)}",
        ):
            return
        of_head += [
            poses[k :: len(devices)] @ np.linalg.inv(device)
            for k, device in enumerate(devices)
        ]
    for other in of_head[1:]:
        worst = max(worst, float(np.abs(other - of_head[0]).max()))
    findings.holds(
        worst <= 2.0 * _POSITION_M,
        "surface.npz",
        f"devices of one reference head stand {1e3 * worst:.3g} mm from their places",
    )


def _audit_count(
    told: StationsRecord, count: StationCount, findings: AuditFindings
) -> None:
    n = len(told.stations)
    findings.same("count", count.count, n, "the number of stations")
    findings.holds(
        0 <= count.lower_bound <= count.needed,
        "lower_bound",
        f"{count.lower_bound} must be at most needed = {count.needed}",
    )
    findings.holds(
        count.everywhere is None or count.everywhere <= count.needed,
        "everywhere",
        f"{count.everywhere} over every pose is more than {count.needed}, which do",
    )
    findings.holds(
        max(count.lit, count.measured) <= count.n_samples,
        "n_samples",
        f"{count.lit} lit and {count.measured} measured of {count.n_samples}",
    )
    lines = [row for row in told.steps if row.steps is not None]
    for row in lines:
        findings.holds(
            row.lower_bound <= (row.steps or 0),
            "steps",
            f"{row.steps} steps with a bound of {row.lower_bound}",
        )
