"""Claims that a plan of cameras alone can't make, and how many must see a sample."""

from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

_OF_LIGHT = ("projectors", "overlaps")
_OF_PROJECTORS = ("ring_axes", "firing_schedule", "survival", "robust", "evaluation")
_REFERENCES = ("reference_projectors", "reference_rings")


def audit_views(case: AuditCase, findings: AuditFindings) -> None:
    """Check that there is nothing of projectors, and the least number of views."""
    document, required = case.plan.document, case.plan.requirements
    for name in _OF_LIGHT:
        n = len(getattr(document, name))
        findings.holds(n == 0, name, f"{n} are there, but the pattern is 'none'")
    for name in _OF_PROJECTORS:
        there = getattr(document, name) is not None
        findings.holds(not there, name, "is there, but the pattern is 'none'")
    for name in _REFERENCES:
        n = len(getattr(case.plan.surface, name))
        findings.holds(
            n == 0, f"surface.npz {name}", f"{n} poses are there, of no projector"
        )
    findings.holds(
        any("texture" in words for words in document.assumed),
        "assumed",
        "must say that texture is assumed",
    )
    views = required.min_views
    findings.holds(
        views is not None and views >= 2,
        "requirements.min_views",
        f"{views!r}: a pair of cameras takes two or more",
    )
    claimed = required.max_projectors
    findings.number("requirements.max_projectors", claimed, 0, 0.0, "projectors")
