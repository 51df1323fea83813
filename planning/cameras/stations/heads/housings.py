"""The housing of a head: room for it, and between heads that stand at once.

It keeps off the object, obstacles, floor, walls and zones, and off the others. That it
may stand in their light isn't counted.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from geometry.arrays import Array
from geometry.devices import PinholeModel
from geometry.shapes.boxes import box_gap, boxes_overlap
from planning.model.bodies import Body
from planning.model.planned import PlannedCamera
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
