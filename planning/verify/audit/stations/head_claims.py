"""Claims about heads: whether their devices stand as the rig's head holds them."""

from itertools import combinations, permutations

import numpy as np

from geometry.arrays import Array
from planning.model.document.head_records import HeadRecord
from planning.model.document.station_records import StationRecord, StationsRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.body_claims import audit_body_zones
from planning.verify.audit.predicates.occlusion import Block, touches

# Poses are written to 0.01 mm, of devices and of what carries them.
_POSITION_M = 3e-5
_TURN = 1e-9
_ROUNDING = 1e-6


def audit_heads(
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
        _audit_moves(plan, told, findings)
        shorter = _shorter_way(places)
        findings.holds(
            shorter >= way - slack,
            "way_m",
            f"{1e3 * way:.1f} mm in the order given, {1e3 * shorter:.1f} in another",
        )
    else:
        findings.same("way_m", told.way_m, None, "heads that all stand")
        findings.same("move_s", told.move_s, None, "heads that all stand")


def _audit_moves(plan: RigPlan, told: StationsRecord, findings: AuditFindings) -> None:
    """The way by its time, and coming to rest at each station, as the rig states."""
    carrier, truth = plan.document.rig.stations, None
    if carrier is not None:
        terms = (
            (carrier.seconds_per_metre, told.way_m or 0.0),
            (carrier.seconds_per_station, len(told.stations)),
        )
        stated = [each * times for each, times in terms if each is not None]
        truth = sum(stated) if stated else None
    slack = _ROUNDING * (1.0 + (truth or 0.0))
    findings.same("move_s", told.move_s, truth, "rig.stations", slack)


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


def audit_reference_heads(
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
