"""Claims about what projectors show: rings, or the code of the rig's `[dense]`."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from planning.model.document.device_records import ProjectorRecord
from planning.model.light.dense_code import DenseCode
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

_ROUNDING = 1e-9


def audit_codes(case: AuditCase, findings: AuditFindings) -> None:
    """Check that every projector shows the pattern that is required, and no other.

    A code is that of the rig, or of no such table the default one; then there is
    nothing of rings, no limit of theirs, and no ring axis.
    """
    plan, dense = case.plan, case.plan.requirements.pattern == "dense"
    for record in plan.document.projectors:
        below = findings.at(record.id)
        shows = "no code" if record.code is None else "a code"
        below.holds(
            (record.code is not None) is dense,
            "code",
            f"{shows} is stated, but requirements.pattern is "
            f"{plan.requirements.pattern!r}",
        )
        if dense and record.code is not None:
            _audit_code(record, plan.document.rig.dense, below)
    if not dense:
        return
    axes = plan.document.ring_axes
    findings.holds(axes is None, "ring_axes", "is stated, but a code has none")
    limits, space = plan.requirements.triangulation, plan.requirements.workspace
    for key, value, truth in (
        ("triangulation.min_conditioning", limits.min_conditioning, 0.0),
        ("triangulation.min_ring_pitch_px", limits.min_ring_pitch_px, None),
        ("triangulation.ring_sigma_m", limits.ring_sigma_m, None),
        ("workspace.reference_ring_radius", space.reference_ring_radius, 0.0),
    ):
        findings.same(f"requirements.{key}", value, truth, "that of a code", 0.0)


def _audit_code(
    record: ProjectorRecord, table: Mapping[str, Any], findings: AuditFindings
) -> None:
    stated = DenseCode()
    if table:
        noise = math.radians(table["phase_noise_deg"])
        stated = DenseCode(table["shifts"], table["period_px"], noise)
    for name in ("shifts", "period_px", "phase_noise"):
        claimed, truth = getattr(record.code, name), getattr(stated, name)
        findings.same(f"code.{name}", claimed, truth, f"rig.dense.{name}", _ROUNDING)
    same = np.array_equal(record.world_from_ring, record.world_from_device)
    findings.holds(same, "world_from_ring", "isn't world_from_device: it has no rings")
    for name in ("rings", "ring_shares"):
        stands = getattr(record, name) is not None
        findings.holds(not stands, name, "is stated, but a dense code has no rings")
