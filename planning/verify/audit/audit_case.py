"""What every part of the audit looks at: the plan, and what was recomputed of it."""

from dataclasses import dataclass
from functools import cached_property

from planning.model.plan import RigPlan
from planning.verify.audit.predicates.audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.recompute import (
    Reachable,
    Recomputed,
    reachable_by,
    recompute,
)

from .audit_samples import AuditSamples, draw_samples
from .estimates import Estimator


@dataclass(frozen=True, eq=False)
class AuditCase:
    """A plan and the audit's figures of it.

    Attributes:
        plan: The plan, as written.
        shadow: Its surface, as rays meet it.
        actual: What its devices do to the audit's samples.
        reachable: What reference poses could do.
        estimator: Areas from these samples.
        seed: Of every random draw.
    """

    plan: RigPlan
    shadow: Shadow
    actual: Recomputed
    reachable: Reachable
    estimator: Estimator
    seed: int

    @property
    def samples(self) -> AuditSamples:
        """The audit's samples."""
        return self.actual.samples

    @cached_property
    def projectors(self) -> tuple[AuditProjector, ...]:
        """The plan's projectors."""
        return audit_projectors(self.plan)

    @cached_property
    def cameras(self) -> tuple[AuditCamera, ...]:
        """The plan's cameras."""
        return audit_cameras(self.plan)


def examine(plan: RigPlan, *, seed: int, n_samples: int, threads: int) -> AuditCase:
    """Recompute what a plan's devices and reference poses do to fresh samples."""
    target = plan.requirements.target
    samples = draw_samples(plan.surface, target, n_samples, seed)
    shadow = Shadow(plan.surface.mesh, threads=threads)
    actual = recompute(plan, samples, shadow)
    areas = plan.surface.mesh.face_areas
    inside = plan.surface.target_faces(target)
    claimed = plan.coverage.samples
    estimator = Estimator(
        samples, claimed, float(areas.sum()), float(areas[inside].sum())
    )
    reachable = reachable_by(plan, actual, shadow, seed)
    return AuditCase(plan, shadow, actual, reachable, estimator, seed)
