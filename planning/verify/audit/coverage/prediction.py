"""What a plan's own poses should measure, without the audit of its claims."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import AuditSamples, draw_samples
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import recompute


@dataclass(frozen=True, eq=False)
class Prediction:
    """Fresh samples of the target and what should be measured of them.

    Attributes:
        samples: Of the target, all of one weight.
        measured: Whether any pair measures each sample, shape (n,).
        by_pair: Share of the samples that each pair measures, shape (n_p, n_c).
    """

    samples: AuditSamples
    measured: NDArray[np.bool_]
    by_pair: NDArray[np.float64]


def predict_measured(
    plan: RigPlan, *, seed: int, n_samples: int = 20_000, threads: int = 2
) -> Prediction:
    """Return what the poses of a plan should measure, with the audit's own code.

    Args:
        plan: The plan, as written.
        seed: Of the samples, which are those of `audit_plan` with this seed.
        n_samples: Number of samples on the whole surface.
        threads: Worker threads of the ray caster; the result doesn't depend on them.

    Raises:
        PlanFileError: If the target has no area.
    """
    drawn = draw_samples(plan.surface, plan.requirements.target, n_samples, seed)
    samples = drawn.take(drawn.in_target)
    own = recompute(plan, samples, Shadow(plan.surface.mesh, threads=threads))
    by_pair = np.mean(own.pairs == MEASURED, axis=2)
    return Prediction(samples, own.measured, by_pair)
