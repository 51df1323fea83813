"""The housing of a head: room for it, and between heads that stand at once.

It keeps off the object, obstacles, floor, walls and zones, off the others, and out of
their light and views of the object.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from geometry.arrays import Array
from geometry.devices import PinholeModel
from geometry.shapes.boxes import box_gap, boxes_overlap
from planning.model.devices.bodies import Body
from planning.model.devices.planned import PlannedCamera
from planning.scene.bodies.clearance import lacks_clearance
from planning.scene.placed_bodies import CLEARANCE_M, placed_box
from planning.scene.scene import Scene

_ANY = PinholeModel(np.eye(3), (2, 2), (0.0, 1.0))


def has_room(scene: Scene, body: Body | None, world_from_head: Array) -> bool:
    """Return whether a housing stands off all that isn't a head."""
    housed = PlannedCamera("", world_from_head, _ANY, body=body)
    return not lacks_clearance(scene, housed)


def collision(
    body: Body | None, poses: Sequence[Array], clearance_m: float
) -> tuple[int, int] | None:
    """Return two heads whose housings come too near to each other; None: none do."""
    if body is None:
        return None
    boxes = [placed_box(body, pose).grown(CLEARANCE_M) for pose in poses]
    for (i, a), (j, b) in combinations(enumerate(boxes), 2):
        if boxes_overlap(a, b) or box_gap(a, b) < clearance_m:
            return i, j
    return None


def in_the_way(
    body: Body, pose: Array, places: Array, ball: tuple[Array, float]
) -> bool:
    """Return whether a housing may stand between places (n, 3) and an object in a ball.

    With S, r the ball about the housing and C, R that of the object: from a place O
    they overlap, and the housing isn't beyond the object::

        angle(S - O, C - O) < asin(r / |S - O|) + asin(R / |C - O|)
        |S - O| - r < |C - O| + R

    In a ball about the housing any place is taken to have it in the way.
    """
    box, (centre, radius) = placed_box(body, pose), ball
    to_box, to_object = box.centre - places, centre - places
    far, deep = (np.linalg.norm(way, axis=1) for way in (to_box, to_object))
    cosine = np.einsum("ij,ij->i", to_box, to_object) / np.maximum(far * deep, 1e-300)
    apart = np.arccos(np.clip(cosine, -1.0, 1.0))
    wide = sum(
        np.arcsin(np.clip(r / np.maximum(d, 1e-300), 0.0, 1.0))
        for r, d in ((box.radius, far), (radius, deep))
    )
    before = (apart < wide) & (far - box.radius < deep + radius)
    return bool((before | (far <= box.radius)).any())
