"""Pairs of devices whose points something else confirms: the mesh, or another pair.

Images that were mixed up among cameras or projectors can decode without a fault, and
every point is wrong. No cloud is made of what nothing confirms.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from geometry.mesh import TriangleMesh
from geometry.proximity import closest_points

from .calibration import CameraCalibration
from .check import Pairs
from .cloud import Cloud
from .decode import Decoded

_MM = 1e3
# Points of a pair that are looked at, and the fewest that say anything.
_LOOKED_AT = 2000
_FEWEST = 30
# Two pairs saw one spot if their edges lie this near in an image [px].
_SAME_SPOT_PX = 0.5
# Of one spot two pairs may differ by this many times the limit of the mean error: half
# a pixel beside the spot lies nearer or farther on slanted surface.
_APART = 3.0


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Pairs with what is left of them.

    Attributes:
        pairs: As they were, those that nothing confirms without points.
        errors_m: Median distance from the mesh [m] of each pair that is left out.
        by_each_other: Whether the pairs agree with each other, but not with the mesh.
    """

    pairs: Pairs
    errors_m: dict[tuple[int, int], float]
    by_each_other: bool


def confirm(
    pairs: Pairs,
    mesh: TriangleMesh,
    cameras: list[CameraCalibration],
    *,
    limit_m: float,
    threads: int,
) -> Confirmed:
    """Leave out the pairs that neither the mesh nor a confirmed pair confirms.

    The mesh confirms a pair whose median distance from it keeps the limit. A pair that
    is off, though every confirmed pair that saw the same spots agrees with it, has seen
    a dent. If the mesh confirms none, but all pairs agree with each other, the object
    isn't the mesh; two pairs at least, of other cameras and other projectors.

    Args:
        pairs: What each pair gave.
        mesh: Of the plan.
        cameras: By the index of the cloud.
        limit_m: Largest root mean square distance from the mesh [m].
        threads: Worker threads of the closest points.
    """
    clouds = {key: _some(pair.cloud) for key, pair in pairs if len(pair.cloud)}
    errors = {
        key: float(np.median(np.abs(_distances(mesh, cloud, threads))))
        for key, cloud in clouds.items()
    }
    good = {key for key, error in errors.items() if error <= limit_m}
    left = set(errors) - good
    if not left:
        return Confirmed(pairs, {}, by_each_other=False)
    whole = {key: pair.cloud for key, pair in pairs if key in errors}
    apart = _disagreements(whole, cameras)
    tolerance = _APART * limit_m
    if not good:
        if _agree(set(errors), apart, tolerance):
            return Confirmed(pairs, {}, by_each_other=True)
    for key in sorted(left):
        others = [
            apart[frozenset((key, other))]
            for other in good
            if frozenset((key, other)) in apart
        ]
        if others and max(others) <= tolerance:
            left.remove(key)
    kept = [(key, _emptied(pair) if key in left else pair) for key, pair in pairs]
    return Confirmed(kept, {key: errors[key] for key in left}, by_each_other=False)


def _some(cloud: Cloud) -> Cloud:
    return cloud.take(np.arange(0, len(cloud), -(-len(cloud) // _LOOKED_AT)))


def _distances(mesh: TriangleMesh, cloud: Cloud, threads: int) -> NDArray[np.float64]:
    return closest_points(mesh, cloud.points, threads=threads).distances


def _emptied(pair: Decoded) -> Decoded:
    nothing = pair.cloud.take(np.zeros(0, dtype=np.int64))
    why = pair.rejected | {"unconfirmed": len(pair.cloud)}
    return replace(pair, cloud=nothing, rejected=why)


def _disagreements(
    clouds: dict[tuple[int, int], Cloud], cameras: list[CameraCalibration]
) -> dict[frozenset[tuple[int, int]], float]:
    """Median difference [m] of each two pairs where both saw one spot."""
    found: dict[frozenset[tuple[int, int]], float] = {}
    for one, other in combinations(sorted(clouds), 2):
        differences = np.concatenate(
            [
                _difference(clouds[one], clouds[other], cameras[one[1]]),
                _difference(clouds[other], clouds[one], cameras[other[1]]),
            ]
        )
        if len(differences) >= _FEWEST:
            found[frozenset((one, other))] = float(np.median(differences))
    return found


def _difference(
    seen: Cloud, other: Cloud, camera: CameraCalibration
) -> NDArray[np.float64]:
    """Differences of distance [m] where points of another pair show on edges of one."""
    pixels = camera.project(other.points)
    shown = np.flatnonzero(np.isfinite(pixels[:, 0]))
    apart, nearest = KDTree(seen.pixels).query(
        pixels[shown], distance_upper_bound=_SAME_SPOT_PX
    )
    hit = np.isfinite(apart)
    own, others = np.asarray(nearest)[hit], shown[hit]
    reach = np.linalg.norm(seen.points[own] - camera.centre, axis=1)
    return np.abs(np.linalg.norm(other.points[others] - camera.centre, axis=1) - reach)


def _agree(
    keys: set[tuple[int, int]],
    apart: dict[frozenset[tuple[int, int]], float],
    tolerance: float,
) -> bool:
    """Whether pairs of several cameras and projectors agree, each with some other."""
    if len({p for p, _ in keys}) < 2 or len({c for _, c in keys}) < 2:
        return False
    if not apart or max(apart.values()) > tolerance:
        return False
    reached = {min(keys)}
    while True:
        linked = {key for both in apart if both & reached for key in both}
        if linked <= reached:
            return reached == keys
        reached |= linked
