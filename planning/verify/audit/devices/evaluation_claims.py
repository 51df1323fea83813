"""Claims of a rig evaluated as it stands: nothing proved, and every broken limit."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from geometry.arrays import Array
from geometry.devices import PinholeModel
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Workspace
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.occlusion import (
    Block,
    block_of,
    block_of_zone,
    touches,
)

from .zone_claims import depth_inside

# What is broken by less needn't be told, and rounding may decide [m].
_TOLD_M = 1e-4
_ROUNDING_M = 2e-5
# Bodies nearer than this may be called touching: the planner keeps 0.1 mm [m].
_NEAR_M = 1.5e-4

_Key = tuple[str, str, str]


def audit_evaluation(case: AuditCase, findings: AuditFindings) -> None:
    """Check that nothing is claimed of the number, and that broken limits are told."""
    evaluation = case.plan.document.evaluation
    if evaluation is None:
        return
    claimed = {(v.device, v.limit, v.what): v.by_m for v in evaluation.violations}
    broken: dict[_Key, float] = {}
    doubtful: set[_Key] = set()
    for kind in case.kinds:
        _audit_nothing_proved(kind, findings)
    for key, by_m in (*_of_positions(case), *_of_gaps(case)):
        if by_m > _TOLD_M:
            broken[key] = by_m
        doubtful |= {key} if abs(by_m - _TOLD_M) <= _ROUNDING_M else set()
    touched, near = _touched(case, -_ROUNDING_M), _touched(case, _NEAR_M)
    below = findings.at("evaluation.violations")
    for key in (broken.keys() | touched) - claimed.keys() - doubtful:
        below.fail(" ".join(key), "is broken, and isn't told")
    for key, by_m in claimed.items():
        name = " ".join(key)
        if by_m is None:
            below.holds(key in near, name, "is claimed, but nothing touches")
        elif key not in doubtful:
            below.number(name, by_m, broken.get(key, 0.0), _ROUNDING_M, "m")


def _audit_nothing_proved(kind: DeviceKind, findings: AuditFindings) -> None:
    below, proof = findings.at(f"certificates.{kind.name}s"), kind.proof
    planned = [device.id for device in kind.devices if not device.existing]
    below.holds(not planned, "given", f"{planned} don't stand in an evaluated rig")
    below.holds(
        proof.status != "optimal"
        and proof.candidates.lower_bound == 0
        and proof.needed.lower_bound == 0
        and proof.continuous is None,
        "status",
        f"{proof.status!r} and bounds are claimed, but an evaluation proves none",
    )


def _of_positions(case: AuditCase) -> Iterator[tuple[_Key, float]]:
    for kind in case.kinds:
        for device in kind.devices:
            for limit, what, by_m in _of_position(case, kind, device):
                yield (device.id, limit, what), by_m


def _of_gaps(case: AuditCase) -> Iterator[tuple[_Key, float]]:
    """How much nearer than the clearance housings stand that don't touch [m]."""
    clearance = case.plan.requirements.workspace.clearance_m
    if not clearance:
        return
    blocks = [block_of(d) for d in (*case.plan.projectors, *case.plan.cameras)]
    for one, other in combinations(filter(None, blocks), 2):
        gap, key = one.gap(other), (other.name, "clearance", f"the body of {one.name}")
        # Of two that may be called touching this may be told or not.
        yield key, clearance - gap if gap > _NEAR_M else _TOLD_M


def _of_position(
    case: AuditCase, kind: DeviceKind, device: PlannedProjector | PlannedCamera
) -> Iterator[tuple[str, str, float]]:
    """Limits of a position, their zones, and how far they are broken [m]."""
    space = case.plan.requirements.workspace
    position = device.world_from_device[:3, 3]
    offset = position - np.array(space.centre)
    distance, axis = float(np.linalg.norm(offset)), np.array(space.axis)
    low, high = kind.shell
    yield "standoff", "too near", low - distance
    yield "standoff", "too far", distance - high
    across = float(np.linalg.norm(np.cross(axis, offset)))
    turned = np.arctan2(across, float(offset @ axis))
    yield "cone", "", float(turned - space.half_angle) * distance
    yield from _of_zones(space, offset)
    points = case.plan.surface.mesh.vertices - position
    if not isinstance(device.device, PinholeModel):
        ahead = device.world_from_device[:3, 2]
        points = (points @ ahead)[:, None] * ahead
    away = np.linalg.norm(points, axis=1)
    nearest, farthest = device.device.range_m
    yield "range", "too near", float(nearest - away.max())
    yield "range", "too far", float(away.min() - farthest)


def _of_zones(space: Workspace, offset: Array) -> Iterator[tuple[str, str, float]]:
    if space.floor_m is not None:
        yield "floor", "", space.floor_m - float(offset @ np.array(space.up))
    if space.box is not None:
        yield "box", space.box.name, -float(depth_inside(space.box, offset[None])[0])
    if space.mounting:
        depths = [float(depth_inside(p, offset[None])[0]) for p in space.mounting]
        yield "mounting", " or ".join(p.name for p in space.mounting), -max(depths)
    for zone in space.keep_out:
        yield "keep_out", zone.name, float(depth_inside(zone, offset[None])[0])


def _touched(case: AuditCase, by_m: float) -> set[_Key]:
    """What housings touch that are larger by so much on every side."""
    space = case.plan.requirements.workspace
    blocks: list[Block] = []
    found: set[_Key] = set()
    for device in (*case.plan.projectors, *case.plan.cameras):
        exact = block_of(device)
        if exact is None:
            continue
        block = replace(exact, half=np.maximum(exact.half + by_m, 0.0))
        names = [f"the body of {b.name}" for b in blocks if block.overlaps(b)]
        names += ["the object"] if touches(block, case.shadow.caster) else []
        names += [
            f"obstacle {each.name!r}"
            for each in case.shadow.hindrances
            if touches(block, each.caster)
        ]
        names += _zones_entered(block, space)
        found |= {(device.id, "body", name) for name in names}
        blocks.append(exact)
    return found


def _zones_entered(block: Block, space: Workspace) -> list[str]:
    centre = np.array(space.centre)
    names: list[str] = []
    if space.floor_m is not None:
        heights = (block.corners - centre) @ np.array(space.up)
        names += ["the floor"] if heights.min() < space.floor_m else []
    if space.box is not None:
        room = block_of_zone(space.box, centre)
        out = np.abs(room.local(block.corners)) - room.half
        names += ["the walls of the room"] if out.max() > 0.0 else []
    return names + [
        f"the keep-out volume {zone.name!r}"
        for zone in space.keep_out
        if block.overlaps(block_of_zone(zone, centre))
    ]
