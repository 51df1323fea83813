"""Claims about which projectors fire together, from the overlaps of the same plan."""

from itertools import combinations

from planning.model.document.coverage_records import ExposureSchedule, Overlap
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

_KEY = "firing_schedule"
# Vertices coloured before a claim of exhaustion is taken as it is.
_STEPS = 200_000


def audit_schedule(case: AuditCase, findings: AuditFindings) -> None:
    """Check `firing_schedule` against the plan's overlaps."""
    document = case.plan.document
    if document.firing_schedule is None:
        findings.fail(_KEY, "is missing")
        return
    names = [projector.id for projector in document.projectors]
    audit_groups_of_light(names, document.overlaps, document.firing_schedule, findings)


def audit_groups_of_light(
    names: list[str],
    overlaps: tuple[Overlap, ...],
    schedule: ExposureSchedule,
    findings: AuditFindings,
) -> None:
    """Check that groups have no overlap, and are as few as is claimed.

    Every projector fires once; two whose claimed overlap has an area never fire
    together. The groups are the fewest if as many projectors overlap pairwise
    (`clique`), or if no assignment to one group fewer is left (`exhaustion`), which is
    tried here too.
    """
    groups, near = schedule.groups, _overlapping(names, overlaps)
    if not findings.holds(
        all(groups)
        and sorted(name for group in groups for name in group) == sorted(names),
        f"{_KEY}.groups",
        f"{groups!r} must name each of {', '.join(names)} exactly once",
    ):
        return
    for group in groups:
        for one, other in combinations(group, 2):
            findings.holds(
                other not in near[one],
                f"{_KEY}.groups",
                f"{one} and {other} fire together, but by the plan's own overlaps "
                f"they light a surface in common",
            )
    n, least, clique = len(groups), schedule.lower_bound, schedule.clique
    findings.holds(
        schedule.n_groups == n,
        f"{_KEY}.n_groups",
        f"{schedule.n_groups!r} is claimed for {n} groups",
    )
    findings.holds(
        len(set(clique)) == len(clique)
        and set(clique) <= set(names)
        and all(other in near[one] for one, other in combinations(clique, 2)),
        f"{_KEY}.clique",
        f"{clique!r} must be projectors that overlap pairwise",
    )
    findings.holds(least <= n, f"{_KEY}.lower_bound", f"{least!r} for {n} groups")
    proved = {
        "clique": len(clique) == n == least,
        "exhaustion": least == n and not _colourable(near, n - 1),
        "none": least == len(clique),
    }
    findings.holds(
        proved[schedule.proof],
        f"{_KEY}.proof",
        f"{schedule.proof!r} doesn't prove that {least} groups are needed",
    )


def _overlapping(
    names: list[str], overlaps: tuple[Overlap, ...]
) -> dict[str, set[str]]:
    near: dict[str, set[str]] = {name: set() for name in names}
    for overlap in overlaps:
        one, other = overlap.projectors
        lit = max(overlap.target_m2, overlap.surface_m2) > 0.0
        if lit and one != other and {one, other} <= set(near):
            near[one].add(other)
            near[other].add(one)
    return near


def _colourable(near: dict[str, set[str]], k: int) -> bool:
    """Whether k groups are enough, projectors taken as they come; False in doubt."""
    names, steps = list(near), 0
    group: dict[str, int] = {}

    def place(i: int, used: int) -> bool:
        nonlocal steps
        steps += 1
        if i == len(names) or steps > _STEPS:
            return i == len(names)
        taken = {group[other] for other in near[names[i]] if other in group}
        for g in range(min(used + 1, k)):
            if g not in taken:
                group[names[i]] = g
                if place(i + 1, max(used, g + 1)):
                    return True
                del group[names[i]]
        return False

    return place(0, 0)
