"""Claims about heads, stations and steps: who stands where, and how many are needed."""

from itertools import combinations, permutations

import numpy as np

from geometry.arrays import Array
from planning.model.document.head_records import HeadRecord, TurntableRecord
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
from planning.verify.audit.predicates.occlusion import Block, touches

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
        _audit_heads(plan, told, case, below)
    _audit_reference(plan, told, below)
    ids = [one.id for one in told.stations]
    below.holds(len(set(ids)) == len(ids), "", f"{ids} aren't all different")
    if below.holds(told.count is not None, "count", "is missing") and told.count:
        _audit_count(plan, told, told.count, below.at("count"))


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
    plan: RigPlan, told: StationsRecord, case: AuditCase, findings: AuditFindings
) -> None:
    """Devices of a head stand as the rig's head says, wherever it stands."""
    head = plan.document.rig.head
    if head is None:
        findings.fail("kind", f"{told.kind!r} without a head in the rig")
        return
    poses = {d.id: d.world_from_device for d in (*plan.projectors, *plan.cameras)}
    findings.same("head", told.head, head.name, "the rig's head")
    for one in told.stations:
        findings.same(f"{one.id}.angle", one.angle, None, "no turntable")
        members = [poses.get(name) for name in (*one.projectors, *one.cameras)]
        _audit_rigid(head, one, members, findings)
    _audit_housings(plan, head, told, case, findings)
    if told.kind == "stations":
        places = np.array(
            [np.array(s.world_from_station)[:3, 3] for s in told.stations]
        )
        way = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        slack = 2.0 * len(places) * _POSITION_M
        findings.number("way_m", told.way_m or 0.0, way, slack, "m")
        shorter = _shorter_way(places)
        findings.holds(
            shorter >= way - slack,
            "way_m",
            f"{1e3 * way:.1f} mm in the order given, {1e3 * shorter:.1f} in another",
        )
    else:
        findings.same("way_m", told.way_m, None, "heads that all stand")


def _shorter_way(places: Array) -> float:
    """Shortest way with two places exchanged, or a part of it turned round [m]."""
    n, least = len(places), np.inf
    for i, j in combinations(range(n), 2):
        turned = [*range(i), *range(i, j + 1)[::-1], *range(j + 1, n)]
        exchanged = list(range(n))
        exchanged[i], exchanged[j] = j, i
        for order in (turned, exchanged):
            legs = np.diff(places[order], axis=0)
            least = min(least, float(np.linalg.norm(legs, axis=1).sum()))
    return least


def _audit_housings(
    plan: RigPlan,
    head: HeadRecord,
    told: StationsRecord,
    case: AuditCase,
    findings: AuditFindings,
) -> None:
    """Housings keep off object, obstacles, zones, and each other where all stand."""
    shadow = case.shadow
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
    if told.kind == "heads":
        _audit_light(plan, told, blocks, case.samples.points, findings)


def _audit_light(
    plan: RigPlan,
    told: StationsRecord,
    blocks: dict[str, Block],
    points: Array,
    findings: AuditFindings,
) -> None:
    """No housing stands between the object and a device of another head."""
    at = {d.id: d.world_from_device[:3, 3] for d in (*plan.projectors, *plan.cameras)}
    for one, other in permutations(told.stations, 2):
        for name in (*other.projectors, *other.cameras):
            stopped = int(
                blocks[one.id].meets(np.tile(at[name], (len(points), 1)), points).sum()
            )
            findings.holds(
                stopped == 0,
                f"{one.id}.body",
                f"stands between {name} and {stopped} of {len(points)} samples",
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
    _audit_angles(table, told, findings)
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
    plan: RigPlan, told: StationsRecord, count: StationCount, findings: AuditFindings
) -> None:
    n, known = len(told.stations), count.needed is not None
    needed = count.needed or 0
    findings.same("count", count.count, n, "the number of stations")
    for key, least in (
        ("lower_bound", count.lower_bound),
        ("everywhere", count.everywhere or 0),
    ):
        findings.holds(
            0 <= least and (least <= needed or not known),
            key,
            f"{least} must be at most needed = {needed}",
        )
    findings.holds(
        count.greedy is None or count.greedy >= count.lower_bound,
        "greedy",
        f"{count.greedy} is fewer than the bound of {count.lower_bound}",
    )
    findings.holds(
        max(count.lit, count.measured) <= count.n_samples,
        "n_samples",
        f"{count.lit} lit and {count.measured} measured of {count.n_samples}",
    )
    if told.kind == "turntable":
        _audit_trade(told, count, findings)
        return
    head = plan.document.rig.head
    most, each = plan.requirements.max_projectors, 1
    if head is not None:
        each = sum(device.kind == "projector" for device in head.devices)
    # More suffice than are planned only where no more may be, or have room.
    findings.holds(
        needed <= n or n * each == most or (head is not None and head.body is not None),
        "needed",
        f"{needed} are claimed to suffice, {n} are planned of {most // each} allowed",
    )
    of_candidates = told.n_reference - n
    findings.same(
        "n_candidates", count.n_candidates, of_candidates, "the reference heads"
    )


def _audit_trade(
    told: StationsRecord, count: StationCount, findings: AuditFindings
) -> None:
    """Numbers of devices each once, and the row of the plan's own is its count."""
    one = told.stations[0]
    own = len(one.projectors), len(one.cameras)
    rows = {(row.projectors, row.cameras): row for row in told.steps}
    findings.holds(
        len(rows) == len(told.steps) and own in rows,
        "steps",
        f"rows of {sorted(rows)}: each once, among them the plan's own {own}",
    )
    for row in told.steps:
        findings.holds(
            row.steps is None or row.lower_bound <= row.steps,
            "steps",
            f"{row.steps} steps with a bound of {row.lower_bound}",
        )
    if own in rows:
        row = rows[own]
        findings.holds(
            (row.steps, row.lower_bound) == (count.needed, count.lower_bound)
            and (count.needed or 0) <= count.count,
            "needed",
            f"{count.needed}, at least {count.lower_bound}, of {count.count} steps; "
            f"the table has {row.steps}, at least {row.lower_bound}",
        )
