"""What a plan's devices do to samples, and what any could: with light or alone."""

from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import AuditSamples

from .occlusion import Shadow
from .recompute import Reachable, Recomputed, reachable_by, recompute
from .recomputed_views import RecomputedViews, reachable_by_views, recompute_views


def what_devices_do(plan: RigPlan, samples: AuditSamples, shadow: Shadow) -> Recomputed:
    """Recompute what the devices of a plan do to each sample."""
    if plan.requirements.pattern == "none":
        return recompute_views(plan, samples, shadow)
    return recompute(plan, samples, shadow)


def what_any_could(
    plan: RigPlan, actual: Recomputed, shadow: Shadow, seed: int
) -> Reachable:
    """Recompute what the reference poses cover, and add what the plan itself does."""
    if isinstance(actual, RecomputedViews):
        return reachable_by_views(plan, actual, shadow, seed)
    return reachable_by(plan, actual, shadow, seed)
