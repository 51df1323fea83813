"""Which single limit, relaxed, would bring how much of the target within reach."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from . import lighting
from .plan import PlannedProjector
from .scene import Scene

_SAMPLES = 1500
_STREAM = 950
_WIDER_INCIDENCE = np.radians(75.0)


def reachability_relaxations(
    scene: Scene, reference: Sequence[PlannedProjector]
) -> list[dict[str, Any]]:
    """Return the share of the target that each single relaxation would make reachable.

    Args:
        scene: Surface and requirements.
        reference: The projectors' reference set.

    Returns:
        One entry for each relaxation that gains at least a percentage point, the
        smallest gain first: `change`, `reachable_share`.
    """
    target = scene.target_samples(_SAMPLES, _STREAM)
    limits = scene.requirements.projector
    offers = {
        "projector incidence up to 75 degrees (grazing light: about three times the "
        "error)": replace(
            limits, max_incidence=max(limits.max_incidence, _WIDER_INCIDENCE)
        ),
        "no tangent limit": replace(limits, min_tangent_angle=0.0),
    }
    base = _share(scene, reference, target, limits)
    gains = [
        {"change": change, "reachable_share": share}
        for change, offered in offers.items()
        if (share := _share(scene, reference, target, offered)) >= base + 0.01
    ]
    return sorted(gains, key=lambda entry: entry["reachable_share"])


def _share(
    scene: Scene,
    reference: Sequence[PlannedProjector],
    target: lighting.Target,
    limits: lighting.ProjectorLimits,
) -> float:
    left = np.arange(len(target))
    for projector in reference:
        if not len(left):
            break
        stage = lighting.first_failure(
            projector, target.take(left), limits, scene.visibility
        )
        left = left[stage != lighting.LIT]
    return 1.0 - len(left) / len(target)
