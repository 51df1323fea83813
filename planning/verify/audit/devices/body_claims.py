"""Claims about bodies: whose they are, and what they must keep off."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from planning.model.bodies import Body
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_optics import in_frame
from planning.verify.audit.predicates.occlusion import (
    Block,
    block_of,
    block_of_zone,
    touches,
)

_ROUNDING = 1e-9


def audit_bodies(case: AuditCase, findings: AuditFindings) -> None:
    """Check whose bodies they are, and that they keep off what they must."""
    _audit_sources(case.plan, findings)
    _audit_clearance(case, findings)


def _audit_sources(plan: RigPlan, findings: AuditFindings) -> None:
    """Check that each device's body is that of the rig, or of its own entry there."""
    rig = plan.document.rig
    by_kind = {
        "projector": rig.projector.figures.body,
        "camera": rig.camera.figures.body,
    }
    by_name = {str(table.get("name")): table.get("body") for table in rig.existing}
    for kind, model in (("projector", rig.projector), ("camera", rig.camera)):
        _audit_body(f"rig.{kind}.body", model.body, by_kind[kind], findings)
    for device in (*plan.projectors, *plan.cameras):
        kind = "camera" if isinstance(device, PlannedCamera) else "projector"
        stated = by_name.get(device.existing) or by_kind[kind]
        _audit_body(f"{device.id}.body", device.body, stated, findings)
    for place, existing in enumerate(plan.requirements.existing):
        stated = by_name.get(existing.name) or by_kind[existing.kind]
        key = f"requirements.existing.{place}.body"
        _audit_body(key, existing.body, stated, findings)


def _audit_body(
    key: str,
    body: Body | None,
    stated: Mapping[str, Any] | None,
    findings: AuditFindings,
) -> None:
    """Compare a body in metres with the millimetres of the rig file."""
    if body is None or stated is None:
        findings.holds(
            body is None and stated is None,
            key,
            f"{body!r} is claimed, but the rig file has {stated!r}",
        )
        return
    for name, claimed, whose, unit in (
        ("centre_m", body.centre_m, "centre_mm", 1e-3),
        ("half_m", body.half_m, "size_mm", 0.5e-3),
    ):
        truth = unit * np.array(stated[whose], dtype=np.float64)
        findings.array(f"{key}.{name}", claimed, truth, _ROUNDING, whose)


def _audit_clearance(case: AuditCase, findings: AuditFindings) -> None:
    """Check that bodies keep off each other, the object, the floor and the zones.

    Floor and zones don't bind existing devices.
    """
    devices = (*case.plan.projectors, *case.plan.cameras)
    blocks = [(device, block_of(device)) for device in devices]
    solid = [(device, block.shrunk()) for device, block in blocks if block is not None]
    for (_, one), (_, other) in combinations(solid, 2):
        key = f"{one.name}.body"
        findings.holds(
            not one.overlaps(other), key, f"overlaps the body of {other.name}"
        )
    for device, block in solid:
        findings.holds(
            not touches(block, case.shadow.caster),
            f"{device.id}.body",
            "touches the object; it must stand off it",
        )
        for solid in case.shadow.hindrances:
            findings.holds(
                not touches(block, solid.caster),
                f"{device.id}.body",
                f"touches the obstacle {solid.name!r}; it must stand off it",
            )
        if not device.existing:
            _audit_zones(f"{device.id}.body", block, case.plan, findings)


def _audit_zones(
    key: str, block: Block, plan: RigPlan, findings: AuditFindings
) -> None:
    """Check that a body stands above the floor, in the box and off keep-out zones."""
    space = plan.requirements.workspace
    centre = np.array(space.centre)
    offsets = block.corners - centre
    if space.floor_m is not None:
        lowest = float((offsets @ np.array(space.up)).min())
        findings.holds(
            lowest >= space.floor_m,
            key,
            f"reaches {1e3 * (space.floor_m - lowest):.3g} mm below the floor",
        )
    if space.box is not None:
        room = block_of_zone(space.box, centre)
        beyond = np.abs(in_frame(room.world_from_box, block.corners)) - room.half
        out = float(beyond.max())
        findings.holds(
            out <= 0.0, key, f"reaches {1e3 * out:.3g} mm out of requirements' box"
        )
    for zone in space.keep_out:
        findings.holds(
            not block.overlaps(block_of_zone(zone, centre)),
            key,
            f"reaches into the keep-out volume {zone.name!r}",
        )
