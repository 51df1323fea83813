"""Claims about bodies: whose they are, and how much each keeps from being measured."""

from typing import Any

import numpy as np

from planning.model.bodies import Body
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera
from planning.verify.audit.estimates import Estimator
from planning.verify.audit.ledger import Ledger, entries
from planning.verify.audit.predicates.blocks import block_of, way_to
from planning.verify.audit.predicates.predicates import CAMERA_BODY, LIT, PROJECTOR_BODY
from planning.verify.audit.predicates.recompute import Recomputed

_ROUNDING = 1e-9


def audit_bodies(plan: RigPlan, ledger: Ledger) -> None:
    """Check that each device's body is that of the rig, or of its own entry there."""
    own = {str(t.get("name")): t for t in entries(ledger.read("rig", "existing"))}
    for kind in ("projector", "camera"):
        figures = ledger.read("rig", kind, "figures", "body")
        _same(f"rig.{kind}.body", ledger.read("rig", kind, "body"), figures, ledger)
    for device in (*plan.projectors, *plan.cameras):
        kind = "camera" if isinstance(device, PlannedCamera) else "projector"
        stated = own.get(device.existing, {}).get("body")
        stated = stated or ledger.read("rig", kind, "figures", "body")
        _same(f"{device.id}.body", _plain(device.body), stated, ledger)
    for place, device in enumerate(plan.requirements.existing):
        stated = own.get(device.name, {}).get("body")
        stated = stated or ledger.read("rig", device.kind, "figures", "body")
        key = f"requirements.existing.{place}.body"
        _same(key, _plain(device.body), stated, ledger)


def audit_blocked(
    plan: RigPlan, own: Recomputed, estimator: Estimator, ledger: Ledger
) -> None:
    """Check `blocked_by_body_m2`: what each body keeps from being measured.

    The target area that isn't measured and where, for some projector or for some camera
    that looks at it lit, the first limit that fails is a body, and this one in the way.
    """
    claims = ledger.read("coverage", "blocked_by_body_m2") or {}
    devices = (*plan.projectors, *plan.cameras)
    names = sorted(device.id for device in devices if device.body is not None)
    key = "coverage.blocked_by_body_m2"
    if not ledger.holds(
        isinstance(claims, dict) and sorted(claims) == names,
        key,
        f"must hold an area for each of {names}",
    ):
        return
    dark = own.samples.in_target & ~own.measured
    stopped = [dark & (light == PROJECTOR_BODY) for light in own.light]
    for c in range(len(plan.cameras)):
        best = own.pairs[:, c].max(axis=0, initial=-1)
        lit = np.any(own.light == LIT, axis=0)
        stopped.append(dark & lit & (best == CAMERA_BODY))
    for device in devices:
        block = block_of(device)
        if block is None:
            continue
        found = np.zeros(len(own.samples), dtype=bool)
        for other, rows in zip(devices, stopped, strict=True):
            if other.id != device.id:
                chosen = np.flatnonzero(rows)
                points = own.samples.points[chosen]
                found[chosen] |= block.meets(way_to(other, points), points)
        ledger.number(
            f"{key}.{device.id}",
            claims[device.id],
            estimator.area(found),
            estimator.tolerance(found, estimator.target_m2),
        )


def _plain(body: Body | None) -> dict[str, Any] | None:
    if body is None:
        return None
    return {"centre_m": list(body.centre_m), "half_m": list(body.half_m)}


def _same(key: str, body: object, stated: object, ledger: Ledger) -> None:
    """Compare a body in metres with the millimetres of the rig file."""
    both = isinstance(body, dict), isinstance(stated, dict)
    if not ledger.holds(
        both[0] == both[1], key, f"{body!r} is claimed, but the rig file has {stated!r}"
    ):
        return
    if isinstance(body, dict) and isinstance(stated, dict):
        for name, whose, unit in (
            ("centre_m", "centre_mm", 1e-3),
            ("half_m", "size_mm", 0.5e-3),
        ):
            truth = np.asarray(stated.get(whose), dtype=np.float64) * unit
            ledger.array(f"{key}.{name}", body.get(name), truth, _ROUNDING, whose)
