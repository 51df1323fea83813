"""Where the parts of two cameras meet: neighbours, seams and the overlap graph.

A camera's *part* is the set of samples that it measures with any projector. Parts and
their borders are known on samples only, so a border is where a sample of one part has
near samples outside it. `docs/baselines.md` gives the definitions in words.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

_Array = NDArray[np.float64]

_NEAREST = 8
# Farther than this many typical distances of the nearest samples is another patch.
_REACH = 2.0
# Normals turned further than 120 degrees belong to the other side of a thin wall.
_SAME_SHEET = -0.5
# One stray sample beyond is noise at a speckled border; two are a stretch.
_FIRM = 2


@dataclass(frozen=True, eq=False)
class Adjacency:
    """Near samples of each sample on the same sheet of the surface.

    Attributes:
        near: Indices, shape (n, k).
        valid: Whether each of them counts, shape (n, k).
    """

    near: NDArray[np.int64]
    valid: NDArray[np.bool_]


def adjacency(points: _Array, normals: _Array) -> Adjacency:
    """Return the near samples of each sample.

    Args:
        points: Area-true samples in [m], shape (n, 3).
        normals: Unit normals, shape (n, 3).
    """
    n = len(points)
    k = min(_NEAREST, n - 1)
    if k < 1:
        empty = np.zeros((n, 0), dtype=np.int64)
        return Adjacency(empty, empty.astype(bool))
    found = KDTree(points).query(points, k=k + 1)
    distance = np.asarray(found[0], dtype=np.float64)[:, 1:]
    near = np.asarray(found[1], dtype=np.int64)[:, 1:]
    valid = distance <= _REACH * np.median(distance[:, -1])
    turn = np.einsum("ij,ikj->ik", normals, normals[near])
    return Adjacency(near, valid & (turn > _SAME_SHEET))


@dataclass(frozen=True, eq=False)
class Seam:
    """The border of camera 1's part inside camera 2's reach, on samples.

    Attributes:
        cameras: Indices of cameras 1 and 2, in this order.
        points: Samples E of camera 1's part with samples of camera 2's own stretch
            beside them, shape (m,).
        beyond: The nearest of those for each E, shape (m,).
        onward: Direction from camera 1's stretch into camera 2's in [m], shape (m, 3);
            zero where the parts share no border.
        shares_border: False where camera 2's own stretch doesn't adjoin camera 1's
            part on the target (regions lie apart, or it has none); then `points` are
            all the samples that both measure.
    """

    cameras: tuple[int, int]
    points: NDArray[np.int64]
    beyond: NDArray[np.int64]
    onward: _Array
    shares_border: bool


def find_seam(
    first: int,
    second: int,
    points: _Array,
    measured_by: NDArray[np.bool_],
    adjacent: Adjacency,
) -> Seam:
    """Return the seam of a pair in one order; it may be empty.

    Args:
        first: Index of camera 1.
        second: Index of camera 2.
        points: Samples in [m], shape (n, 3).
        measured_by: Which camera measures which sample, shape (n, n_cameras).
        adjacent: Of the same samples.
    """
    part1, part2 = measured_by[:, first], measured_by[:, second]
    outside = (part2 & ~part1)[adjacent.near] & adjacent.valid
    count = np.where(part1, outside.sum(axis=1), 0)
    border = np.flatnonzero(count >= _FIRM)
    if not len(border):
        border = np.flatnonzero(count > 0)
    if not len(border):
        shared = np.flatnonzero(part1 & part2)
        return Seam((first, second), shared, shared, np.zeros((len(shared), 3)), False)
    near, out = adjacent.near[border], outside[border]
    inside = part1[near] & adjacent.valid[border]
    offsets = points[near] - points[border][:, None]
    # E itself belongs to camera 1's stretch, hence one more in the second mean.
    onward = _mean(offsets, out, 0) - _mean(offsets, inside, 1)
    nearest = near[np.arange(len(border)), np.argmax(out, axis=1)]
    return Seam((first, second), border, nearest, onward, True)


def neighbouring_pairs(
    measured_by: NDArray[np.bool_],
    weights: _Array,
    adjacent: Adjacency,
    *,
    min_overlap_share: float = 0.01,
    target_weight: float | None = None,
) -> list[tuple[int, int]]:
    """Return the pairs of cameras whose parts overlap or touch by enough of the target.

    Parts overlap by enough if the samples that both measure weigh at least
    `min_overlap_share` of the target. They touch by enough if the line along which
    they meet is at least as long as the side of a square of that area: on samples, at
    least sqrt(min_overlap_share n) of one part have a near one in the other part only.

    Args:
        measured_by: Which camera measures which sample, shape (n, n_cameras).
        weights: Weight of each sample, shape (n,).
        adjacent: Of the same samples.
        min_overlap_share: Least share of the target.
        target_weight: Weight of the whole target; None: that of the samples.

    Returns:
        Pairs (a, b) with a < b, in increasing order.
    """
    total = float(weights.sum()) if target_weight is None else target_weight
    n_target = total / float(weights.mean()) if len(weights) else 0.0
    least = max(1.0, np.sqrt(min_overlap_share * n_target))
    pairs: list[tuple[int, int]] = []
    for a, b in combinations(range(measured_by.shape[1]), 2):
        part1, part2 = measured_by[:, a], measured_by[:, b]
        overlap = float(weights[part1 & part2].sum())
        if (
            overlap >= min_overlap_share * total > 0.0
            or _contact(part1, part2, adjacent) >= least
            or _contact(part2, part1, adjacent) >= least
        ):
            pairs.append((a, b))
    return pairs


def _contact(
    part1: NDArray[np.bool_], part2: NDArray[np.bool_], adjacent: Adjacency
) -> int:
    beside = (part2 & ~part1)[adjacent.near] & adjacent.valid
    return int(np.count_nonzero(part1 & beside.any(axis=1)))


def overlap_components(
    measured_by: NDArray[np.bool_],
    weights: _Array | float,
    *,
    min_overlap_share: float = 0.01,
    target_weight: float | None = None,
) -> list[list[int]]:
    """Return the groups of cameras whose parts can be registered with each other.

    Two parts can be registered if the samples that both measure weigh at least
    `min_overlap_share` of the target; to touch is not enough.

    Returns:
        Groups of camera indices, each increasing, ordered by their first camera.
    """
    n, k = measured_by.shape
    weights = np.broadcast_to(np.asarray(weights, dtype=np.float64), (n,))
    total = float(weights.sum()) if target_weight is None else target_weight
    part = measured_by.astype(np.float64)
    shared = part.T @ (part * weights[:, None])
    linked = coo_array((shared >= min_overlap_share * total) & (shared > 0.0))
    _, label = connected_components(linked, directed=False)
    groups: dict[int, list[int]] = {}
    for camera in range(k):
        groups.setdefault(int(label[camera]), []).append(camera)
    return list(groups.values())


def overlap_graph_connected(
    measured_by: NDArray[np.bool_],
    weights: _Array | float,
    *,
    min_overlap_share: float = 0.01,
    target_weight: float | None = None,
) -> bool:
    """Return whether all parts can be registered with each other, directly or not."""
    components = overlap_components(
        measured_by,
        weights,
        min_overlap_share=min_overlap_share,
        target_weight=target_weight,
    )
    return len(components) <= 1


def _mean(offsets: _Array, chosen: NDArray[np.bool_], extra: int) -> _Array:
    total = np.einsum("ikj,ik->ij", offsets, chosen.astype(np.float64))
    return total / np.maximum(chosen.sum(axis=1) + extra, 1)[:, None]
