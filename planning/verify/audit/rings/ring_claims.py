"""Claims about a projector's rings: how they are spaced, and what they leave out."""

from dataclasses import replace

import numpy as np

from geometry.arrays import Array, Mask
from planning.model.document.ring_records import RingSharesRecord, RingsRecord
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT, ROUNDING
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import pairs_with

from .ring_grid import (
    AZIMUTHS,
    ROWS,
    AuditCreases,
    RingGrid,
    audit_creases,
    audit_extreme,
    cast_rings,
    creases_of,
    strays,
)

# Of the chords so many are told otherwise by poses rounded after rings were spaced, and
# by other rays: on rough skin one in a hundred, and of few chords a chord or two.
_STRAY_SLACK, _STRAY_CHORDS = 0.01, 2.0
# Rays of a ring are told from the next gap by taking them from just inside it.
_INSIDE = 1.0 - 1e-9
# Rays of a ring that rounding may turn at limits and outlines, and written digits.
_SLACK = 3.0 / AZIMUTHS + 1e-4


def audit_rings(case: AuditCase, findings: AuditFindings) -> None:
    """Check `rings` and `ring_shares` of every projector.

    A plan that has none of them claims nothing; one that has some must have all.
    `rings` may be null in a run that was cut.
    """
    records = case.plan.document.projectors
    if all(record.rings is None and record.ring_shares is None for record in records):
        return
    creases = creases_of(case.plan.surface)
    kept = {e.name for e in case.plan.requirements.existing if e.ring_radii}
    for record, projector in zip(records, case.projectors, strict=True):
        shares, rings, below = record.ring_shares, record.rings, findings.at(record.id)
        if shares is None:
            below.fail("ring_shares", "is missing")
        else:
            _audit_ring_shares(shares, case, projector, below.at("ring_shares"))
        if rings is None:
            below.holds(case.plan.document.truncated, "rings", "is missing")
        else:
            stay = record.name in kept
            below.holds(
                stay == (rings.spacing == "kept"),
                "rings.spacing",
                f"{rings.spacing!r} is claimed, but requirements.existing says "
                f"{'otherwise' if stay else 'nothing of its rings'}",
            )
            _audit_spacing(rings, projector, creases, case, below.at("rings"))


def _audit_spacing(
    rings: RingsRecord,
    projector: AuditProjector,
    creases: AuditCreases,
    case: AuditCase,
    findings: AuditFindings,
) -> None:
    stated = case.plan.document.rig.rings
    wish, spacing, count = stated.get("spacing"), rings.spacing, rings.n_even
    findings.holds(
        wish in ("curvature", "uniform") or "spacing" not in stated,
        "spacing",
        f"rig.rings.spacing is {wish!r}, must be 'curvature' or 'uniform'",
    )
    findings.holds(
        spacing != "curvature" or wish != "uniform",
        "spacing",
        f"{spacing!r} is claimed, but rig.rings.spacing is {wish!r}",
    )
    findings.holds(
        rings.kept_even is (spacing == "uniform" and wish == "curvature"),
        "kept_even",
        f"{rings.kept_even!r} is claimed where rings are {spacing!r} and "
        f"rig.rings.spacing is {wish!r}",
    )
    if not findings.holds(count >= 2, "n_even", f"{count!r} must be at least 2 rings"):
        return
    # What is told of rings is of all that were spaced, shown or left out.
    projector, even = _all_and_even(rings, projector)
    every = projector.radii
    findings.holds(
        spacing != "uniform"
        or (
            len(even) == len(every)
            and np.allclose(every, even, rtol=0.0, atol=ROUNDING * even[-1])
        ),
        "n_even",
        f"the {len(every)} ring_radii aren't {count} at equal steps, but 'uniform' is "
        f"claimed",
    )
    grid = cast_rings(case, projector, _rows(even))
    _audit_gaps(rings, grid, findings)
    # A family spaces rings for the members that it serves: only it knows which.
    if not case.plan.of_member:
        _audit_widest(rings, even, grid, findings)
        if "left_out" in rings.model_fields_set:
            _audit_idle(rings, grid, case, findings)
    limits = case.plan.requirements
    sigma = limits.triangulation.max_sigma_m
    tolerance = limits.check.max_p95_m if sigma is None else sigma
    steepest = limits.projector.max_incidence
    share, n_chords = strays(grid, creases, steepest, tolerance)
    truth = {"over_tolerance": share}
    # A few chords are a rough share.
    slack = max(_STRAY_SLACK, _STRAY_CHORDS / max(n_chords, 1))
    findings.numbers(rings, truth, slack, "of the chords")
    audit_creases(rings.creases, case, projector, creases, findings.at("creases"))


def audit_served(case: AuditCase, findings: AuditFindings) -> None:
    """Check what a family's rings owe to a member that is served.

    No gap on it is wider than an even one, and no ring that is left out lights it.
    """
    records = case.plan.document.projectors
    for record, projector in zip(records, case.projectors, strict=True):
        rings, below = record.rings, findings.at(f"{record.id}.rings")
        if rings is None or rings.n_even < 2:
            continue
        whole, even = _all_and_even(rings, projector)
        grid = cast_rings(case, whole, _rows(even))
        _audit_widest(rings, even, grid, below)
        if rings.left_out:
            _audit_idle(rings, grid, case, below, hidden_alone=True)


def _all_and_even(
    rings: RingsRecord, projector: AuditProjector
) -> tuple[AuditProjector, Array]:
    """Return all rings, shown or left out, and as far as they reach the even ones."""
    every = np.sort(np.concatenate([projector.radii, rings.left_out]))
    even = float(every[-1]) * np.arange(1, rings.n_even + 1) / rings.n_even
    return replace(projector, radii=every), even


def _rows(even: Array) -> Array:
    """Return the coordinates at which rays between even rings are cast."""
    return np.arange(1, ROWS * len(even) + 1) * (even[0] / ROWS)


def _audit_gaps(rings: RingsRecord, grid: RingGrid, findings: AuditFindings) -> None:
    """Check `gap_m`, the least and largest distance of rings on lit surface."""
    points = _lit_points(grid)
    if len(points) == 0:
        return
    if rings.gap_m is None:
        findings.fail("gap_m", "is missing")
        return
    gaps, alike = grid.projector.ring_spacing(points), np.ones(len(points))
    for place, largest in enumerate((False, True)):
        name, claimed = f"gap_m.{place}", rings.gap_m[place]
        audit_extreme(name, claimed, gaps, alike, findings, largest=largest)


def _audit_widest(
    rings: RingsRecord, even: Array, grid: RingGrid, findings: AuditFindings
) -> None:
    """Check that no gap on lit surface is wider than an even one: bounds `n_even`."""
    points = _lit_points(grid)
    if len(points) == 0:
        return
    gaps = grid.projector.ring_spacing(points)
    wide = replace(grid.projector, radii=even).ring_spacing(points)
    share = float(np.mean(gaps > wide * (1.0 + ROUNDING)))
    findings.holds(
        share <= POINT or rings.spacing == "kept",
        "n_even",
        f"{len(even)} even rings stand closer than the plan's on {100 * share:.3g} % "
        f"of its light on the surface, nowhere may they",
    )


def _lit_points(grid: RingGrid) -> Array:
    """Return lit points inside the last row, (n, 3): rounding decides about that."""
    inner = grid.rays < (len(grid.coordinates) - 1) * AZIMUTHS
    return grid.samples.points[grid.lit & inner]


def _audit_idle(
    rings: RingsRecord,
    grid: RingGrid,
    case: AuditCase,
    findings: AuditFindings,
    *,
    hidden_alone: bool = False,
) -> None:
    """Check that rings left out would light nothing, and that those shown may.

    The object is where rays meet it and where the panel holds its vertices. The band of
    a ring reaches to its neighbours, and `rig.rings.margin_m` beyond at the standoff; a
    row of the grid is left to rounding.
    """
    rig, projector = case.plan.document.rig, grid.projector
    every, left_out = projector.radii, np.array(rings.left_out)
    margin = projector.light.coordinate_of(
        float(rig.rings.get("margin_m", 0.0)), rig.standoff_m or 1.0
    )
    vertices = case.plan.surface.mesh.vertices
    met = projector.ring_coordinate(vertices[projector.light.leaves(vertices)])
    rows = np.unique(grid.coordinates[grid.rays // AZIMUTHS])
    places = np.sort(np.concatenate([rows, met]))
    edges = np.concatenate([[0.0], every, [2.0 * every[-1] - every[-2]]])
    hidden, row = np.isin(every, left_out), float(grid.coordinates[0])
    room = np.where(hidden, margin - row, margin + row)
    begin = np.searchsorted(places, edges[:-2] - room, side="left")
    lights = begin < np.searchsorted(places, edges[2:] + room, side="right")
    for wrong, key, words in (
        (hidden & lights, "left_out", "light the object and are left out"),
        (
            ~hidden & ~lights & (not hidden_alone),
            "ring_radii",
            "light nothing of the object and are shown",
        ),
    ):
        findings.holds(
            not wrong.any(),
            key,
            f"{np.count_nonzero(wrong)} rings {words}, with a margin of "
            f"{margin:.4g}: {np.round(every[wrong][:3], 6).tolist()}",
        )


def _audit_ring_shares(
    claims: RingSharesRecord,
    case: AuditCase,
    projector: AuditProjector,
    findings: AuditFindings,
) -> None:
    """Check the shares of every ring's azimuth against rays at the same azimuths."""
    grid = cast_rings(case, projector, _INSIDE * projector.radii)
    for name, truth in (
        ("on_object", grid.flags(True)),
        ("on_target", grid.flags(grid.samples.in_target)),
        ("measured", grid.flags(_measured(case, grid))),
    ):
        shares, claimed = truth.mean(axis=1), getattr(claims, name)
        findings.same(name, claimed, shares, "the share recomputed", _SLACK)


def _measured(case: AuditCase, grid: RingGrid) -> Mask:
    """Whether a camera measures each hit with this projector's light, shape (k,)."""
    measured = np.zeros(len(grid.rays), dtype=bool)
    lit = np.flatnonzero(grid.lit)
    by_it = np.ones((1, len(lit)), dtype=bool)
    limits, samples = case.plan.requirements, grid.samples.take(lit)
    for camera in case.cameras:
        pairs = pairs_with(
            camera, [grid.projector], samples, by_it, limits, case.shadow
        )
        measured[lit] |= pairs[0] == MEASURED
    return measured
