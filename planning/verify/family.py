"""A family's plan: its members are verified one by one, then what is said of all."""

from collections.abc import Sequence
from typing import Any

from geometry.mesh.mesh import TriangleMesh
from planning.model.document.family_records import FamilyCount
from planning.model.plan import RigPlan
from planning.verify.audit.audit import unmet_requirements
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.workspace_claims import audit_ball
from planning.verify.audit.rings.axis_claims import audit_centred
from planning.verify.audit.rings.ring_claims import audit_served

# Of the document of a member these are its own, and differ from the family's.
_OWN = frozenset(
    ("created", "timings_s", "cost", "meshes", "surface", "members", "family")
)
# What all members must have in common; the rest is what a mesh makes of it.
_SHARED = ("seed", "made_with", "command", "truncated", "rig")
_SLACK = 1e-9
# Members that get so much of what is asked refute that more devices are needed: other
# samples tell a little less.
_AMPLE = 1.02


def audit_family(plan: RigPlan, cases: Sequence[AuditCase]) -> tuple[str, ...]:
    """Return each false claim that a family's plan makes beyond those of its members.

    That all members stand before the same rig under the same requirements; that the
    plan tells their coverage and checks as they do, and is otherwise that of the worst
    one served; that enough are served; and what is said of the number of devices.
    The cases are the members'.
    """
    family, findings = plan.document.family, AuditFindings()
    assert family is not None
    n, members = len(plan.members), plan.members
    if not findings.holds(
        len(plan.document.meshes) == n and n > 0,
        "members",
        f"{n} members, {len(plan.document.meshes)} meshes",
    ):
        return findings.failures
    left = set(family.left_out)
    whole = family.worst < n and family.worst not in left and left <= set(range(n))
    if not findings.holds(
        whole, "family", "`worst` and `left_out` must be indices of members, and differ"
    ):
        return findings.failures
    _audit_records(plan, findings)
    _audit_rig(plan, findings)
    together = TriangleMesh.joined([member.surface.mesh for member in members])
    space = plan.requirements.workspace
    audit_ball(space, together, findings.at("requirements.workspace"))
    axes = plan.document.ring_axes
    served = [case for m, case in enumerate(cases) if m not in left]
    if axes is not None and axes.taken == "centred":
        # Members may have been left out before axes were chosen, or afterwards.
        groups = (served, cases) if left else (cases,)
        audit_centred(groups, findings.at("ring_axes"))
    for m, case in enumerate(cases):
        if m not in left:
            audit_served(case, findings.at(f"members.{m}"))
    least = family.quantile * n * (1.0 - _SLACK)
    asked = family.n_asked >= least and n - len(left) >= family.n_asked
    findings.holds(
        asked,
        "family.n_asked",
        f"{n - len(left)} of {n} members are served, {family.n_asked} are said to be "
        f"asked, and {family.quantile:g} of {n} are",
    )
    _audit_worst(family.worst, [m for m in range(n) if m not in left], plan, findings)
    spare = n - family.n_asked
    _audit_count(plan, "projectors", spare, findings)
    _audit_count(plan, "cameras", spare, findings)
    return findings.failures


def _audit_worst(
    worst: int, served: Sequence[int], plan: RigPlan, findings: AuditFindings
) -> None:
    """Check that the worst member misses a requirement if any member served does.

    And that of such, or of all if none does, the smallest share of what is asked is met
    of it.
    """
    short = [m for m in served if _falls_short(plan.members[m])]
    named = findings.holds(
        not short or worst in short,
        "family.worst",
        f"member {worst} misses no requirement, members {short} do",
    )
    if not named:
        return
    shares = {m: met(plan.members[m]) for m in short or served}
    lowest = min(shares.values())
    findings.holds(
        shares[worst] <= lowest + _SLACK,
        "family.worst",
        f"member {worst} meets {shares[worst]:.6g} of what is asked, another only "
        f"{lowest:.6g}",
    )


def _falls_short(plan: RigPlan) -> bool:
    """Whether a member misses a requirement, or failed its check, by its own claims."""
    check = plan.document.reconstruction
    return bool(unmet_requirements(plan)) or (check is not None and not check.passed)


def met(plan: RigPlan) -> float:
    """Return the smaller share of what is asked that is met, of light and of views."""
    return min(_met_by(plan).values())


def _met_by(plan: RigPlan) -> dict[str, float]:
    """Return the share of what is asked that is met by each kind of device."""
    asked, areas = plan.requirements, plan.coverage.target
    return {
        kind: got / (share * whole) if share * whole > 0.0 else 0.0
        for kind, got, share, whole in (
            (
                "projectors",
                areas.lit_m2,
                asked.dominant_coverage,
                areas.reachable_by_projectors_m2,
            ),
            (
                "cameras",
                areas.measured_m2,
                asked.coverage,
                areas.reachable_by_cameras_m2,
            ),
        )
    }


def _audit_records(plan: RigPlan, findings: AuditFindings) -> None:
    """Hold what the plan says of its members against what they say themselves."""
    names = [record.name.lower() for record in plan.document.members]
    findings.holds(len(set(names)) == len(names), "members", "two have one name")
    pairs = zip(plan.document.members, plan.members, strict=True)
    for m, (record, member) in enumerate(pairs):
        own = member.document
        for key, same in (
            ("mesh", record.mesh == m),
            ("digest", record.digest == member.digest),
            ("coverage", record.coverage == own.coverage),
            ("regions", record.regions == tuple(region.id for region in own.regions)),
            ("reconstruction", record.reconstruction == own.reconstruction),
        ):
            findings.holds(same, f"members.{m}.{key}", f"isn't what {record.path} says")
        findings.holds(
            own.meshes == (plan.document.meshes[m],),
            f"meshes.{m}",
            f"isn't the mesh of {record.path}",
        )


def _audit_rig(plan: RigPlan, findings: AuditFindings) -> None:
    """Check that all members have the same devices, and the plan is the worst one's."""
    family = plan.document.family
    assert family is not None
    worst = plan.members[family.worst].document
    for name in type(worst).model_fields:
        if name in _OWN:
            continue
        findings.holds(
            getattr(plan.document, name) == getattr(worst, name),
            name,
            f"isn't that of the worst member, {family.worst}",
        )
    findings.holds(
        bool((plan.surface.member == family.worst).all()),
        "surface",
        f"its faces must be of member {family.worst}",
    )
    for m, member in enumerate(plan.members):
        for name, same in (
            ("projectors", _devices(member) == _devices(plan)),
            ("requirements", _asked(member) == _asked(plan)),
            *((n, _part(member, n) == _part(plan, n)) for n in _SHARED),
        ):
            findings.holds(same, f"members.{m}", f"its {name} differ from the family's")


def _devices(plan: RigPlan) -> list[object]:
    """Everything of the devices but what they do for one mesh."""
    of_mesh = {"lit_area_m2", "min_margin_rad", "seen_area_m2", "sole_area_m2"}
    of_mesh |= {"rings", "ring_shares", "grey_levels", "exposure"}
    records = (*plan.document.projectors, *plan.document.cameras)
    return [
        {k: v for k, v in record.to_document().items() if k not in of_mesh}
        for record in records
    ]


def _asked(plan: RigPlan) -> dict[str, Any]:
    """What is asked, without the distance that follows from a mesh's ring gaps."""
    asked = plan.requirements.to_document()
    return asked | {"check": {**asked["check"], "tau_m": None}}


def _part(plan: RigPlan, name: str) -> object:
    return getattr(plan.document, name)


def _audit_count(plan: RigPlan, kind: str, spare: int, findings: AuditFindings) -> None:
    """Hold bounds of a number of devices against those of the members.

    Whoever may leave out `spare` members is bounded by the next largest of theirs.
    """
    family = plan.document.family
    assert family is not None
    told: FamilyCount = getattr(family, kind)
    inner = findings.at(f"family.{kind}")
    n_devices = len(getattr(plan.document, kind))
    inner.holds(told.count == n_devices, "count", f"the plan has {n_devices}")
    inner.holds(
        told.lower_bound <= told.needed,
        "lower_bound",
        f"{told.lower_bound} is more than the {told.needed} found",
    )
    proofs = [getattr(member.document.certificates, kind) for member in plan.members]
    bounds = sorted((p.needed.lower_bound for p in proofs), reverse=True)
    ample = min(_met_by(member)[kind] for _, member in plan.served) >= _AMPLE
    inner.holds(
        told.lower_bound <= told.count or not ample,
        "lower_bound",
        f"{told.lower_bound} is more than {told.count}, which are enough",
    )
    # Plans once claimed no more than the devices that they have.
    least = min(bounds[spare], told.count)
    inner.holds(
        told.lower_bound >= least,
        "lower_bound",
        f"{told.lower_bound} is less than member bounds prove, {least}",
    )
    if spare:
        inner.holds(
            told.lower_bound <= bounds[spare],
            "lower_bound",
            f"{told.lower_bound} is more than member bounds prove, {bounds[spare]}, "
            f"where {spare} may be left out",
        )
    over = [0 if p.continuous is None else p.continuous.lower_bound for p in proofs]
    if told.over_poses is not None:
        most = sorted(over, reverse=True)[spare]
        inner.holds(
            told.over_poses.lower_bound <= most,
            "over_poses.lower_bound",
            f"{told.over_poses.lower_bound} is more than member bounds prove, {most}",
        )
