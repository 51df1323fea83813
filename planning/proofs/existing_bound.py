"""What existing projectors leave to a bound over all poses.

They are in every plan, so what they light is free, and the fewest projectors are they
and the fewest more that light the rest::

    n(W) >= n_existing + n_more(W - free)

What they light is counted without their rings, whose axis may yet be turned: more that
is free can only lower the bound.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import Certificate, ContinuousProof
from planning.model.planned import PlannedProjector
from planning.scene.existing import existing_projectors
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import Target
from planning.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Given:
    """What existing projectors contribute on the rows of a bound.

    Attributes:
        count: How many they are.
        lit: Rows that any of them may light, shape (n,).
    """

    count: int
    lit: NDArray[np.bool_]


def given_on(scene: Scene, template: PlannedProjector, rows: Target) -> Given:
    """Return what existing projectors may light, whatever their ring axes.

    Args:
        scene: Surface and requirements.
        template: Optics and light.
        rows: Samples.
    """
    ringless = replace(template, ring_radii=np.array([0.0, np.inf]))
    projectors = existing_projectors(scene.requirements, ringless, (0.0, 0.0))
    if not projectors:
        return Given(0, np.zeros(len(rows), dtype=bool))
    lit = np.any(lit_stages(scene, projectors, rows) == LIT, axis=1)
    return Given(len(projectors), lit)


def enough(certificate: Certificate, reached: NDArray[np.bool_]) -> ContinuousProof:
    """Return the plan's `continuous` where existing projectors suffice: no cells.

    Args:
        certificate: As it stands.
        reached: Which of its samples some candidate lights, shape (n,).
    """
    return ContinuousProof(
        lower_bound=certificate.given,
        status="proved",
        proof="those that stand already are enough, and in every plan",
        occlusion=True,
        n_samples=certificate.n_samples,
        n_reached=int(reached.sum()),
        n_cells=0,
        one_fewer_upper_bound_m2=None,
    )
