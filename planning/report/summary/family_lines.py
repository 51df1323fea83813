"""A family for a person: what each member gets from the rig, and what bounds it."""

from collections.abc import Iterator
from dataclasses import dataclass

from planning.model.document.family_records import FamilyCount, MemberBound
from planning.model.document.plan_document import MemberRecord
from planning.model.plan import RigPlan
from planning.model.words import count_words, share_words

_HEAD = (
    *("member", "lit", "measured", "of the target", "sigma, 95 % [mm]"),
    *("check, rms [mm]", "alone it takes"),
)


@dataclass(frozen=True)
class FamilyRow:
    """A member in words: a cell for each title of `family_heads`.

    Attributes:
        path: Its plan, beside the family's.
        worst: Whether the rest of the family's plan is of it.
    """

    cells: tuple[str, ...]
    path: str
    worst: bool


def family_heads() -> tuple[str, ...]:
    """Return the titles of the columns of `family_rows`."""
    return _HEAD


def family_rows(plan: RigPlan) -> Iterator[FamilyRow]:
    """Yield what each member of a family gets; nothing of a plan for one mesh."""
    family = plan.document.family
    if family is None:
        return
    for m, (record, member) in enumerate(
        zip(plan.document.members, plan.members, strict=True)
    ):
        remark = " (worst)" if m == family.worst else ""
        remark = " (left out)" if m in family.left_out else remark
        cells = (f"{record.name}{remark}", *_shares(member), *_exact(record))
        yield FamilyRow((*cells, _own(member)), record.path, m == family.worst)


def family_lines(plan: RigPlan) -> list[str]:
    """Return the table of a family, how it was laid over its first, and its bounds."""
    family = plan.document.family
    if family is None:
        return []
    rows = [family_heads(), *(row.cells for row in family_rows(plan))]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_HEAD))]
    lines = [
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    lines.append("lit and measured: of what can be; alone: projectors + cameras, found")
    moved = [record for record in plan.document.members if _distance(record)]
    for record in moved:
        lines.append(f"  {record.name} laid over the first {_distance(record)}")
    return [*lines, *family_bounds(plan)]


def family_bounds(plan: RigPlan) -> list[str]:
    """Return what is proved of fewer devices, a sentence of each kind."""
    family = plan.document.family
    if family is None:
        return []
    names = [record.name for record in plan.document.members]
    return [
        _bound("projector", family.projectors, names),
        _bound("camera", family.cameras, names),
    ]


def members_words(plan: RigPlan) -> str:
    """Return whom a family's rig measures: each of so many members."""
    family, n = plan.document.family, len(plan.document.members)
    if family is None:
        return ""
    left = len(family.left_out)
    if not left and family.n_asked == n:
        return f"each of {n} members"
    return f"{n - left} of {n} members ({family.n_asked} asked)"


def _bound(kind: str, told: FamilyCount, names: list[str]) -> str:
    found = count_words(told.count, kind)
    if told.needed > told.count:
        found = f"{told.count} of {told.needed} {kind}s that suffice"
    text = f"{found}; over candidates at least {told.lower_bound}"
    if told.over_poses is not None:
        text += f", over every pose {told.over_poses.lower_bound}"
        text += f" ({names[told.over_poses.member]} alone)"
    return f"{text}; {_hardest(told.hardest, names)}"


def _hardest(hardest: MemberBound, names: list[str]) -> str:
    return f"the hardest member alone, {names[hardest.member]}, takes {hardest.count}"


def _shares(member: RigPlan) -> Iterator[str]:
    areas, required = member.coverage.target, member.requirements
    for part, whole, asked in (
        (areas.lit_m2, areas.reachable_by_projectors_m2, required.dominant_coverage),
        (areas.measured_m2, areas.reachable_by_cameras_m2, required.coverage),
        (areas.measured_m2, areas.area_m2, 0.0),
    ):
        yield share_words(part, whole, asked)


def _exact(record: MemberRecord) -> tuple[str, str]:
    sigma, check = record.coverage.sigma, record.reconstruction
    exact = "" if sigma is None else f"{1e3 * sigma.p95_m:.3f}"
    if check is None:
        return exact, "NOT CHECKED"
    rms = check.accuracy_rms_m
    if rms is None:
        return exact, "no point"
    return exact, f"{1e3 * rms:.3f}{'' if check.passed else ' FAILED'}"


def _own(member: RigPlan) -> str:
    proofs = member.document.certificates
    lights = proofs.projectors
    if lights is None or lights.alone is None or proofs.cameras.alone is None:
        return ""
    if not proofs.cameras.alone:
        return "out of reach"
    return f"{lights.alone} + {proofs.cameras.alone}"


def _distance(record: MemberRecord) -> str:
    placed = record.alignment
    if placed is None or placed.rms_before_m is None or placed.rms_m is None:
        return ""
    before, after = 1e3 * placed.rms_before_m, 1e3 * placed.rms_m
    return f"to {after:.2f} mm rms, {before:.2f} before"
