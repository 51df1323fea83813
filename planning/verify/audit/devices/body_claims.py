"""Claims about bodies: whose they are, and what they must keep off."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from planning.model.devices.bodies import Body
from planning.model.requirements import Workspace
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.occlusion import (
    Block,
    block_of,
    block_of_zone,
    touches,
)

from .workspace_claims import room_from_world

_ROUNDING = 1e-9


def audit_bodies(case: AuditCase, findings: AuditFindings) -> None:
    """Check that each device's body is that of the rig, or of its own entry there."""
    plan, rig = case.plan, case.plan.document.rig
    by_name = {str(table.get("name")): table.get("body") for table in rig.existing}
    for kind in case.kinds:
        for model in kind.models:
            below = findings.at(f"rig.{kind.name}.body")
            _audit_body(model.body, model.figures.body, below)
    bodies = [
        (device.id, kind.name, device.existing, device.model, device.body)
        for kind in case.kinds
        for device in kind.devices
    ]
    for place, device in enumerate(plan.requirements.existing):
        key = f"requirements.existing.{place}"
        bodies.append((key, device.kind, device.name, device.model, device.body))
    for key, kind, name, model, body in bodies:
        stated = by_name.get(name) or rig.model_of(kind, model).figures.body
        _audit_body(body, stated, findings.at(f"{key}.body"))


def _audit_body(
    body: Body | None, stated: Mapping[str, Any] | None, findings: AuditFindings
) -> None:
    """Compare a body in metres with the millimetres of the rig file."""
    if body is None or stated is None:
        findings.holds(
            body is None and stated is None,
            "",
            f"{body!r} is claimed, but the rig file has {stated!r}",
        )
        return
    for name, claimed, whose, unit in (
        ("centre_m", body.centre_m, "centre_mm", 1e-3),
        ("half_m", body.half_m, "size_mm", 0.5e-3),
    ):
        truth = unit * np.array(stated[whose], dtype=np.float64)
        findings.same(name, claimed, truth, whose, _ROUNDING)


def audit_clearance(case: AuditCase, findings: AuditFindings) -> None:
    """Check that bodies keep off each other, the object, the floor and the zones.

    Before a turntable that is so at every step, and of what stands there then. Floor,
    zones and the clearance between two don't bind existing devices. What an evaluated
    rig doesn't keep it says: `audit_evaluation` checks that.
    """
    space, stated = case.plan.requirements.workspace, case.plan.document.rig.clearance_m
    findings.number(
        "requirements.workspace.clearance_m", space.clearance_m, stated, _ROUNDING, "m"
    )
    if case.plan.document.evaluation is not None:
        return
    devices = (*case.plan.projectors, *case.plan.cameras)
    blocks = [(device, block_of(device)) for device in devices]
    solid = [(device, block.shrunk()) for device, block in blocks if block is not None]
    for (first, one), (second, other) in combinations(solid, 2):
        if "" not in (first.station, second.station) and (
            first.station != second.station
        ):
            continue
        key = f"{one.name}.body"
        findings.holds(
            not one.overlaps(other), key, f"overlaps the body of {other.name}"
        )
        if space.clearance_m and not (first.existing and second.existing):
            # Both are smaller by what rounding may have brought them nearer.
            apart = one.gap(other)
            findings.holds(
                apart >= space.clearance_m,
                key,
                f"stands {1e3 * apart:.4g} mm from the body of {other.name}, nearer "
                f"than {1e3 * space.clearance_m:g} mm",
            )
    for device, block in solid:
        below = findings.at(f"{device.id}.body")
        there = case.shadow.about(device.station)
        obstacles = {f"obstacle {h.name!r}": h.caster for h in there}
        for name, caster in {"object": case.shadow.caster, **obstacles}.items():
            below.holds(
                not touches(block, caster),
                "",
                f"touches the {name}; it must stand off it",
            )
        if not device.existing:
            back = room_from_world(case.plan, device.station)
            audit_body_zones(block.moved(back), space, below)


def audit_body_zones(block: Block, space: Workspace, findings: AuditFindings) -> None:
    """Check that a body stands above the floor, in the box and off keep-out zones."""
    centre = np.array(space.centre)
    if space.floor_m is not None:
        lowest = float(((block.corners - centre) @ np.array(space.up)).min())
        findings.holds(
            lowest >= space.floor_m,
            "",
            f"reaches {1e3 * (space.floor_m - lowest):.3g} mm below the floor",
        )
    if space.box is not None:
        room = block_of_zone(space.box, centre)
        out = float((np.abs(room.local(block.corners)) - room.half).max())
        findings.holds(
            out <= 0.0, "", f"reaches {1e3 * out:.3g} mm out of requirements' box"
        )
    for zone in space.keep_out:
        findings.holds(
            not block.overlaps(block_of_zone(zone, centre)),
            "",
            f"reaches into the keep-out volume {zone.name!r}",
        )
