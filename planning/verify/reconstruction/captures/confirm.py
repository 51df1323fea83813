"""Pairs of devices whose points something else confirms: the mesh, or another pair.

Images that were mixed up among cameras or projectors can decode without a fault, and
every point is wrong. No cloud is made of what nothing confirms.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import (
    CAUSES,
    Decoded,
    PairIndex,
    Pairs,
)

_MM = 1e3
# Points of a pair that are looked at, and the fewest that say anything.
_LOOKED_AT = 2000
_FEWEST = 30
# Two pairs saw one spot if their edges lie this near in an image [px].
_SAME_SPOT_PX = 0.5
# Points are looked for this far beside an edge of their own ring [px].
_BESIDE_PX = 30.0
_RING_APART_PX = 1000.0
# Of one spot two pairs may differ by this many times the limit of the mean error: half
# a pixel beside the spot lies nearer or farther on slanted surface.
_APART = 3.0
# Points this many times the limit from the mesh are stray; a pair whose share of them
# is larger has seen a dent, or something is wrong with its images.
_STRAY = 10.0
_FEW_STRAYS = 0.005
_FEWEST_STRAYS = 10


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Pairs with what is left of them.

    Attributes:
        pairs: As they were, those that nothing confirms without points.
        errors_m: Median distance from the mesh [m] of each pair that is left out.
        strays: Points of a pair that are left out, far from the mesh and confirmed by
            no other pair.
        by_each_other: Whether the pairs agree with each other, but not with the mesh.
    """

    pairs: Pairs
    errors_m: dict[PairIndex, float]
    strays: dict[PairIndex, int]
    by_each_other: bool


def confirm(
    pairs: Pairs,
    mesh: TriangleMesh,
    cameras: Sequence[CameraCalibration],
    *,
    limit_m: float,
) -> Confirmed:
    """Leave out the pairs that neither the mesh nor a confirmed pair confirms.

    The mesh confirms a pair whose median distance from it keeps the limit. A pair that
    is off, though every confirmed pair that saw the same spots agrees with it, has seen
    a dent. If the mesh confirms none, but all pairs agree with each other, the object
    isn't the mesh; two pairs at least, of other cameras and other projectors. Where a
    confirmed pair has many points far from the mesh, these too need another pair.

    Args:
        pairs: What each pair gave.
        mesh: Of the plan.
        cameras: By the index of the cloud.
        limit_m: Largest root mean square distance from the mesh [m].
    """
    errors = {
        key: np.abs(_distances(mesh, pair.cloud.thinned(_LOOKED_AT)))
        for key, pair in pairs
        if len(pair.cloud)
    }
    medians = {key: float(np.median(error)) for key, error in errors.items()}
    good = {key for key, median in medians.items() if median <= limit_m}
    clouds = {key: pair.cloud for key, pair in pairs if key in errors}
    off = set(medians) - good
    if off:
        apart = _disagreements(clouds, cameras)
        if not good and _agree(off, apart, _APART * limit_m):
            return Confirmed(pairs, {}, {}, by_each_other=True)
        off = {key for key in off if not _seen_by(good, key, apart, _APART * limit_m)}
    strays: dict[PairIndex, int] = {}
    kept: Pairs = []
    for key, pair in pairs:
        if key in off:
            nothing = np.zeros(len(pair.cloud), dtype=bool)
            kept.append((key, _with_points(pair, nothing)))
            continue
        if key in good and np.mean(errors[key] > _STRAY * limit_m) > _FEW_STRAYS:
            far = np.abs(_distances(mesh, pair.cloud)) > _STRAY * limit_m
            others = {one: clouds[one] for one in sorted(good - {key})}
            camera = cameras[key[1]]
            taken = pair.cloud.take(far)
            if not _seen_too(key, taken, others, camera, _APART * limit_m):
                strays[key] = int(np.count_nonzero(far))
                pair = _with_points(pair, ~far)
        kept.append((key, pair))
    return Confirmed(
        kept, {key: medians[key] for key in off}, strays, by_each_other=False
    )


def _distances(mesh: TriangleMesh, cloud: Cloud) -> Array:
    return closest_points(mesh, cloud.points).distances


def _with_points(pair: Decoded, kept: Mask) -> Decoded:
    """Return a pair with some of its points, the others counted as unconfirmed."""
    why = pair.rejected | {"unconfirmed": int(np.count_nonzero(~kept))}
    outcomes = pair.outcomes.copy()
    outcomes[np.flatnonzero(outcomes < 0)[~kept]] = CAUSES.index("unconfirmed")
    return replace(pair, cloud=pair.cloud.take(kept), rejected=why, outcomes=outcomes)


def _seen_by(
    good: set[PairIndex],
    key: PairIndex,
    apart: dict[frozenset[PairIndex], float],
    tolerance: float,
) -> bool:
    """Whether a pair agrees with every confirmed one that saw the same spots."""
    both = [frozenset((key, other)) for other in good]
    differences = [apart[one] for one in both if one in apart]
    return bool(differences) and max(differences) <= tolerance


def _seen_too(
    key: PairIndex,
    strays: Cloud,
    others: dict[PairIndex, Cloud],
    camera: CameraCalibration,
    tolerance: float,
) -> bool:
    """Whether other pairs measured stray points alike."""
    found = [
        _difference(strays, other, camera, same=one[0] == key[0])
        for one, other in others.items()
    ]
    differences = np.concatenate([*found, np.zeros(0)])
    return len(differences) >= _FEWEST_STRAYS and bool(
        np.median(differences) <= tolerance
    )


def _disagreements(
    clouds: dict[PairIndex, Cloud], cameras: Sequence[CameraCalibration]
) -> dict[frozenset[PairIndex], float]:
    """Median difference [m] of each two pairs where both saw one spot."""
    found: dict[frozenset[PairIndex], float] = {}
    for one, other in combinations(sorted(clouds), 2):
        seen, also = clouds[one], clouds[other]
        same = one[0] == other[0]
        differences = np.concatenate(
            [
                _difference(seen, also, cameras[one[1]], same=same),
                _difference(also, seen, cameras[other[1]], same=same),
            ]
        )
        if len(differences) >= _FEWEST:
            found[frozenset((one, other))] = float(np.median(differences))
    return found


def _difference(
    seen: Cloud, other: Cloud, camera: CameraCalibration, *, same: bool
) -> Array:
    """How far points of a pair are from those of another, as its camera sees them [m].

    Where the other's show on an edge, the difference of distance. On an edge of the
    same ring of one projector that is no news, since both lie on its surface: there
    counts how far beside the edge they show.
    """
    pixels = camera.project(other.points)
    shown = np.flatnonzero(np.isfinite(pixels[:, 0]))
    if len(shown) == 0:
        return np.zeros(0)
    apart, nearest = KDTree(_place(pixels[shown], other.ring[shown], same)).query(
        _place(seen.pixels, seen.ring, same),
        distance_upper_bound=_BESIDE_PX if same else _SAME_SPOT_PX,
    )
    hit = np.isfinite(apart)
    beside, others = np.asarray(apart)[hit], shown[np.asarray(nearest)[hit]]
    own, reach = (
        np.sqrt(np.sum((points - camera.centre) ** 2, axis=1))
        for points in (seen.points[hit], other.points[others])
    )
    deep = np.where(beside <= _SAME_SPOT_PX, np.abs(own - reach), 0.0)
    wide = beside * own / camera.focal_px if same else np.zeros(len(own))
    return np.maximum(deep, wide)


def _place(pixels: Array, rings: NDArray[np.int16], by_ring: bool) -> Array:
    """Return pixels with a third coordinate that keeps rings apart, if asked for."""
    apart = _RING_APART_PX * float(by_ring)
    return np.column_stack([pixels, apart * rings.astype(np.float64)])


def _agree(
    keys: set[PairIndex], apart: dict[frozenset[PairIndex], float], tolerance: float
) -> bool:
    """Whether pairs of several cameras and projectors agree, each with some other."""
    if len({p for p, _ in keys}) < 2 or len({c for _, c in keys}) < 2:
        return False
    if not apart or max(apart.values()) > tolerance:
        return False
    order = sorted(keys)
    links = np.array([[frozenset((a, b)) in apart for b in order] for a in order])
    return connected_components(links, directed=False)[0] == 1
