"""The plan of a family: that of its worst member, with all members beside it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planning.model.document.coverage_records import Coverage
from planning.model.document.family_records import AlignmentRecord, FamilyRecord
from planning.model.document.plan_document import MemberRecord
from planning.model.plan import RigPlan, member_path
from planning.model.requirements import Requirements
from planning.report.summary.shortfall import missing


def family_plan(
    members: Sequence[RigPlan],
    names: Sequence[str],
    alignments: Sequence[AlignmentRecord],
    record: FamilyRecord,
) -> RigPlan:
    """Return the plan of a family from those of its members, of the same devices.

    Members that miss a requirement are left out too, if all of these may be. Its claims
    are those of the worst member served: one that misses a requirement, if any does,
    and of such the one of which the smallest share of what is asked is met.
    """
    members = [_named(plan, name) for plan, name in zip(members, names, strict=True)]
    served = [m for m in range(len(members)) if m not in record.left_out]
    short = {m for m in served if any(missing(members[m]))}
    if len(short) <= len(served) - record.n_asked:
        served = [m for m in served if m not in short]
    worst = min(served, key=lambda m: (m not in short, met(members[m]), m))
    left_out = tuple(m for m in range(len(members)) if m not in served)
    shown = members[worst]
    n_faces = len(shown.surface.mesh.faces)
    surface = replace(shown.surface, member=np.full(n_faces, worst, dtype=np.int64))
    records = tuple(
        MemberRecord(
            mesh=m,
            coverage=plan.document.coverage,
            regions=plan.document.members[0].regions,
            reconstruction=plan.document.reconstruction,
            name=name,
            path=member_path(name),
            digest=plan.digest,
            alignment=alignment,
        )
        for m, (plan, name, alignment) in enumerate(
            zip(members, names, alignments, strict=True)
        )
    )
    document = shown.document.changed(
        meshes=tuple(plan.document.meshes[0] for plan in members),
        surface=shown.document.surface.changed(sha256=surface.sha256()),
        members=records,
        family=record.changed(worst=worst, left_out=left_out),
    )
    return RigPlan(document, surface, tuple(members))


def _named(plan: RigPlan, name: str) -> RigPlan:
    """Return the plan of a member, which says that it is one."""
    (record,) = plan.document.members
    named = plan.document.changed(members=(record.changed(name=name),))
    return replace(plan, document=named)


def met(plan: RigPlan) -> float:
    """Return the smaller share of what is asked that is met, of light and of views."""
    asked: Requirements = plan.requirements
    coverage: Coverage = plan.coverage
    areas = coverage.target
    shares = (
        (areas.lit_m2, areas.reachable_by_projectors_m2 * asked.dominant_coverage),
        (areas.measured_m2, areas.reachable_by_cameras_m2 * asked.coverage),
    )
    return min(got / of if of > 0.0 else 0.0 for got, of in shares)


def with_members(plan: RigPlan, members: Sequence[RigPlan]) -> RigPlan:
    """Return the plan of a family with other plans of the same members."""
    told, family = plan.document.members, plan.document.family
    assert family is not None
    names = [record.name for record in told]
    alignments = [record.alignment for record in told if record.alignment is not None]
    return family_plan(members, names, alignments, family)
