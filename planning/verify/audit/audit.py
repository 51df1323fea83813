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
from planning.verify.audit.counts.consistency import audit_consistency
from planning.verify.audit.counts.overlap_claims import audit_overlaps
from planning.verify.audit.counts.route_claims import audit_routes
from planning.verify.audit.counts.schedule_claims import audit_schedule
from planning.verify.audit.counts.table_claims import audit_marginal, audit_rest
from planning.verify.audit.coverage.area_claims import (
    audit_areas,
    audit_causes,
    audit_contributions,
    recomputed_areas,
)
from planning.verify.audit.coverage.group_claims import audit_groups
from planning.verify.audit.coverage.inside_claims import audit_inside
from planning.verify.audit.coverage.margin_claims import audit_margins
from planning.verify.audit.coverage.region_claims import audit_regions
from planning.verify.audit.devices.body_claims import audit_blocked, audit_bodies
from planning.verify.audit.devices.device_claims import audit_devices, audit_workspace
from planning.verify.audit.devices.existing_claims import audit_existing
from planning.verify.audit.devices.zone_claims import audit_zones
from planning.verify.audit.predicates.blocks import audit_room
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.recompute import (
    Reach,
    Recomputed,
    reach_of,
    recompute,
)
from planning.verify.audit.rings.ring_claims import audit_rings

from .audit_samples import AuditSamples, draw_samples
from .estimates import Estimator
from .ledger import Ledger, as_number
from .unmet import unmet_requirements


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
    _require_whole(plan)
    ledger = Ledger(plan.to_document())
    target = plan.requirements.target
    samples = draw_samples(plan.surface, target, n_samples, seed)
    shadow = Shadow(plan.surface.mesh, threads=threads)
    own = recompute(plan, samples, shadow)
    reach = reach_of(plan, own, shadow, seed)
    estimator = _estimator(plan, samples, ledger)
    audit_devices(plan, ledger)
    audit_workspace(plan, ledger)
    audit_zones(plan, ledger)
    audit_existing(plan, ledger)
    audit_ranges(plan, ledger)
    audit_bodies(plan, ledger)
    audit_room(plan, shadow, ledger)
    audit_areas(own, reach, estimator, ledger)
    audit_causes(own, reach, estimator, ledger)
    audit_blocked(plan, own, estimator, ledger)
    audit_inside(plan, own, reach, shadow, ledger, seed=seed)
    audit_contributions(plan, own, estimator, ledger)
    audit_margins(plan, own, shadow, ledger)
    audit_regions(plan, own, estimator, shadow, ledger)
    audit_marginal(own, estimator, ledger)
    audit_certificates(plan, own, estimator, ledger)
    audit_routes(ledger)
    audit_baselines(plan, ledger)
    audit_groups(plan, own, estimator.n_claimed, ledger)
    audit_overlaps(plan, shadow, estimator, ledger)
    audit_schedule(plan, ledger)
    audit_rings(plan, own, shadow, estimator, ledger, seed=seed)
    audit_consistency(plan, ledger)
    audit_rest(plan, ledger)
    return _result(plan, own, reach, estimator, ledger)


def _result(
    plan: RigPlan, own: Recomputed, reach: Reach, estimator: Estimator, ledger: Ledger
) -> Audit:
    return Audit(
        failures=ledger.failures,
        unmet=unmet_requirements(plan),
        areas=recomputed_areas(own, reach, estimator),
        samples=own.samples,
        lit=own.lit,
        predicted=own.measured,
        predicted_by=own.measured_by,
        reachable_by_projectors=reach.projectors,
        reachable_by_cameras=reach.cameras,
    )


def _estimator(plan: RigPlan, samples: AuditSamples, ledger: Ledger) -> Estimator:
    claimed = as_number(ledger.read("coverage", "samples"))
    ledger.holds(
        claimed is not None and claimed >= 1,
        "coverage.samples",
        f"{ledger.read('coverage', 'samples')!r} must be the number of samples",
    )
    areas = plan.surface.mesh.face_areas
    inside = plan.surface.target_faces(plan.requirements.target)
    return Estimator(
        samples, int(claimed or 0), float(areas.sum()), float(areas[inside].sum())
    )


def _require_whole(plan: RigPlan) -> None:
    """Refuse a plan whose parts can't be read, so that no claim of it has a meaning."""
    try:
        pattern = plan.requirements.pattern
        _ = plan.projectors, plan.cameras
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise PlanFileError(
            f"broken plan ({type(error).__name__}: {error}); plan again"
        ) from None
    if pattern != "rings":
        raise PlanFileError(
            f"requirements.pattern is {pattern!r}; only 'rings' can be audited"
        )
    _require_shapes(plan.surface)


def _require_shapes(surface: Surface) -> None:
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
