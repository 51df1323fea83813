"""Where an object is and how large: of its main bodies, the same in every rotation."""

from itertools import combinations

import numpy as np

from geometry.arrays import Array, Ints, Mask

from .topology import components

# Bodies are small if each has less area than this share of the largest, and all of
# them together less than this share of the whole.
_SMALL = 0.01
# A point this much outside, relative to the radius, still counts as on the ball.
_ON = 1e-12


def main_bodies(faces: Ints, areas: Array) -> Mask:
    """Return whether each face belongs to a body that counts for the object's extent.

    A body is connected by shared vertices. The smallest ones are left out, as long as
    each has under 1 % of the largest one's area and all of them together under 1 % of
    the whole: a floating fragment must not decide where the object is.
    """
    body, area = _bodies(faces, areas)
    order = np.argsort(area, kind="stable")
    small = (np.cumsum(area[order]) < _SMALL * area.sum()) & (
        area[order] < _SMALL * area.max()
    )
    kept = np.ones(len(area), dtype=bool)
    kept[order[small]] = False
    return kept[body]


def body_areas(faces: Ints, areas: Array) -> Array:
    """Return the area of each body, the largest first; `areas` are those of faces."""
    _, area = _bodies(faces, areas)
    return np.sort(area[area > 0.0])[::-1]


def _bodies(faces: Ints, areas: Array) -> tuple[Ints, Array]:
    """Return the body of each face, and the area of each body."""
    links = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    count, label = components(links, int(faces.max()) + 1)
    body = label[faces[:, 0]]
    return body, np.bincount(body, areas, count).astype(np.float64)


def enclosing_ball(points: Array) -> tuple[Array, float]:
    """Return centre and radius of the smallest ball that holds points (n, 3).

    The ball is spanned by at most four of them. From the ball of those found so far,
    the farthest point outside joins them, and the smallest ball of these few is found
    by trying all; its radius grows with each step, so this ends, after a dozen or so.
    Unlike a bounding box the ball turns with the object.
    """
    origin = points.mean(axis=0)
    local = points - origin
    support = local[[int(np.argmax(np.einsum("ij,ij->i", local, local)))]]
    centre, radius = support[0], 0.0
    while True:
        offsets = local - centre
        squared = np.einsum("ij,ij->i", offsets, offsets)
        far = int(np.argmax(squared))
        distance = float(np.sqrt(squared[far]))
        if not distance > radius * (1.0 + _ON):
            return origin + centre, max(radius, distance)
        few = np.concatenate([support, local[[far]]])
        support, centre, grown = _ball_of_few(few)
        if not grown > radius:
            # Rounding leaves nothing to gain.
            return origin + centre, distance
        radius = grown


def _ball_of_few(points: Array) -> tuple[Array, Array, float]:
    """Smallest ball of up to five points: those that span it, centre and radius."""
    best: tuple[Array, Array, float] | None = None
    for size in range(2, min(4, len(points)) + 1):
        for chosen in combinations(range(len(points)), size):
            span = points[list(chosen)]
            centre = _circumcentre(span)
            radius = float(np.linalg.norm(span[0] - centre))
            reach = float(np.linalg.norm(points - centre, axis=1).max())
            if reach <= radius * (1.0 + 1e-10) and (best is None or radius < best[2]):
                best = span, centre, radius
    if best is None:
        # Only coinciding points have no spanning pair, triple or quadruple.
        return points[:1], points[0], 0.0
    return best


def _circumcentre(span: Array) -> Array:
    """Return the point of the span's affine hull that is equally far from each."""
    edges = span[1:] - span[0]
    gram = edges @ edges.T
    weights = np.linalg.lstsq(2.0 * gram, np.diag(gram), rcond=None)[0]
    return span[0] + weights @ edges
