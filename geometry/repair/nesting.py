"""Which pieces of a surface lie wholly inside which others."""

import numpy as np

from geometry.arrays import Array, Ints, Mask, rows_of
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import grouped
from geometry.poses import fibonacci_cap
from geometry.rays.rays import RayCaster, equal_parts

from .openness import Spots, spots_on

# Spots of a piece, of which this share must lie inside: one may be misjudged.
_SPOTS = 32
_WHOLLY = 0.95
_MAX_SPOTS = 1 << 17
_CHUNK = 1 << 15
# A ray that meets more walls than this isn't followed, and its spot counts as outside.
_MAX_WALLS = 4096
_STEP = 1e-6
# Boxes are compared in blocks of this many pairs.
_MAX_PAIRS = 1 << 24


def containers(
    mesh: TriangleMesh, patch: Ints, holding: Mask, asked: Mask, caster: RayCaster
) -> list[Ints]:
    """Return the patches that wholly hold each that is asked, the outermost first.

    A point lies inside a patch if a ray from it crosses the patch an odd number of
    times; three rays vote, since one may pass through an edge. A patch is held if its
    points, spread over its area, lie inside: a body that sticks out isn't. Only patches
    that are `holding` (n,) hold others: closed ones, and those open ones that are
    closed but for a crack. `patch` is the number of the patch of each face, (n_f,).
    """
    n = len(holding)
    inner = _in_some_box(mesh, patch, holding, asked)
    if not inner.any():
        return [np.zeros(0, np.int64)] * n
    least = int(np.clip(_MAX_SPOTS // int(inner.sum()), 4, _SPOTS))
    spots = spots_on(mesh, 0, group=patch, least=least, within=inner[patch])
    pairs = np.concatenate(
        [
            _spots_inside(patch, spots.take(part), n, caster)
            for part in equal_parts(len(spots), _CHUNK)
        ]
    )
    pairs, counts = np.unique(pairs, return_counts=True)
    row, holder = np.divmod(pairs, n)
    keep = (counts >= _WHOLLY * least) & holding[holder] & (row != holder)
    row, holder = row[keep], holder[keep]
    depth = np.bincount(row, minlength=n)
    mine = [holder[holders] for holders in grouped(row, n)]
    return [holders[np.argsort(depth[holders], kind="stable")] for holders in mine]


def _in_some_box(mesh: TriangleMesh, patch: Ints, holding: Mask, asked: Mask) -> Mask:
    """Whether the box of each asked patch lies in that of another that may hold it."""
    order = np.argsort(patch, kind="stable")
    start = np.searchsorted(patch[order], np.arange(len(holding)))
    a, b, c = mesh.corners.transpose(1, 0, 2)
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    low = np.minimum.reduceat(rows_of(low, order), start)
    high = np.maximum.reduceat(rows_of(high, order), start)
    outer, rows = np.flatnonzero(holding), np.flatnonzero(asked)
    inside = np.zeros(len(holding), dtype=bool)
    if not len(outer):
        return inside
    for part in np.array_split(rows, -(-len(rows) * len(outer) // _MAX_PAIRS) or 1):
        fits = np.all(low[part, None] >= low[outer], axis=2)
        fits &= np.all(high[part, None] <= high[outer], axis=2)
        fits &= part[:, None] != outer
        inside[part] = fits.any(axis=1)
    return inside


def _spots_inside(patch: Ints, spots: Spots, n: int, caster: RayCaster) -> Ints:
    """Keys ``own patch * n + other`` for each spot that lies inside the other."""
    votes: list[Ints] = []
    for direction in fibonacci_cap(3, np.array([0.31, 0.52, 0.8]), 1.2):
        keys, crossed = np.unique(
            _crossings(patch, spots.points, direction, n, caster),
            return_counts=True,
        )
        votes.append(keys[crossed % 2 == 1])
    keys, counts = np.unique(np.concatenate(votes), return_counts=True)
    spot, other = np.divmod(keys[counts >= 2], n)
    return patch[spots.faces[spot]] * n + other


def _crossings(
    patch: Ints, points: Array, direction: Array, n: int, caster: RayCaster
) -> Ints:
    """One key ``point * n + patch`` for each wall that the ray of a point meets."""
    step = _STEP * caster.extent
    alive = np.arange(len(points))
    at = points + step * direction
    keys: list[Ints] = []
    for _ in range(_MAX_WALLS):
        along = np.broadcast_to(direction, at.shape)
        faces, distances = caster.first_hits(at, along)
        hit = faces >= 0
        alive, at = alive[hit], at[hit]
        if len(alive) == 0:
            break
        keys.append(alive * n + patch[faces[hit]])
        forward = np.maximum(distances[hit], 0.0) + step
        at = at + forward[:, None] * direction
    met = np.concatenate(keys) if keys else np.zeros(0, np.int64)
    # What is still under way met too many walls: its parity is unknown.
    return met[~np.isin(met // n, alive)] if len(alive) else met
