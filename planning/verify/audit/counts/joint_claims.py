"""Claims of projectors and cameras that were planned together.

`docs/reference/semantics.md`, "Joint plans". Counts and costs are the plan's own, the
slack is recomputed; of the two stages' plan, which is gone, only what can't be is told.
"""

import numpy as np

from geometry.arrays import Array, Ints
from planning.model.document.joint_records import DeviceCount, JointRecord
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT, share_error
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.audit_optics import dot, towards
from planning.verify.audit.predicates.error_terms import (
    NOISE_TERMS,
    PairGeometry,
    deviation,
    error_terms,
)
from planning.verify.audit.predicates.predicates import MEASURED

_ROUNDING = 1e-9
# Of a share of a limit: what rounded poses move slack by.
_MOVED = 2e-3


def audit_joint(case: AuditCase, findings: AuditFindings) -> None:
    """Check what was saved, that bounds don't refute each other, and the slack."""
    record = case.plan.document.joint
    if record is None:
        return
    below = findings.at("joint")
    _audit_counts(case, record, below)
    _audit_bound(case, record, below)
    _audit_slack(case, record, below)


def _audit_counts(
    case: AuditCase, record: JointRecord, findings: AuditFindings
) -> None:
    """Check the plan's numbers and cost, and that two stages took no less."""
    own = DeviceCount(
        projectors=len(case.kinds[0].devices),
        cameras=len(case.kinds[1].devices),
        cost=sum(
            _cost(case, kind.name, d.model) for kind in case.kinds for d in kind.devices
        ),
    )
    slack = _ROUNDING * max(own.cost, 1.0)
    for name in ("projectors", "cameras", "cost"):
        truth = getattr(own, name)
        findings.number(f"joint.{name}", getattr(record.joint, name), truth, slack, "")
    before = record.two_stage
    least, most = (
        sum(
            getattr(before, f"{kind.name}s")
            * ends(_cost(case, kind.name, model.name) for model in kind.models)
            for kind in case.kinds
        )
        for ends in (min, max)
    )
    findings.holds(
        least - slack <= before.cost <= most + slack,
        "two_stage.cost",
        f"{before.cost:g} is claimed, such devices cost {least:g} to {most:g}",
    )
    same = (before.projectors, before.cameras) == (own.projectors, own.cameras)
    findings.holds(
        own.cost <= before.cost + slack and (record.found != "two stages" or same),
        "found",
        f"{record.found!r} is claimed of {own.projectors} + {own.cameras} for "
        f"{own.cost:g}, instead of {before.projectors} + {before.cameras} for "
        f"{before.cost:g}",
    )


def _audit_bound(case: AuditCase, record: JointRecord, findings: AuditFindings) -> None:
    """Check the bound against what suffices, and the scope against the poses."""
    slack = _ROUNDING * max(record.needed, 1.0)
    findings.holds(
        record.lower_bound <= record.needed + slack
        and record.needed <= record.two_stage.cost + slack,
        "needed",
        f"{record.needed:g} must be at least the bound of {record.lower_bound:g} and "
        f"at most the {record.two_stage.cost:g} of two stages",
    )
    proved = record.lower_bound >= record.needed - slack
    findings.holds(
        (record.status == "optimal") == proved,
        "status",
        f"{record.status!r} is claimed of a bound of {record.lower_bound:g} on "
        f"{record.needed:g}",
    )
    for kind in case.kinds:
        name = f"{kind.name}s"
        offered, own = getattr(record.over, name), getattr(record.two_stage, name)
        findings.holds(
            own <= offered <= own + len(kind.poses),
            f"over.{name}",
            f"{offered} are claimed of {len(kind.poses)} poses and {own} devices",
        )


def _audit_slack(case: AuditCase, record: JointRecord, findings: AuditFindings) -> None:
    """Check that the required share of the target has the claimed slack."""
    inside = case.samples.in_target
    areas = case.plan.coverage.target
    share = case.plan.requirements.coverage * areas.reachable_by_cameras_m2
    share /= areas.area_m2
    slack = best_slack(case)[inside]
    n = len(slack)
    room = POINT + 3.0 * float(
        share_error(np.array(share * n), n, case.plan.coverage.samples)
    )
    if record.margin is None:
        held = float(np.mean(slack >= 0.0))
        findings.holds(
            held <= share + room, "margin", f"null, but {held:.2%} are measured"
        )
        return
    least, most = (
        float(np.mean(slack >= record.margin + moved)) for moved in (_MOVED, -_MOVED)
    )
    findings.holds(
        least - room <= share <= most + room,
        "margin",
        f"{record.margin:.4g} is claimed of {share:.2%} of the target, recomputed "
        f"{least:.2%} have it",
    )
    findings.holds(
        (record.margin_before or 0.0) <= record.margin + _ROUNDING,
        "margin_before",
        f"{record.margin_before} is more than the {record.margin} that it became",
    )


def _cost(case: AuditCase, kind: str, model: str) -> float:
    known = case.plan.document.rig.model_of(kind, model).cost
    return 1.0 if known is None else known


def best_slack(case: AuditCase) -> Array:
    """Return each sample's slack by its best pair, -inf where none measures it."""
    slack = np.full(len(case.samples), -np.inf)
    for p, projector in enumerate(case.projectors):
        for c, camera in enumerate(case.cameras):
            some = np.flatnonzero(case.actual.pairs[p, c] == MEASURED)
            if len(some):
                found = _slack_of(case, projector, camera, some)
                slack[some] = np.maximum(slack[some], found)
    return slack


def _slack_of(
    case: AuditCase, projector: AuditProjector, camera: AuditCamera, some: Ints
) -> Array:
    """Return the least of the slacks of all limits, as shares of these, (k,)."""
    limits, samples = case.plan.requirements, case.samples.take(some)
    rules = limits.triangulation
    pair = PairGeometry.of(projector, camera, samples)
    along, _ = projector.light.to_points(samples.points)
    view, _ = towards(samples.points, camera.world_from_device[:3, 3])
    met = _angle(-dot(samples.normals, along)) / limits.projector.max_incidence
    seen = _angle(-dot(samples.normals, view)) / limits.camera.max_incidence
    shares = [1.0 - met, 1.0 - seen, 1.0 - rules.min_conditioning / pair.conditioning]
    least = limits.projector.min_tangent_angle
    tangent = _angle(np.abs(dot(samples.steep, along)))
    known = np.any(samples.steep != 0.0, axis=1)
    shares.append(np.where(known, (tangent - least) / (0.5 * np.pi - least), np.inf))
    if rules.max_sigma_m is not None:
        names = NOISE_TERMS if rules.accuracy_of == "noise" else None
        sigma = deviation(error_terms(pair, rules), names)
        shares.append(1.0 - sigma / rules.max_sigma_m)
    if projector.code is not None:
        low, high = rules.angles
        ends = np.minimum(pair.met - low, high - pair.met)
        shares.append(ends / (0.5 * (high - low)))
    return np.min(shares, axis=0)


def _angle(cosine: Array) -> Array:
    return np.arccos(np.clip(cosine, -1.0, 1.0))
