"""The plan's `request`: what was asked, defaults included; and the digests over it."""

from dataclasses import fields

from planning.model.document.plan_document import PlanDocument
from planning.model.document.request_records import RequestRecord, asked_digest
from planning.report.partial_plan import PlanRequest
from planning.rig.wishes import Wishes

_SHARES = ("coverage", "dominant_coverage", "min_reachable", "region_coverage")
# By every request, of whom nobody asks whether it did.
_STATED = ("max_projectors", "pattern")


def request_record(request: PlanRequest) -> RequestRecord:
    """Return what was asked, before wishes were tightened for it."""
    wishes, table = request.stated or request.wishes, request.rig.table
    given = [
        field.name
        for field in fields(Wishes)
        if field.name not in _STATED and getattr(wishes, field.name) != field.default
    ]
    stated = {name: getattr(wishes, name) for name in _SHARES}
    accuracy = wishes.accuracy_mm
    axis = wishes.ring_axis or request.rig.rings.axis
    return RequestRecord(
        given=tuple(given),  # type: ignore[arg-type]
        max_projectors=wishes.max_projectors,
        max_cameras=wishes.max_cameras,
        max_heads=wishes.max_heads,
        target=wishes.target or "dominant",
        pattern=wishes.pattern,
        **{
            name: getattr(table.requirements, name) if share is None else share
            for name, share in stated.items()
        },
        accuracy_mm=table.limits.max_sigma_mm if accuracy is None else accuracy,
        accuracy_of=wishes.accuracy_of,
        up=wishes.up or table.workspace.up,  # type: ignore[arg-type]
        ring_axis=axis if wishes.pattern == "rings" else None,
        robust=wishes.robust,
        views=wishes.views,
        survive=wishes.survive,
        joint=wishes.joint,
        cameras_by=request.cameras_by,
    )


def signed(document: PlanDocument) -> PlanDocument:
    """Return a document whose derived parts carry the digest of what was asked."""
    digest = asked_digest(document.request, document.requirements, document.rig)
    coverage = document.coverage.changed(asked=digest)
    return document.changed(
        coverage=coverage,
        certificates=document.certificates.changed(asked=digest),
        members=tuple(
            member.changed(coverage=coverage) if len(document.members) == 1 else member
            for member in document.members
        ),
    )
