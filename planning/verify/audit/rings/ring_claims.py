"""Claims about a projector's rings: how they are spaced, and what they leave out."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.document.device_records import RingSharesRecord, RingsRecord
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT, ROUNDING
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import pairs_with

from .crease_claims import ROWS, audit_creases, creases_of, strays
from .ring_grid import AZIMUTHS, RingGrid, audit_extreme, cast_rings

# Of the chords, poses rounded after rings were spaced may turn so many.
_STRAY_SLACK = 0.005


def audit_rings(case: AuditCase, findings: AuditFindings) -> None:
    """Check `rings` and `ring_shares` of every projector.

    A plan that has none of them claims nothing; one that has some must have all.
    `rings` may be null in a run that was cut.
    """
    records = case.plan.document.projectors
    if all(record.rings is None and record.ring_shares is None for record in records):
        return
    creases = creases_of(case.plan.surface)
    for record, projector in zip(records, case.projectors, strict=True):
        shares, rings = record.ring_shares, record.rings
        key = f"{record.id}.ring_shares"
        if findings.holds(shares, key, "is missing") and shares is not None:
            audit_ring_shares(key, shares, case, projector, findings)
        key = f"{record.id}.rings"
        if rings is None:
            findings.holds(case.plan.document.truncated, key, "is missing")
            continue
        even = _audit_spacing(key, rings, projector, case, findings)
        if even is None:
            continue
        rows = np.arange(1, ROWS * len(even) + 1) * (even[0] / ROWS)
        grid = cast_rings(case, projector, rows)
        _audit_gaps(key, rings, even, grid, findings)
        limits = case.plan.requirements
        sigma = limits.triangulation.max_sigma_m
        tolerance = limits.check.max_p95_m if sigma is None else sigma
        share = strays(grid, creases, limits.projector.max_incidence, tolerance)
        name, claimed = f"{key}.over_tolerance", rings.over_tolerance
        findings.number(name, claimed, share, _STRAY_SLACK, "of the chords")
        name = f"{key}.creases"
        audit_creases(name, rings.creases, case, projector, creases, findings)


def _audit_spacing(
    key: str,
    rings: RingsRecord,
    projector: AuditProjector,
    case: AuditCase,
    findings: AuditFindings,
) -> NDArray[np.float64] | None:
    """Check `spacing`, `kept_even` and `n_even`; return the radii of even rings."""
    wish = case.plan.document.rig.rings.get("spacing")
    spacing, count = rings.spacing, rings.n_even
    findings.holds(
        spacing == "uniform" or wish != "uniform",
        f"{key}.spacing",
        f"{spacing!r} is claimed, but rig.rings.spacing is {wish!r}",
    )
    findings.holds(
        rings.kept_even is (spacing == "uniform" and wish == "curvature"),
        f"{key}.kept_even",
        f"{rings.kept_even!r} is claimed where rings are {spacing!r} and "
        f"rig.rings.spacing is {wish!r}",
    )
    name = f"{key}.n_even"
    if not findings.holds(count >= 2, name, f"{count!r} must be at least 2 rings"):
        return None
    even = float(projector.radii[-1]) * np.arange(1, count + 1) / count
    findings.holds(
        spacing != "uniform"
        or (
            len(even) == len(projector.radii)
            and np.allclose(projector.radii, even, rtol=0.0, atol=ROUNDING * even[-1])
        ),
        f"{key}.n_even",
        f"the {len(projector.radii)} ring_radii aren't {count} at equal steps, but "
        f"'uniform' is claimed",
    )
    return even


def _audit_gaps(
    key: str,
    rings: RingsRecord,
    even: NDArray[np.float64],
    grid: RingGrid,
    findings: AuditFindings,
) -> None:
    """Check `gap_m`, the least and largest distance of rings on lit surface.

    No gap there is wider than an even one: that bounds `n_even`.
    """
    # Rounding decides whether the last row lies inside the last ring.
    inner = grid.rays < (len(grid.coordinates) - 1) * AZIMUTHS
    points = grid.samples.points[grid.lit & inner]
    gaps = grid.projector.ring_spacing(points)
    wide = replace(grid.projector, radii=even).ring_spacing(points)
    share = float(np.mean(gaps > wide * (1.0 + ROUNDING))) if len(gaps) else 0.0
    findings.holds(
        share <= POINT,
        f"{key}.n_even",
        f"{len(even)} even rings stand closer than the plan's on {100 * share:.3g} % "
        f"of its light on the surface, nowhere may they",
    )
    if len(gaps) == 0:
        return
    if rings.gap_m is None:
        findings.fail(f"{key}.gap_m", "is missing")
        return
    alike = np.ones(len(gaps))
    for place, largest in enumerate((False, True)):
        name, claimed = f"{key}.gap_m.{place}", rings.gap_m[place]
        audit_extreme(name, claimed, gaps, alike, findings, largest=largest)


# Rays of a ring are told from the next gap by taking them from just inside it.
_INSIDE = 1.0 - 1e-9
# Rays of a ring that rounding may turn at limits and outlines, and written digits.
_SLACK = 3.0 / AZIMUTHS + 1e-4


def audit_ring_shares(
    key: str,
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
        shares = truth.mean(axis=1)
        claimed = getattr(claims, name)
        findings.array(f"{key}.{name}", claimed, shares, _SLACK, "the share recomputed")


def _measured(case: AuditCase, grid: RingGrid) -> NDArray[np.bool_]:
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
