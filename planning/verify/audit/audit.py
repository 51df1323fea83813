"""The audit of a whole plan: every claim against a recomputation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.model.surface import Surface
from planning.verify.audit.baselines.baseline_claims import audit_baselines
from planning.verify.audit.baselines.range_claims import audit_ranges
from planning.verify.audit.counts.certificate_claims import audit_certificates
from planning.verify.audit.counts.overlap_claims import audit_overlaps, audit_schedule
from planning.verify.audit.counts.route_claims import audit_routes
from planning.verify.audit.counts.table_claims import audit_derived, audit_tables
from planning.verify.audit.coverage.area_claims import audit_areas, recomputed_areas
from planning.verify.audit.coverage.group_claims import audit_groups
from planning.verify.audit.coverage.inside_claims import audit_inside
from planning.verify.audit.coverage.region_claims import audit_margins, audit_regions
from planning.verify.audit.devices.body_claims import audit_bodies
from planning.verify.audit.devices.device_claims import audit_devices, audit_existing
from planning.verify.audit.devices.obstacle_claims import audit_obstacles
from planning.verify.audit.devices.workspace_claims import audit_workspace
from planning.verify.audit.devices.zone_claims import audit_zones
from planning.verify.audit.rings.ring_claims import audit_rings

from .audit_case import examine
from .audit_findings import AuditFindings
from .audit_samples import AuditSamples

_CLAIMS = (
    audit_devices,
    audit_workspace,
    audit_zones,
    audit_existing,
    audit_ranges,
    audit_bodies,
    audit_obstacles,
    audit_areas,
    audit_inside,
    audit_margins,
    audit_regions,
    audit_tables,
    audit_certificates,
    audit_routes,
    audit_baselines,
    audit_groups,
    audit_overlaps,
    audit_schedule,
    audit_rings,
    audit_derived,
)


@dataclass(frozen=True, eq=False)
class Audit:
    """What the audit found.

    Attributes:
        failures: A sentence for each false claim: key, claimed, recomputed, tolerance.
        unmet: One sentence for each requirement that the plan, by its own claims,
            misses. That is no false claim.
        areas: Recomputed AREAS of `surface` and `target`, keys as in `coverage` [m²].
        samples: The audit's samples.
        lit: Whether any projector lights each sample, shape (n,).
        predicted: Whether any pair measures each sample, shape (n,).
        predicted_by: Whether each camera measures each sample, shape (n_c, n).
        reachable_by_projectors: Shape (n,).
        reachable_by_cameras: Shape (n,).
    """

    failures: tuple[str, ...]
    unmet: tuple[str, ...]
    areas: dict[str, dict[str, float]]
    samples: AuditSamples
    lit: NDArray[np.bool_]
    predicted: NDArray[np.bool_]
    predicted_by: NDArray[np.bool_]
    reachable_by_projectors: NDArray[np.bool_]
    reachable_by_cameras: NDArray[np.bool_]

    @property
    def passed(self) -> bool:
        """Whether every claim held."""
        return not self.failures

    def in_target(self) -> tuple[AuditSamples, NDArray[np.bool_]]:
        """Return the samples of the target, all of one weight, and their prediction."""
        inside = self.samples.in_target
        return self.samples.take(inside), self.predicted[inside]


def audit_plan(
    plan: RigPlan,
    *,
    seed: int = 0,
    n_samples: int = 20_000,
    threads: int = 2,
) -> Audit:
    """Recompute every claim of a plan from its document and its surface alone.

    Nothing of the planner, its visibility or its measurability is used: samples,
    projection, ring normal, ray derivative and occlusion are the audit's own.

    Args:
        plan: The plan, as written.
        seed: Of the audit's samples; the planner's never come from the same stream.
        n_samples: Number of samples.
        threads: Worker threads of the ray caster; the result doesn't depend on them.

    Raises:
        PlanFileError: If the plan is broken, so that its claims have no meaning.
    """
    if plan.requirements.pattern != "rings":
        raise PlanFileError(
            f"requirements.pattern is {plan.requirements.pattern!r}; only 'rings' can "
            f"be audited"
        )
    _require_shapes(plan.surface)
    case = examine(plan, seed=seed, n_samples=n_samples, threads=threads)
    findings = AuditFindings()
    for audit_claims in _CLAIMS:
        audit_claims(case, findings)
    return Audit(
        failures=findings.failures,
        unmet=unmet_requirements(plan),
        areas=recomputed_areas(case),
        samples=case.samples,
        lit=case.actual.lit,
        predicted=case.actual.measured,
        predicted_by=case.actual.measured_by,
        reachable_by_projectors=case.reachable.projectors,
        reachable_by_cameras=case.reachable.cameras,
    )


def _require_shapes(surface: Surface) -> None:
    """Raise unless the arrays of surface.npz have their shapes."""
    for name in ("reference_projectors", "reference_rings", "reference_cameras"):
        poses = getattr(surface, name)
        whole = poses.ndim == 3 and poses.shape[1:] == (4, 4)
        if not (whole and np.all(np.isfinite(poses))):
            raise PlanFileError(
                f"surface.npz: {name} must be (n, 4, 4) finite numbers, "
                f"got {poses.shape}; plan again"
            )
    if surface.reference_rings.shape != surface.reference_projectors.shape:
        raise PlanFileError(
            f"surface.npz: {len(surface.reference_rings)} reference_rings for "
            f"{len(surface.reference_projectors)} reference_projectors; plan again"
        )
    n = len(surface.mesh.faces)
    if surface.steep.shape != (n, 3) or not np.all(np.isfinite(surface.steep)):
        raise PlanFileError(
            f"surface.npz: steep must be ({n}, 3) finite numbers, plan again"
        )


def unmet_requirements(plan: RigPlan) -> tuple[str, ...]:
    """Return one sentence for each requirement on the target that isn't met.

    lit >= dominant_coverage x reachable by projectors, measured >= coverage x reachable
    by cameras, reachable by projectors >= min_reachable x target, reachable by cameras
    >= min_reachable x lit. Read from the claims, which the audit holds against its own
    figures apart.
    """
    limits, areas = plan.requirements, plan.coverage.target
    by_projectors = ("reachable_by_projectors_m2", areas.reachable_by_projectors_m2)
    by_cameras = ("reachable_by_cameras_m2", areas.reachable_by_cameras_m2)
    lit, measured = ("lit_m2", areas.lit_m2), ("measured_m2", areas.measured_m2)
    whole = ("area_m2", areas.area_m2)
    rules = (
        ("min_reachable", by_projectors, limits.min_reachable, whole),
        ("dominant_coverage", lit, limits.dominant_coverage, by_projectors),
        ("coverage", measured, limits.coverage, by_cameras),
        ("min_reachable", by_cameras, limits.min_reachable, lit),
    )
    return tuple(
        f"requirements.{name}: {part} {area:.6g} m² is less than {share:g} x {of} = "
        f"{share * total:.6g} m²"
        for name, (part, area), share, (of, total) in rules
        if not (total > 0.0 and area >= share * total * (1.0 - 1e-9))
    )
