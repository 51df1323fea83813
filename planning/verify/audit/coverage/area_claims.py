"""Claims about areas: coverage, causes, and what each device contributes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from geometry.arrays import Array, Ints, Mask
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import ROUNDING
from planning.verify.audit.predicates.audit_devices import AuditProjector, light_starts
from planning.verify.audit.predicates.occlusion import (
    Block,
    Hindrance,
    block_of,
)
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
from planning.verify.audit.predicates.reference_devices import reference_projectors
from planning.verify.audit.predicates.view_pairs import CAUSES

_Device = PlannedProjector | PlannedCamera | AuditProjector


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
    below, samples = findings.at("coverage"), case.plan.coverage.samples
    below.holds(samples >= 1, "samples", f"{samples!r} must be the number of samples")
    _audit_wholes(case, below)
    _audit_causes(case, below)
    _audit_contributions(case, findings)
    _audit_blocked(case, below)


def _covered(case: AuditCase) -> dict[str, Mask]:
    """Samples of each of AREAS but the whole, from the smallest to the largest."""
    return {
        "measured_m2": case.actual.measured,
        "reachable_by_cameras_m2": case.reachable.cameras,
        "lit_m2": case.actual.lit,
        "reachable_by_projectors_m2": case.reachable.projectors,
    }


def _audit_wholes(case: AuditCase, findings: AuditFindings) -> None:
    """Check AREAS, and that each of them is part of the next, whatever the sampling."""
    covered = _covered(case)
    for part, (_, whole) in case.estimator.wholes().items():
        areas, below = getattr(case.plan.coverage, part), findings.at(part)
        slack = ROUNDING * whole
        below.number("area_m2", areas.area_m2, whole, slack)
        claimed = {name: getattr(areas, name) for name in (*covered, "area_m2")}
        for name, chosen in covered.items():
            case.estimator.audit(name, claimed[name], chosen, below, part=part)
        for (smaller, low), (larger, high) in pairwise(claimed.items()):
            below.holds(
                0.0 <= low <= high + slack,
                smaller,
                f"claimed {low:.6g} m², must lie between 0 and {larger} = "
                f"{high:.6g} m²",
            )


def _audit_causes(case: AuditCase, findings: AuditFindings) -> None:
    """Check each split of an area of the target by causes, one by one and as a sum."""
    claims, actual, reachable = case.plan.coverage, case.actual, case.reachable
    unseen, dark = ~actual.measured, ~reachable.projectors
    beyond, sight = actual.lit & ~reachable.cameras, SIGHT_CAUSES + PAIR_CAUSES
    areas = claims.target
    unseen_m2 = areas.area_m2 - areas.measured_m2
    dark_m2 = areas.area_m2 - areas.reachable_by_projectors_m2
    beyond_m2 = areas.lit_m2 - areas.reachable_by_cameras_m2
    for name, flags, furthest, causes, total in (
        ("uncovered", unseen, actual.cause, CAUSES, unseen_m2),
        ("unreachable", dark, reachable.furthest, LIGHT_CAUSES, dark_m2),
        ("unmeasurable", beyond, reachable.furthest_pair, sight, beyond_m2),
    ):
        key = f"{name}_by_cause"
        # Only there where it is more than the requirement allows.
        if key not in claims.model_fields_set:
            continue
        split = getattr(claims, key)
        unknown = ", ".join(sorted(set(split) - set(causes)))
        findings.holds(not unknown, key, f"causes that there are not: {unknown}")
        for cause in dict.fromkeys(causes):
            # An obstacle stands in the way of light or of a view, under one name.
            steps = [index for index, name in enumerate(causes) if name == cause]
            chosen = flags & np.isin(furthest, steps)
            case.estimator.audit(
                f"{key}.{cause}", split.get(cause, 0.0), chosen, findings
            )
        slack = 1e-4 * case.estimator.target_m2
        findings.number(f"{key} (sum)", sum(split.values()), total, slack)


def _audit_contributions(case: AuditCase, findings: AuditFindings) -> None:
    """Check lit_area_m2, seen_area_m2 and sole_area_m2 of every device."""
    audit, document, actual = case.estimator.audit, case.plan.document, case.actual
    for projector, lit in zip(document.projectors, actual.lit_by, strict=True):
        audit(f"{projector.id}.lit_area_m2", projector.lit_area_m2, lit, findings)
    for camera, seen, alone in zip(
        document.cameras, actual.measured_by, actual.alone, strict=True
    ):
        audit(f"{camera.id}.seen_area_m2", camera.seen_area_m2, seen, findings)
        audit(f"{camera.id}.sole_area_m2", camera.sole_area_m2, alone, findings)


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
    stations = {device.id: device.station for device in devices}
    hindrances = {solid.name: solid for solid in case.shadow.hindrances}
    dark = actual.samples.in_target & ~actual.measured
    seen_lit = actual.steps_of_cameras
    light = np.isin(actual.light, (PROJECTOR_BODY, LIGHT_OBSTACLE))
    sight = np.isin(seen_lit, (CAMERA_BODY, SIGHT_OBSTACLE))
    stopped = [*(dark & light), *(dark & actual.lit & sight)]
    ways = [
        _Ways.of(case, device.id, device, np.flatnonzero(flags))
        for device, flags in zip(devices, stopped, strict=True)
    ]
    beyond = [*ways, *_stopped_of_reference(case, dark)] if hindrances else []
    for key, areas, solids, lines in (
        ("blocked_by_body_m2", claims.blocked_by_body_m2, blocks, ways),
        ("blocked_by_obstacle_m2", claims.blocked_by_obstacle_m2, hindrances, beyond),
    ):
        names = set(areas)
        if not names and case.plan.requirements.pattern == "none":
            # Of cameras alone nothing is said of what stands in the way.
            continue
        if not findings.holds(
            names == set(solids), key, f"must hold an area for each of {list(solids)}"
        ):
            continue
        for name, solid in solids.items():
            behind = np.zeros(len(dark), dtype=bool)
            for line in lines:
                if line.concerns(solid, stations):
                    behind[line.samples] |= solid.meets(line.starts, line.ends)
            case.estimator.audit(f"{key}.{name}", areas[name], behind, findings)


@dataclass(frozen=True, eq=False)
class _Ways:
    """Straight lines from a device, "" for one of a reference set, to samples (n,)."""

    device: str
    station: str
    samples: Ints
    starts: Array
    ends: Array

    @classmethod
    def of(cls, case: AuditCase, name: str, device: _Device, samples: Ints) -> "_Ways":
        ends = case.actual.samples.points[samples]
        return cls(name, device.station, samples, light_starts(device, ends), ends)

    def concerns(self, solid: Block | Hindrance, stations: Mapping[str, str]) -> bool:
        """Whether a body or an obstacle stands where the device does, and isn't its."""
        if isinstance(solid, Hindrance):
            return solid.station in ("", self.station)
        return solid.name != self.device and stations[solid.name] in ("", self.station)


def _stopped_of_reference(case: AuditCase, dark: Mask) -> Iterator[_Ways]:
    """Yield each reference projector's ways to dark samples that obstacles stop.

    Of those that no reference projector lights.
    """
    reachable = case.reachable
    obstructed = dark & ~reachable.projectors & (reachable.furthest == LIGHT_OBSTACLE)
    chosen = np.flatnonzero(obstructed)
    samples, limits = case.actual.samples.take(chosen), case.plan.requirements.projector
    for projector in reference_projectors(case.plan) if len(chosen) else ():
        steps = light_steps(projector, samples, limits, case.shadow)
        yield _Ways.of(case, "", projector, chosen[steps == LIGHT_OBSTACLE])
