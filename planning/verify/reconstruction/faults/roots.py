"""Points that took the wrong one of the two roots of their ray and ring."""

from dataclasses import replace

import numpy as np

from planning.model.plan import RigPlan

from .diagnosis import Pairs
from .supposed import Evidence, Supposed, mismatches, places

_POINTS_A_PAIR = 1000
# An edge lies on its ring on the mesh within this, its point lies this far from there:
# as shares of the limit on the rms distance.
_ON_RING_SHARE, _ELSEWHERE_SHARE = 1.0, 20.0
# Fewer wrong ones are what noise does near the border of a disc.
_LEAST_SHARE = 0.05


def wrong_roots(plan: RigPlan, decoded: Pairs) -> tuple[tuple[str, str, float], ...]:
    """Return pairs of projector and camera whose points often lie on the other root.

    The ray of such a point meets the mesh where its ring is drawn, but the point was
    put elsewhere on the ray: labels and poses are right, the root bit isn't.

    Args:
        plan: Of the rig.
        decoded: What each pair gave.

    Returns:
        Id of the projector and the camera, and the share of the pair's points.
    """
    limit = plan.requirements.check.max_rms_m
    supposed = Supposed.of(plan)
    found: list[tuple[str, str, float]] = []
    for (p, c), pair in decoded:
        cloud = pair.cloud.take(_some(len(pair.cloud)))
        if len(cloud) == 0:
            continue
        radii = plan.projectors[p].ring_radii[cloud.ring]
        evidence = replace(Evidence.at(plan, cloud.pixels, p, c), radii=radii)
        at = places(evidence, supposed)
        off = np.abs(mismatches(evidence, supposed, at)[0])
        apart = np.linalg.norm(cloud.points - at.points, axis=1)
        wrong = (off < _ON_RING_SHARE * limit) & (apart > _ELSEWHERE_SHARE * limit)
        share = float(np.mean(wrong))
        if share > _LEAST_SHARE:
            found.append((plan.projectors[p].id, plan.cameras[c].id, share))
    return tuple(found)


def _some(n: int) -> np.ndarray:
    return np.arange(0, n, max(1, -(-n // _POINTS_A_PAIR)))
