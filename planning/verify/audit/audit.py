"""The audit of a whole plan: every claim against a recomputation."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from geometry.parallel import n_threads
from planning.model.plan import RigPlan
from planning.verify.audit.baselines.baseline_claims import audit_baselines
from planning.verify.audit.baselines.range_claims import audit_ranges
from planning.verify.audit.counts.certificate_claims import (
    audit_certificates,
)
from planning.verify.audit.counts.cost_claims import audit_cost
from planning.verify.audit.counts.joint_claims import audit_joint
from planning.verify.audit.counts.marginal_claims import audit_marginal
from planning.verify.audit.counts.member_claims import audit_members
from planning.verify.audit.counts.overlap_claims import (
    audit_groups,
    audit_overlaps,
    audit_schedule,
)
from planning.verify.audit.counts.table_claims import (
    audit_limits,
    audit_scales,
    audit_shares,
    audit_tables,
)
from planning.verify.audit.coverage.area_claims import audit_areas, recomputed_areas
from planning.verify.audit.coverage.floor_claims import audit_floors
from planning.verify.audit.coverage.inside_claims import audit_inside
from planning.verify.audit.coverage.region_claims import audit_margins, audit_regions
from planning.verify.audit.coverage.robust_claims import audit_robust
from planning.verify.audit.coverage.sigma_claims import audit_sigma
from planning.verify.audit.coverage.survival_claims import (
    audit_survival,
    unmet_after_losses,
)
from planning.verify.audit.coverage.view_sigma_claims import audit_view_sigma
from planning.verify.audit.devices.body_claims import audit_bodies, audit_clearance
from planning.verify.audit.devices.code_claims import audit_codes
from planning.verify.audit.devices.device_claims import audit_devices, audit_existing
from planning.verify.audit.devices.evaluation_claims import audit_evaluation
from planning.verify.audit.devices.exposure_claims import audit_exposures
from planning.verify.audit.devices.mount_claims import audit_mounts
from planning.verify.audit.devices.obstacle_claims import audit_obstacles
from planning.verify.audit.devices.optics_claims import audit_optics
from planning.verify.audit.devices.stock_claims import audit_stock
from planning.verify.audit.devices.view_claims import audit_views
from planning.verify.audit.devices.workspace_claims import audit_workspace
from planning.verify.audit.devices.zone_claims import audit_zones
from planning.verify.audit.proofs.poses.pose_claims import PoseBound, audit_pose_proofs
from planning.verify.audit.proofs.proof_claims import audit_proofs
from planning.verify.audit.rings.axis_claims import audit_ring_axes
from planning.verify.audit.rings.ring_claims import audit_rings
from planning.verify.audit.stations.station_claims import audit_stations

from .audit_case import N_SAMPLES, AuditCase, examine
from .audit_findings import AuditFindings
from .figure_claims import audit_check
from .request_claims import audit_request

_CLAIMS = (
    audit_optics,
    audit_devices,
    audit_codes,
    audit_workspace,
    audit_zones,
    audit_existing,
    audit_ranges,
    audit_bodies,
    audit_clearance,
    audit_evaluation,
    audit_exposures,
    audit_mounts,
    audit_stock,
    audit_stations,
    audit_obstacles,
    audit_areas,
    audit_inside,
    audit_sigma,
    audit_robust,
    audit_survival,
    audit_margins,
    audit_regions,
    audit_floors,
    audit_tables,
    audit_marginal,
    audit_shares,
    audit_members,
    audit_certificates,
    audit_joint,
    audit_baselines,
    audit_groups,
    audit_overlaps,
    audit_schedule,
    audit_rings,
    audit_ring_axes,
    audit_limits,
    audit_request,
    audit_scales,
    audit_cost,
    audit_check,
)

# Cameras alone: what is said of light and its patterns isn't there.
_CLAIMS_OF_VIEWS = (
    audit_views,
    audit_optics,
    audit_devices,
    audit_workspace,
    audit_zones,
    audit_existing,
    audit_bodies,
    audit_clearance,
    audit_mounts,
    audit_stock,
    audit_obstacles,
    audit_areas,
    audit_inside,
    audit_view_sigma,
    audit_regions,
    audit_floors,
    audit_tables,
    audit_shares,
    audit_members,
    audit_certificates,
    audit_baselines,
    audit_groups,
    audit_limits,
    audit_request,
    audit_scales,
    audit_cost,
    audit_check,
)


@dataclass(frozen=True, eq=False)
class Audit:
    """What the audit found.

    Attributes:
        failures: A sentence for each false claim: key, claimed, recomputed, tolerance.
        unmet: One sentence for each requirement that the plan, by its own claims,
            misses. That is no false claim.
        case: What was recomputed.
        proofs: Of each bound over candidates, whether it was derived again.
        over_poses: What became of bounds over all poses; None: none was tried.
    """

    failures: tuple[str, ...]
    unmet: tuple[str, ...]
    case: AuditCase
    proofs: tuple[str, ...] = ()
    over_poses: tuple[PoseBound, ...] | None = None

    @cached_property
    def areas(self) -> dict[str, dict[str, float]]:
        """Recomputed AREAS of `surface` and `target`, keys as in `coverage` [m²]."""
        return recomputed_areas(self.case)


def audit_plan(
    plan: RigPlan,
    *,
    seed: int = 0,
    n_samples: int = N_SAMPLES,
    threads: int | None = None,
) -> Audit:
    """Recompute every claim of a plan from its document and its surface alone.

    Samples, projection, ring normal, ray derivative and occlusion are the audit's own;
    with one seed, they are the same whatever the threads.

    Raises:
        PlanFileError: If the plan is broken, so that its claims have no meaning.
    """
    threads = threads or n_threads()
    return audited(examine(plan, seed=seed, n_samples=n_samples, threads=threads))


def audited(
    case: AuditCase,
    *,
    proofs: bool = True,
    over_poses: Callable[[str], None] | None = None,
) -> Audit:
    """Hold every claim of a plan against what was recomputed of it.

    Without `proofs`, bounds over candidates aren't derived again; those over all poses
    are if `over_poses` receives a line now and then.

    Raises:
        PlanFileError: If the plan is broken, so that its claims have no meaning.
    """
    findings, plan = AuditFindings(), case.plan
    alone = plan.requirements.pattern == "none"
    for audit_claims in _CLAIMS_OF_VIEWS if alone else _CLAIMS:
        audit_claims(case, findings)
    derived = audit_proofs(case, findings) if proofs else ()
    everywhere = None
    if over_poses is not None:
        everywhere = audit_pose_proofs(case, findings, over_poses)
    unmet = unmet_requirements(plan)
    return Audit(findings.failures, unmet, case, derived, everywhere)


def first_false(case: AuditCase, *, quick: bool = False) -> tuple[str, ...]:
    """Return what the first audit that finds anything finds, the quick ones first.

    Or those alone. For who only asks whether a plan with projectors holds.
    """
    slow = audit_inside, audit_floors, audit_rings, audit_marginal, audit_ring_axes
    for audit_claims in sorted(_CLAIMS, key=lambda claims: claims in slow):
        if quick and audit_claims in slow:
            break
        findings = AuditFindings()
        audit_claims(case, findings)
        if findings.failures:
            return findings.failures
    return ()


def unmet_requirements(plan: RigPlan) -> tuple[str, ...]:
    """Return one sentence for each requirement on the target that isn't met.

    lit >= dominant_coverage x reachable by projectors, measured >= coverage x reachable
    by cameras, reachable by projectors >= min_reachable x target, reachable by cameras
    >= min_reachable x lit; and of each region that has a floor lit and measured >=
    region_coverage x what is reachable of it. Read from the claims, which the audit
    holds against its own figures apart.
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
    unmet = tuple(
        f"requirements.{name}: {part} {area:.6g} m² is less than {share:g} x {of} = "
        f"{share * total:.6g} m²"
        for name, (part, area), share, (of, total) in rules
        if not (total > 0.0 and area >= share * total * (1.0 - 1e-9))
    )
    floors = tuple(
        f"requirements.region_coverage: regions.{region.id} is lit "
        f"{areas.lit_m2:.6g} m² of {areas.reachable_by_projectors_m2:.6g} m² and "
        f"measured {areas.measured_m2:.6g} m² of {areas.reachable_by_cameras_m2:.6g} "
        f"m², less than {limits.region_coverage:g} of either"
        for region in plan.document.regions
        if (areas := region.coverage) is not None and areas.floor == "missed"
    )
    return (*unmet, *floors, *unmet_after_losses(plan))
