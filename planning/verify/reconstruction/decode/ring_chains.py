"""Edges that go on as one surface: along their rings, and from ring to ring."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geometry.arrays import lengths
from planning.verify.reconstruction.arrays import Array, Indices, tree_of

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
    """Return how many edges go on along the ring of each, and the slant across, (n,).

    Slant is the change of distance between edges in units of a pixel's width there:
    the tangent of the incidence in one direction. Chains break at links steeper than
    `max_slant`; across, it is the lesser towards the next rings, NaN without any near.
    """
    length = np.zeros(len(edges), dtype=np.int64)
    across = np.full(len(edges), np.nan)
    met = np.flatnonzero(np.isfinite(hits.distances))
    if len(met) == 0:
        return length, across
    t = hits.distances[met]
    place = np.column_stack([edges.pixels[met], _RING_APART_PX * edges.rings[met]])
    tree = tree_of(place)
    one, other = tree.query_pairs(_NEAR_PX, output_type="ndarray").T
    run = lengths(place[one] - place[other]) * (t[one] / focal_px)
    linked = np.abs(t[one] - t[other]) <= max_slant * run
    ends = one[linked], other[linked]
    links = coo_array((np.ones(len(ends[0])), ends), shape=(len(met), len(met)))
    _, chain = connected_components(links, directed=False)
    length[met] = np.bincount(chain)[chain]

    def towards(ring: int) -> Array:
        shifted = place + np.array([0.0, 0.0, ring * _RING_APART_PX])
        apart, nearest = tree.query(shifted, distance_upper_bound=_NEXT_RING_PX)
        near = (nearest < len(met)) & (apart > 0.5)
        steps = np.abs(t[np.where(near, nearest, 0)] - t)
        slant = steps * focal_px / (np.where(near, apart, 1.0) * t)
        return np.where(near, slant, np.nan)

    across[met] = np.fmin(towards(1), towards(-1))
    return length, across
