"""How far within its limits a sample is measured, as a share of each limit.

Of a pair of projector and camera on a sample, the least of::

    1 - incidence / max_incidence             of the light, and of the camera
    (tangent angle - min) / (90 deg - min)    of the light, where T1 is known
    1 - min_conditioning / |r.m|
    1 - sigma / max_sigma
    (least distance to either limit) / (half of what lies between)    of an angle

where a limit is set. 0 is at a limit, 1 as far from it as can be. Field, range and
shadows are met or not and have no share; the pitch of rings is set to its limit on
purpose (`rings.ring_stage`). A sample's slack is that of its best pair.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.requirements import (
    CameraLimits,
    ProjectorLimits,
    TriangulationLimits,
)
from planning.scene.limits.pair_quality import PairQuality
from planning.scene.samples import LightOnSamples

_Array = NDArray[np.float64]


def light_slack(light: LightOnSamples, limits: ProjectorLimits) -> _Array:
    """Return the slack of a projector's light alone, shape (n,)."""
    incidence = np.arccos(np.clip(light.incidence_cos, -1.0, 1.0))
    slack = 1.0 - incidence / limits.max_incidence
    least = limits.min_tangent_angle
    tangent = np.arccos(np.clip(light.tangent_cos, 0.0, 1.0))
    share = (tangent - least) / (0.5 * np.pi - least)
    # An arbitrary T1 is stored as zero, so its cosine is exactly 0.
    return np.where(light.tangent_cos > 0.0, np.minimum(slack, share), slack)


def pair_slack(
    quality: PairQuality, limits: TriangulationLimits, cameras: CameraLimits
) -> _Array:
    """Return the slack of pairs at samples that they measure, light apart, (n,)."""
    incidence = np.arccos(np.clip(quality.view.facing, -1.0, 1.0))
    slack = 1.0 - incidence / cameras.max_incidence
    conditioning = np.maximum(quality.conditioning, 1e-12)
    slack = np.minimum(slack, 1.0 - limits.min_conditioning / conditioning)
    if (most := limits.max_sigma_m) is not None:
        slack = np.minimum(slack, 1.0 - quality.sigma / most)
    if quality.light_cos is not None:
        low, high = limits.angles
        angle = np.arccos(np.clip(quality.light_cos, -1.0, 1.0))
        between = np.minimum(angle - low, high - angle) / (0.5 * (high - low))
        slack = np.minimum(slack, between)
    return slack


def slack_at_share(slack: NDArray[np.floating[Any]], required: int) -> float:
    """Return the slack that so many samples have at least; -inf where fewer have any.

    Slacks of samples are -inf where they aren't measured, shape (n,).
    """
    if not 0 < required <= len(slack):
        return -np.inf
    place = len(slack) - required
    return float(np.partition(slack, place)[place])
