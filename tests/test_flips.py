"""The checker shares no code with the maker: flip one sign in the maker, see it go red.

The scene makes every term matter: lens shift on the camera, a wall that hides much of a
ball, and rings whose cones lean.
"""

import numpy as np
import pytest

from geometry import visibility
from geometry.devices import PinholeModel
from geometry.mesh import TriangleMesh
from geometry.primitives import box, sphere
from planning import measurability
from planning.errors import RequirementError
from planning.pipeline import plan_rig
from planning.rig import load_rig
from planning.verification import verify_plan

RIG = """
base = "default"
name = "flips"

[projector]
vertical_offset_percent = 20.0

[projector.sources]
vertical_offset_percent = "test"

[camera]
principal_point_px = [1023.5, 1100.0]

[camera.sources]
principal_point_px = "test: lens shift, so that up and down differ"

[placement]
n_reference_projectors = 600
n_reference_cameras = 400
"""


@pytest.fixture(scope="module")
def scene():
    """A ball of 160 mm with a wall in front of it."""
    ball = sphere(0.08, subdivisions=4)
    wall = box((0.3, 0.01, 0.12), divisions=6)
    return TriangleMesh(
        np.concatenate([ball.vertices, wall.vertices + [0.0, -0.12, -0.05]]),
        np.concatenate([ball.faces, wall.faces + len(ball.vertices)]),
    )


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "flips.toml"
    path.write_text(RIG)
    return load_rig(path)


def planned(scene, rig):
    try:
        return plan_rig(scene, rig, max_projectors=4, target="surface", check=False)
    except RequirementError as error:
        return error.plan


def audited(plan):
    return verify_plan(plan, check_pixels=False, seed=11)


def test_the_maker_as_it_is_passes(scene, rig):
    assert audited(planned(scene, rig)).failures == ()


def test_a_sign_flipped_in_the_projection_is_seen(scene, rig, monkeypatch):
    right = PinholeModel.project

    def flipped(self, points):
        return right(self, points * [1.0, -1.0, 1.0])

    monkeypatch.setattr(PinholeModel, "project", flipped)
    plan = planned(scene, rig)
    monkeypatch.undo()
    failures = audited(plan).failures
    assert any("seen_area_m2" in line or "measured_m2" in line for line in failures)


def test_a_sign_flipped_in_the_visibility_is_seen(scene, rig, monkeypatch):
    """Rays leave the device the wrong way, so nothing is ever in their way."""
    right = visibility.RayCaster.blocked_local

    def flipped(self, start, along, reach):
        return right(self, start, -along, reach)

    monkeypatch.setattr(visibility.RayCaster, "blocked_local", flipped)
    plan = planned(scene, rig)
    monkeypatch.undo()
    failures = audited(plan).failures
    assert any("lit_m2" in line for line in failures)


def test_a_sign_flipped_in_the_ring_normal_is_seen(scene, rig, monkeypatch):
    """The cones lean the other way: m_z changes sign in the ring frame."""
    right = measurability.rings_at

    def flipped(projector, points):
        rings = right(projector, points)
        turn = projector.world_from_ring[:3, :3]
        normals = (rings.normals @ turn * [1.0, 1.0, -1.0]) @ turn.T
        return measurability.Rings(normals, rings.spacing)

    monkeypatch.setattr(measurability, "rings_at", flipped)
    plan = planned(scene, rig)
    monkeypatch.undo()
    failures = audited(plan).failures
    assert any("measured_m2" in line for line in failures)
