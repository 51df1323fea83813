"""Claims of the tables: marginal gains, shares and members."""

from itertools import pairwise

from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings, square_centimetres
from planning.verify.audit.estimates import POINT, ROUNDING


def marginal_of(plan: RigPlan, kind: str, part: str) -> list[tuple[int, float]]:
    """Return (count, area in [m²]) of `projectors` or `cameras`, by rising count.

    Args:
        plan: The plan.
        kind: `projectors`: what is lit; `cameras`: what is measured.
        part: `target` or `surface`.
    """
    verb = "lit" if kind == "projectors" else "measured"
    return sorted(
        (getattr(row, f"n_{kind}"), getattr(row, f"{verb}_{part}_m2"))
        for row in plan.document.marginal
        if f"n_{kind}" in type(row).model_fields
    )


def audit_tables(case: AuditCase, findings: AuditFindings) -> None:
    """Check the marginal table, the dominant share, mesh areas and members."""
    for kind, chosen, count in (
        ("projectors", case.actual.lit, len(case.plan.projectors)),
        ("cameras", case.actual.measured, len(case.plan.cameras)),
    ):
        verb = "lit" if kind == "projectors" else "measured"
        for part, (_, whole) in case.estimator.wholes().items():
            table = marginal_of(case.plan, kind, part)
            findings.holds(table, f"marginal.{kind}", "is missing")
            for number, area in table:
                key = f"marginal.{kind}.{number}.{verb}_{part}_m2"
                if number == count:
                    case.estimator.audit(key, area, chosen, findings, part=part)
                    continue
                findings.holds(
                    0.0 <= area <= whole * (1.0 + ROUNDING),
                    key,
                    f"{area!r} is claimed, must be an area of at most "
                    f"{square_centimetres(whole)}",
                )
        slack = case.estimator.tolerance(
            chosen & case.samples.in_target, case.estimator.target_m2
        )
        _audit_rising(case.plan, kind, f"{verb}_target_m2", slack, findings)
    _audit_shares(case, findings)


def _audit_rising(
    plan: RigPlan, kind: str, name: str, slack: float, findings: AuditFindings
) -> None:
    """On the target more devices do more; on the surface one more may well add less."""
    for (fewer, less), (number, more) in pairwise(marginal_of(plan, kind, "target")):
        findings.holds(
            more >= less - slack,
            f"marginal.{kind}",
            f"{name} falls from {square_centimetres(less)} with {fewer} "
            f"{kind[: -1 if fewer == 1 else None]} to {square_centimetres(more)} with "
            f"{number}, more than sampling explains ({square_centimetres(slack)})",
        )


def _audit_shares(case: AuditCase, findings: AuditFindings) -> None:
    """Check the dominant share, the mesh areas, and members of a single mesh."""
    document, surface = case.plan.document, case.plan.surface
    total = surface.mesh.area
    share = float(surface.mesh.face_areas[surface.in_dominant].sum() / total)
    claimed = document.surface.dominant_share
    findings.number("surface.dominant_share", claimed, share, ROUNDING, "")
    areas = sum(mesh.area_m2 for mesh in document.meshes)
    findings.number("meshes.area_m2 (sum)", areas, total, POINT * 1e-2 * total)
    if len(document.meshes) == 1 and document.members:
        member = document.members[0]
        for name, same in (
            (
                "coverage",
                len(document.members) == 1 and member.coverage == document.coverage,
            ),
            (
                "reconstruction",
                member.reconstruction in (document.reconstruction, None),
            ),
        ):
            findings.holds(
                same,
                f"members.0.{name}",
                f"differs from {name}, of which it is the only member",
            )
