"""Housings in the way of light and views, against lines that are drawn through them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.shapes.boxes import lines_cross
from planning.cameras.stations.heads.housings import in_the_way
from planning.model.devices.bodies import Body
from planning.scene.placed_bodies import placed_box

_BALL = np.array([0.02, -0.01, 0.03]), 0.1
_BODY = Body((0.01, 0.0, -0.02), (0.1, 0.03, 0.04))


def _pose(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


@pytest.mark.parametrize(
    ("where", "truth"),
    [
        ((0.5, 0.0, 0.0), True),
        ((0.5, 0.6, 0.0), False),
        ((-0.8, 0.0, 0.0), False),
        ((2.0, 0.0, 0.0), False),
    ],
)
def test_before_the_object_it_is_in_the_way_and_beside_or_behind_it_isnt(where, truth):
    places = np.array([[1.0, 0.0, 0.0]])
    assert in_the_way(_BODY, _pose(*where), places, _BALL) is truth


def test_a_housing_that_meets_any_line_to_the_object_is_in_the_way():
    rng, met = np.random.default_rng(0), 0
    for _ in range(4000):
        pose = _pose(*rng.uniform(-1.0, 1.0, 3))
        pose[:3, :3] = Rotation.random(rng=rng).as_matrix()
        place = rng.normal(size=3)
        place /= np.linalg.norm(place)
        ways = rng.normal(size=(200, 3))
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        points = _BALL[0] + _BALL[1] * rng.uniform(0.0, 1.0, (200, 1)) * ways
        box = placed_box(_BODY, pose)
        if lines_cross(box, np.tile(place, (200, 1)), points).any():
            met += 1
            assert in_the_way(_BODY, pose, place[None], _BALL)
    assert met > 10
