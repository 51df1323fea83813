"""Claims about members: of one mesh the plan itself, or one of a family's."""

from planning.model.document.plan_document import MemberRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings


def audit_members(case: AuditCase, findings: AuditFindings) -> None:
    """Check that a plan's only member is the plan itself.

    A family's plan is looked at with all of its members.
    """
    document = case.plan.document
    if document.family is not None:
        return
    n, meshes = len(document.members), len(document.meshes)
    if findings.holds(
        n == meshes == 1,
        "members",
        f"{n} of {meshes} meshes, must be one of one: the plan is no family's",
    ):
        _audit_sole(case.plan, document.members[0], findings.at("members.0"))


def _audit_sole(plan: RigPlan, member: MemberRecord, findings: AuditFindings) -> None:
    document = plan.document
    regions = tuple(region.id for region in document.regions)
    for name, same in (
        ("mesh", member.mesh == 0),
        ("regions", member.regions == regions),
        ("coverage", member.coverage == document.coverage),
        ("reconstruction", member.reconstruction in (document.reconstruction, None)),
    ):
        findings.holds(
            same, name, "differs from the plan's, of which it is the only member"
        )
    if plan.of_member:
        for what in _of_one_mesh(plan):
            findings.fail(
                "name", f"{member.name!r} is of a family, and no family has {what}"
            )


def _of_one_mesh(plan: RigPlan) -> list[str]:
    """Return what a plan has that is only planned for one mesh."""
    document, asked = plan.document, plan.requirements
    kept, rig = asked.survival, document.rig
    there = {
        "requirements.region_coverage": asked.region_coverage > 0.0,
        "requirements.robust": asked.robust is not None,
        "requirements.survival": kept is not None
        and (kept.views > 1 or kept.survive > 0),
        "requirements.existing": bool(asked.existing),
        "requirements.pattern 'none'": plan.cameras_alone,
        "stations": document.stations is not None or rig.turntable is not None,
        "ranges": document.ranges is not None,
        "joint": document.joint is not None,
        "evaluation": document.evaluation is not None,
    }
    return [what for what, has in there.items() if has]
