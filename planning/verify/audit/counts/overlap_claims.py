"""Claims about overlapping light, and which projectors may fire together."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from planning.model.document.coverage_records import ExposureSchedule, Overlap
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.estimates import Estimator, share_error
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.audit_optics import dot
from planning.verify.audit.predicates.occlusion import Shadow, free_of

# Light that grazes a face at more than this is left out.
_GRAZING = np.cos(np.radians(89.0))
_DEVIATIONS = 4.0


def audit_overlaps(case: AuditCase, findings: AuditFindings) -> None:
    """Check `overlaps`: each pair once, with its areas, and that none fires together.

    A group may hold a pair of which few samples get light from both: the planner's may
    have missed them. It may not where so many do that this is no chance.
    """
    document, estimator = case.plan.document, case.estimator
    names = [projector.id for projector in document.projectors]
    falls = {
        name: light_falls(projector, case.samples, case.shadow)
        for name, projector in zip(names, case.projectors, strict=True)
    }
    pairs = {frozenset(pair) for pair in combinations(names, 2)}
    listed = [frozenset(overlap.projectors) for overlap in document.overlaps]
    findings.holds(
        set(listed) == pairs and len(listed) == len(pairs),
        "overlaps",
        f"must name each of the {len(pairs)} pairs of {', '.join(names)} exactly once",
    )
    for overlap in document.overlaps:
        one, other = overlap.projectors
        if frozenset(overlap.projectors) in pairs:
            key, both = f"overlaps.{one} + {other}", falls[one] & falls[other]
            claimed = overlap.target_m2
            estimator.audit(f"{key}.target_m2", claimed, both, findings)
            claimed = overlap.surface_m2
            estimator.audit(
                f"{key}.surface_m2", claimed, both, findings, part="surface"
            )
    schedule = document.firing_schedule
    for group in () if schedule is None else schedule.groups:
        for one, other in combinations([n for n in group if n in falls], 2):
            both = falls[one] & falls[other]
            findings.holds(
                not _clearly_some(both, estimator),
                "firing_schedule.groups",
                f"{one} and {other} fire together, but light of both falls on "
                f"{1e4 * estimator.area(both):.3g} cm²",
            )


def light_falls(
    projector: AuditProjector, samples: AuditSamples, shadow: Shadow
) -> NDArray[np.bool_]:
    """Return on which samples any light of a projector falls, shape (n,).

    Its last annulus ends one gap beyond its last ring.
    """
    before, last = (0.0, *projector.radii)[-2:]
    outer = replace(projector, radii=np.array([last, last + (last - before)]))
    along, length = projector.light.to_points(samples.points)
    falls = outer.in_beam(samples.points) & (length >= 0.0)
    falls &= -dot(samples.normals, along) >= _GRAZING
    chosen = np.flatnonzero(falls)
    way = samples.points[chosen], along[chosen], length[chosen]
    free = shadow.free(way[0], samples.faces[chosen], *way[1:])
    falls[chosen] = free & free_of((*projector.blocks, *shadow.hindrances), *way)
    return falls


def _clearly_some(both: NDArray[np.bool_], estimator: Estimator) -> bool:
    """Whether that many samples can't be what a set of the planner's size misses."""
    inside = estimator.samples.in_target
    for within in (inside, ~inside):
        n, k = int(within.sum()), np.array((both & within).sum(), float)
        if n and k / n > _DEVIATIONS * share_error(k, n, estimator.n_claimed):
            return True
    return False


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
    """Projectors that each overlaps by the claimed areas."""
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
