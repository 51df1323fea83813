"""Edges that go on as one surface: along their rings, and from ring to ring."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from planning.verify.reconstruction.arrays import Array, Indices

from .edges import ImageEdges
from .triangulate import RingHits

# Neighbours along a ring edge are looked for this far away in the image [px].
_NEAR_PX = 2.6
# The next ring is looked for this far away [px].
_NEXT_RING_PX = 100.0
# Keeps rings apart when neighbours are looked for.
_RING_APART_PX = 1000.0


def chains(
    edges: ImageEdges, hits: RingHits, focal_px: float, max_slant: float
) -> tuple[Indices, Array]:
    """Return how far edges go on as a surface, along their rings and from ring to ring.

    Slant is the change of distance between edges in units of a pixel's width there:
    the tangent of the incidence in one direction.

    Returns:
        Edges in the unbroken chain of each, links steeper than `max_slant` left out;
        and the slant towards the next rings, the lesser of both sides, NaN where
        neither is near. Both (n,).
    """
    length = np.zeros(len(edges), dtype=np.int64)
    across = np.full(len(edges), np.nan)
    rows = np.flatnonzero(np.isfinite(hits.distances))
    if len(rows) == 0:
        return length, across
    t = hits.distances[rows]
    place = np.column_stack([edges.pixels[rows], _RING_APART_PX * edges.rings[rows]])
    tree = KDTree(place)
    one, other = tree.query_pairs(_NEAR_PX, output_type="ndarray").T
    run = np.linalg.norm(place[one] - place[other], axis=1) * (t[one] / focal_px)
    linked = np.abs(t[one] - t[other]) <= max_slant * run
    ends = one[linked], other[linked]
    links = coo_array((np.ones(len(ends[0])), ends), shape=(len(rows), len(rows)))
    _, chain = connected_components(links, directed=False)
    length[rows] = np.bincount(chain)[chain]

    def towards(ring: int) -> Array:
        near = place + np.array([0.0, 0.0, ring * _RING_APART_PX])
        apart, nearest = tree.query(near, distance_upper_bound=_NEXT_RING_PX)
        found = (nearest < len(rows)) & (apart > 0.5)
        steps = np.abs(t[np.where(found, nearest, 0)] - t)
        return np.where(
            found, steps * focal_px / (np.where(found, apart, 1.0) * t), np.nan
        )

    across[rows] = np.fmin(towards(1), towards(-1))
    return length, across
