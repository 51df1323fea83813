"""Which single limit, relaxed, would bring how much of the target within reach."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from . import lighting
from .candidates import projector_candidates
from .plan import PlannedProjector
from .scene import Scene

_SAMPLES = 1500
_STREAM = 950
_WIDER_INCIDENCE = np.radians(75.0)


def reachability_relaxations(
    scene: Scene,
    reference: Sequence[PlannedProjector],
    ring_offset: tuple[float, float],
) -> list[dict[str, Any]]:
    """Return the share of the target that each single relaxation would make reachable.

    Args:
        scene: Surface and requirements.
        reference: The projectors' reference set.
        ring_offset: Tilt and azimuth of its ring axes.

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
    shares = {
        change: _share(scene, reference, target, offered)
        for change, offered in offers.items()
    }
    workspace = scene.requirements.workspace
    whole = replace(
        workspace,
        half_angle=float(np.pi),
        floor_m=None,
        box=None,
        keep_out=(),
        mounting=(),
    )
    if whole != workspace:
        anywhere = projector_candidates(
            reference[0], whole, len(reference), ring_offset=ring_offset
        )
        shares["the whole shell as workspace"] = _share(scene, anywhere, target, limits)
    gains = [
        {"change": change, "reachable_share": share}
        for change, share in shares.items()
        if share >= base + 0.01
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
