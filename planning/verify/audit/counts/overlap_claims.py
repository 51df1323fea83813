"""Claims about overlaps: of light, so who fires together, and of what is measured."""

from dataclasses import replace
from itertools import combinations, product

import numpy as np
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Mask
from planning.model.document.coverage_records import Overlap
from planning.model.document.station_records import StationsRecord
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
# Parts that share so much of the target can be registered with each other.
_OVERLAP = 0.01
# Vertices coloured before a claim of exhaustion is taken as it is.
_STEPS = 200_000


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
            for part in ("target", "surface"):
                claimed, name = getattr(overlap, f"{part}_m2"), f"{key}.{part}_m2"
                estimator.audit(name, claimed, both, findings, part=part)
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
) -> Mask:
    """Return on which samples any light of a projector falls, shape (n,).

    Its last annulus ends one gap beyond its last ring.
    """
    outer = projector
    if projector.code is None:
        before, last = (0.0, *projector.radii)[-2:]
        outer = replace(projector, radii=np.array([last, last + (last - before)]))
    along, length = projector.light.to_points(samples.points)
    falls = outer.in_beam(samples.points) & (length >= 0.0)
    falls &= -dot(samples.normals, along) >= _GRAZING
    chosen = np.flatnonzero(falls)
    way = samples.points[chosen], along[chosen], length[chosen]
    free = shadow.free(way[0], samples.faces[chosen], *way[1:])
    falls[chosen] = free & free_of(
        (*projector.blocks, *shadow.about(projector.station)), *way
    )
    return falls


def _clearly_some(both: Mask, estimator: Estimator) -> bool:
    """Whether that many samples can't be what a set of the planner's size misses."""
    inside = estimator.samples.in_target
    for within in (inside, ~inside):
        n, k = int(within.sum()), np.array((both & within).sum(), float)
        if n and k / n > _DEVIATIONS * share_error(k, n, estimator.n_claimed):
            return True
    return False


def audit_schedule(case: AuditCase, findings: AuditFindings) -> None:
    """Check that groups have no claimed overlap, and are as few as is claimed.

    Every projector fires once; two whose claimed overlap has an area never fire
    together. The groups are the fewest if as many projectors overlap pairwise
    (`clique`), or if no assignment to one group fewer is left (`exhaustion`), which is
    tried here too.
    """
    document, findings = case.plan.document, findings.at("firing_schedule")
    schedule = document.firing_schedule
    if schedule is None:
        findings.fail("", "is missing")
        return
    names = [projector.id for projector in document.projectors]
    groups, near = schedule.groups, _overlapping(names, document.overlaps)
    _separate(near, document.stations)
    if not findings.partition("groups", groups, names):
        return
    for group in groups:
        for one, other in combinations(group, 2):
            findings.holds(
                other not in near[one],
                "groups",
                f"{one} and {other} fire together, but by the plan's own overlaps "
                f"they light a surface in common",
            )
    n, least, clique = len(groups), schedule.lower_bound, schedule.clique
    findings.same("n_groups", schedule.n_groups, n, "the number of groups")
    findings.holds(
        len(set(clique)) == len(clique)
        and set(clique) <= set(names)
        and all(other in near[one] for one, other in combinations(clique, 2)),
        "clique",
        f"{clique!r} must be projectors that overlap pairwise",
    )
    findings.holds(least <= n, "lower_bound", f"{least!r} for {n} groups")
    proved = {
        "clique": len(clique) == n == least,
        "exhaustion": least == n and not _colourable(near, n - 1),
        "none": least == len(clique),
    }
    findings.holds(
        proved[schedule.proof],
        "proof",
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


def _separate(near: dict[str, set[str]], stations: StationsRecord | None) -> None:
    """Take projectors at different stations as overlapping: they are one, moved."""
    if stations is None or stations.kind == "heads":
        return
    for one, other in combinations(stations.stations, 2):
        for a, b in product(one.projectors, other.projectors):
            near[a].add(b)
            near[b].add(a)


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


def audit_groups(case: AuditCase, findings: AuditFindings) -> None:
    """Check camera_groups: a partition, linked by overlaps of 1 % of the target.

    Overlaps clearly above 1 % must not be torn apart; no group may need one that is
    clearly below. Between the two, sampling decides and both answers are honest.
    """
    claimed = case.plan.document.camera_groups
    measured = case.actual.measured_by[:, case.samples.in_target]
    names = [camera.id for camera in case.plan.cameras]
    audit_partition(claimed, names, measured, case.estimator.n_claimed, findings)


def audit_partition(
    groups: tuple[tuple[str, ...], ...],
    names: list[str],
    measured: Mask,
    n_claimed: int,
    findings: AuditFindings,
) -> None:
    """Check groups of cameras against what each measures of n samples, (n_c, n)."""
    key = "camera_groups"
    if not findings.partition(key, groups, names):
        return
    n = measured.shape[1]
    shared = measured.astype(np.float64) @ measured.T
    shares, slack = shared / n, _DEVIATIONS * share_error(shared, n, n_claimed)
    group_of = {name: g for g, group in enumerate(groups) for name in group}
    number = np.array([group_of[name] for name in names])
    apart = number[:, None] != number
    for i, j in np.argwhere(np.triu(apart & (shares >= _OVERLAP + slack))):
        findings.fail(
            key,
            f"{names[i]} and {names[j]} stand in two groups, but share "
            f"{100 * shares[i, j]:.2f} % of the target",
        )
    _, linked = connected_components((shares + slack >= _OVERLAP) & ~apart)
    for group in groups:
        first = linked[names.index(group[0])]
        alone = [name for name in group if linked[names.index(name)] != first]
        findings.holds(
            not alone,
            key,
            f"{', '.join(alone)} stand in the group of {group[0]}, but no overlaps of "
            f"1 % of the target link them",
        )
