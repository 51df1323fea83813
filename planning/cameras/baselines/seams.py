"""Where the parts of two cameras meet: neighbours, seams and the overlap graph.

A camera's *part* is the set of samples that it measures with any projector. Parts and
their borders are known on samples only, so a border is where a sample of one part has
near samples outside it. `docs/method/baselines.md` gives the definitions in words.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from geometry.arrays import lengths

_Array = NDArray[np.float64]

# Parts that share less of the target can't be registered with each other.
MIN_OVERLAP_SHARE = 0.01
_NEAREST = 8
# Farther than this many typical distances of the nearest samples is another patch.
_REACH = 2.0
# Normals turned further than 120 degrees belong to the other side of a thin wall.
_SAME_SHEET = -0.5
# One stray sample beyond is noise at a speckled border; two are a stretch.
_FIRM = 2


@dataclass(frozen=True, eq=False)
class SampledSurface:
    """Area-true samples of the target: points [m] and unit normals, (n, 3) each."""

    points: _Array
    normals: _Array

    @cached_property
    def adjacent(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Samples, and for each a near one on the same sheet of the surface, (e,) each.

        A pair stands in both orders, sorted by the first and then by distance.
        """
        points, normals, n = self.points, self.normals, len(self.points)
        k = min(_NEAREST, n - 1)
        if k < 1:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        nearest = KDTree(points).query(points, k=k + 1)
        distance = np.asarray(nearest[0], dtype=np.float64)
        near = np.asarray(nearest[1], dtype=np.int64)
        first, second = np.repeat(np.arange(n), k + 1), near.ravel()
        valid = distance.ravel() <= _REACH * np.median(distance[:, -1])
        valid &= first != second
        valid &= np.einsum("ij,ij->i", normals[first], normals[second]) > _SAME_SHEET
        first, second = first[valid], second[valid]
        # The nearest of one needn't have it among its own nearest.
        both = np.concatenate([n * first + second, n * second + first])
        first, second = np.divmod(np.unique(both), n)
        apart = lengths(points[first] - points[second])
        order = np.lexsort((second, apart, first))
        return first[order], second[order]


@dataclass(frozen=True, eq=False)
class Seam:
    """The border of camera 1's part inside camera 2's reach, on samples.

    Attributes:
        cameras: Indices of cameras 1 and 2, in this order.
        points: Samples E that both measure, with samples of camera 2's own stretch
            beside them; where the parts only touch, such samples of camera 1's part
            alone, shape (m,).
        beyond: The nearest of those for each E, shape (m,).
        onward: From the middle of what camera 1 alone measures to the middle of what
            camera 2 alone measures in [m], shape (3,).
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
    pair: tuple[int, int], surface: SampledSurface, measured_by: NDArray[np.bool_]
) -> Seam:
    """Return the seam of a pair in one order; it may be empty."""
    points, (here, there) = surface.points, surface.adjacent
    part1, part2 = measured_by[:, pair[0]], measured_by[:, pair[1]]
    out = part1[here] & (part2 & ~part1)[there]
    count = np.bincount(here[out], minlength=len(points))
    onward = _mean(points, part2 & ~part1) - _mean(points, part1 & ~part2)
    shared = np.flatnonzero(part1 & part2)
    border = _border(count, part2)
    if not len(border):
        return Seam(pair, shared, shared, onward, False)
    # Edges are sorted by distance, so the first one of a sample leads to the nearest.
    _, nearest = np.unique(here[out], return_index=True)
    beyond = np.zeros(len(points), dtype=np.int64)
    beyond[here[out][nearest]] = there[out][nearest]
    return Seam(pair, border, beyond[border], onward, True)


def find_seams(
    orders: Sequence[tuple[int, int]],
    surface: SampledSurface,
    measured_by: NDArray[np.bool_],
) -> Iterator[Seam]:
    """Yield the seams of pairs in the orders named, those that aren't empty."""
    for order in orders:
        seam = find_seam(order, surface, measured_by)
        if len(seam.points):
            yield seam


def both_orders(pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return each pair, and right after it the same the other way round."""
    return [order for a, b in pairs for order in ((a, b), (b, a))]


def _border(count: NDArray[np.int64], reach: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Border samples inside camera 2's reach, or all where the parts only touch."""
    for mask in ((count >= _FIRM) & reach, (count > 0) & reach, count >= _FIRM):
        if mask.any():
            return np.flatnonzero(mask)
    return np.flatnonzero(count > 0)


def neighbouring_pairs(
    measured_by: NDArray[np.bool_], surface: SampledSurface
) -> list[tuple[int, int]]:
    """Return pairs (a, b), a < b, of cameras whose parts overlap or touch by enough.

    Parts overlap by enough if both measure at least `MIN_OVERLAP_SHARE` of the n
    samples. They touch by enough if the line along which they meet is at least as long
    as the side of a square of that area: on samples, at least sqrt(MIN_OVERLAP_SHARE n)
    of either part have a near one in the other only.
    """
    least = MIN_OVERLAP_SHARE * len(measured_by)
    pairs: list[tuple[int, int]] = []
    for a, b in combinations(range(measured_by.shape[1]), 2):
        part1, part2 = measured_by[:, a], measured_by[:, b]
        overlaps = np.count_nonzero(part1 & part2) >= least > 0.0
        if overlaps or _contact(part1, part2, surface) >= max(1.0, np.sqrt(least)):
            pairs.append((a, b))
    return pairs


def _contact(
    part1: NDArray[np.bool_], part2: NDArray[np.bool_], surface: SampledSurface
) -> int:
    """How many samples lie along the line where two parts meet."""
    here, there = surface.adjacent
    into2 = part1[here] & (part2 & ~part1)[there]
    into1 = part2[here] & (part1 & ~part2)[there]
    return min(len(np.unique(here[into2])), len(np.unique(here[into1])))


def overlap_components(measured_by: NDArray[np.bool_]) -> list[list[int]]:
    """Return the groups of cameras whose parts can be registered with each other.

    Two parts can be registered if both measure at least `MIN_OVERLAP_SHARE` of the
    samples; to touch is not enough. Groups are ordered by their first camera.
    """
    part = measured_by.astype(np.float64)
    shared = part.T @ part
    linked = (shared >= MIN_OVERLAP_SHARE * len(part)) & (shared > 0.0)
    _, label = connected_components(coo_array(linked), directed=False)
    groups: dict[int, list[int]] = {}
    for camera, group in enumerate(label.tolist()):
        groups.setdefault(group, []).append(camera)
    return list(groups.values())


def spread_points(
    points: _Array, n: int, first: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """Return n of the points: up to half of them the `first`, the others far apart.

    All of them if there are no more.
    """
    if len(points) <= n:
        return np.arange(len(points))
    chosen = [] if first is None else first[: n // 2].tolist()
    chosen = chosen or [0]
    gap = np.min(lengths(points[:, None] - points[chosen][None]), axis=1)
    while len(chosen) < n:
        farthest = int(np.argmax(gap))
        chosen.append(farthest)
        gap = np.minimum(gap, lengths(points - points[farthest]))
    return np.array(sorted(chosen), dtype=np.int64)


def _mean(points: _Array, chosen: NDArray[np.bool_]) -> _Array:
    """Mean of the chosen points; of all where none is."""
    return points[chosen if chosen.any() else slice(None)].mean(axis=0)
