"""Claims about areas: coverage, causes, and what each device contributes."""

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import ROUNDING
from planning.verify.audit.predicates.audit_devices import (
    AuditProjector,
    light_starts,
    reference_projectors,
)
from planning.verify.audit.predicates.occlusion import block_of
from planning.verify.audit.predicates.predicates import (
    CAMERA_BODY,
    LIGHT_CAUSES,
    LIGHT_OBSTACLE,
    PAIR_CAUSES,
    PROJECTOR_BODY,
    SIGHT_CAUSES,
    SIGHT_OBSTACLE,
    light_steps,
)

_CAUSES = LIGHT_CAUSES + SIGHT_CAUSES + PAIR_CAUSES
_Flags = NDArray[np.bool_]


def recomputed_areas(case: AuditCase) -> dict[str, dict[str, float]]:
    """Return AREAS of the surface and of the target, as `coverage` has them [m²]."""
    return {
        part: {"area_m2": whole}
        | {
            name: case.estimator.area(chosen & within)
            for name, chosen in _covered(case).items()
        }
        for part, (within, whole) in case.estimator.wholes().items()
    }


def audit_areas(case: AuditCase, findings: AuditFindings) -> None:
    """Check every area of `coverage` and of devices, in both directions."""
    samples = case.plan.coverage.samples
    key = "coverage.samples"
    findings.holds(samples >= 1, key, f"{samples!r} must be the number of samples")
    _audit_wholes(case, findings)
    _audit_causes(case, findings)
    _audit_contributions(case, findings)
    _audit_blocked(case, findings)


def _covered(case: AuditCase) -> dict[str, _Flags]:
    """Samples of each of AREAS but the whole, from the smallest to the largest."""
    return {
        "measured_m2": case.actual.measured,
        "reachable_by_cameras_m2": case.reachable.cameras,
        "lit_m2": case.actual.lit,
        "reachable_by_projectors_m2": case.reachable.projectors,
    }


def _audit_wholes(case: AuditCase, findings: AuditFindings) -> None:
    """Check AREAS, and that each of them is part of the next, whatever the sampling."""
    claims = {
        "surface": case.plan.coverage.surface,
        "target": case.plan.coverage.target,
    }
    for part, (_, whole) in case.estimator.wholes().items():
        key = f"coverage.{part}"
        claimed = {name: getattr(claims[part], name) for name in _covered(case)}
        claimed["area_m2"] = claims[part].area_m2
        slack = ROUNDING * whole
        findings.number(f"{key}.area_m2", claims[part].area_m2, whole, slack)
        for name, chosen in _covered(case).items():
            case.estimator.audit(
                f"{key}.{name}", claimed[name], chosen, findings, part=part
            )
        for (smaller, low), (larger, high) in pairwise(claimed.items()):
            findings.holds(
                0.0 <= low <= high + slack,
                f"{key}.{smaller}",
                f"claimed {low:.6g} m², must lie between 0 and {larger} = "
                f"{high:.6g} m²",
            )


def _audit_causes(case: AuditCase, findings: AuditFindings) -> None:
    """Check the split of what isn't measured, and of what no device reaches."""
    claims, actual, reachable = case.plan.coverage, case.actual, case.reachable
    areas = claims.target
    _audit_split(
        case,
        "uncovered_by_cause",
        claims.uncovered_by_cause,
        # An obstacle stands in the way of light or of a view, under one name.
        {
            cause: np.isin(
                actual.cause, [k for k, c in enumerate(_CAUSES) if c == cause]
            )
            for cause in _CAUSES
        },
        areas.area_m2 - areas.measured_m2,
        findings,
    )
    dark = ~reachable.projectors
    _audit_split(
        case,
        "unreachable_by_cause",
        claims.unreachable_by_cause,
        {
            cause: dark & (reachable.furthest == index)
            for index, cause in enumerate(LIGHT_CAUSES)
        },
        areas.area_m2 - areas.reachable_by_projectors_m2,
        findings,
    )
    # Only there where it is more than the requirement allows.
    if "unmeasurable_by_cause" in claims.model_fields_set:
        beyond = actual.lit & ~reachable.cameras
        _audit_split(
            case,
            "unmeasurable_by_cause",
            claims.unmeasurable_by_cause,
            {
                cause: beyond & (reachable.furthest_pair == index)
                for index, cause in enumerate(SIGHT_CAUSES + PAIR_CAUSES)
            },
            areas.lit_m2 - areas.reachable_by_cameras_m2,
            findings,
        )


def _audit_split(
    case: AuditCase,
    name: str,
    split: Mapping[str, float],
    causes: Mapping[str, _Flags],
    total_m2: float,
    findings: AuditFindings,
) -> None:
    """Check a split of an area of the target by causes, one by one and as a sum."""
    key = f"coverage.{name}"
    unknown = sorted(set(split) - set(causes))
    findings.holds(not unknown, key, f"causes that there are not: {', '.join(unknown)}")
    for cause, chosen in causes.items():
        claimed = split.get(cause, 0.0)
        case.estimator.audit(f"{key}.{cause}", claimed, chosen, findings)
    slack = 1e-4 * case.estimator.target_m2
    findings.number(f"{key} (sum)", sum(split.values()), total_m2, slack)


def _audit_contributions(case: AuditCase, findings: AuditFindings) -> None:
    """Check lit_area_m2, seen_area_m2 and sole_area_m2 of every device."""
    audit, document = case.estimator.audit, case.plan.document
    for projector, lit in zip(document.projectors, case.actual.lit_by, strict=True):
        audit(f"{projector.id}.lit_area_m2", projector.lit_area_m2, lit, findings)
    together = case.actual.measured_by.sum(axis=0)
    for camera, seen in zip(document.cameras, case.actual.measured_by, strict=True):
        audit(f"{camera.id}.seen_area_m2", camera.seen_area_m2, seen, findings)
        sole = seen & (together == 1)
        audit(f"{camera.id}.sole_area_m2", camera.sole_area_m2, sole, findings)


def _audit_blocked(case: AuditCase, findings: AuditFindings) -> None:
    """Check what each body and each obstacle keeps from being measured.

    The target area that isn't measured and where, for some projector or for some camera
    that looks at it lit, the first limit that fails is a body or an obstacle, and this
    one in the way; for obstacles also what no reference projector lights, where that
    limit is the last that fails for one of them.
    """
    claims, actual = case.plan.coverage, case.actual
    devices = (*case.plan.projectors, *case.plan.cameras)
    blocks = {d.id: block for d in devices if (block := block_of(d)) is not None}
    hindrances = {solid.name: solid for solid in case.shadow.hindrances}
    dark = actual.samples.in_target & ~actual.measured
    seen_lit = actual.pairs.max(axis=0, initial=-1)
    light = np.isin(actual.light, (PROJECTOR_BODY, LIGHT_OBSTACLE))
    sight = np.isin(seen_lit, (CAMERA_BODY, SIGHT_OBSTACLE))
    stopped = [*(dark & light), *(dark & actual.lit & sight)]
    ways = [
        (device.id, np.flatnonzero(flags), device)
        for device, flags in zip(devices, stopped, strict=True)
    ]
    beyond = [*ways, *_stopped_of_reference(case, dark)] if hindrances else []
    for key, areas, solids, lines in (
        ("coverage.blocked_by_body_m2", claims.blocked_by_body_m2, blocks, ways),
        (
            "coverage.blocked_by_obstacle_m2",
            claims.blocked_by_obstacle_m2,
            hindrances,
            beyond,
        ),
    ):
        names = set(areas)
        if not findings.holds(
            names == set(solids), key, f"must hold an area for each of {list(solids)}"
        ):
            continue
        for name, solid in solids.items():
            behind = np.zeros(len(dark), dtype=bool)
            for whose, chosen, device in lines:
                if whose != name or solids is hindrances:
                    points = actual.samples.points[chosen]
                    behind[chosen] |= solid.meets(light_starts(device, points), points)
            case.estimator.audit(f"{key}.{name}", areas[name], behind, findings)


def _stopped_of_reference(
    case: AuditCase, dark: _Flags
) -> Iterator[tuple[str, NDArray[np.int64], AuditProjector]]:
    """Yield each reference projector and the dark samples that obstacles keep it from.

    Of those that no reference projector lights.
    """
    reachable = case.reachable
    obstructed = dark & ~reachable.projectors & (reachable.furthest == LIGHT_OBSTACLE)
    chosen = np.flatnonzero(obstructed)
    samples, limits = case.actual.samples.take(chosen), case.plan.requirements.projector
    for projector in reference_projectors(case.plan) if len(chosen) else ():
        steps = light_steps(projector, samples, limits, case.shadow)
        yield "", chosen[steps == LIGHT_OBSTACLE], projector
