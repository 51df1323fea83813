"""The checker shares no code with the maker: flip one sign in the maker, see it go red.

The scene makes every term matter: lens shift on the camera, a wall that hides much of a
ball, and rings whose cones lean. The rig is planned once, as it should be; then the
maker writes its claims again, of the same devices, with one sign flipped. The checker
judges them while the sign is still flipped: what it shared would be wrong with it.
"""

from dataclasses import replace

import numpy as np
import pytest
from support.little_work import draw_fewer, work_little
from support.plain_shapes import box

from geometry.devices import PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.rays import visibility
from geometry.shapes.primitives import sphere
from planning import pipeline
from planning.report.assemble import Draft, write_plan
from planning.rig.rig import load_rig
from planning.scene.codes.patterns import RingPattern
from planning.scene.draws import Draw
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.verify.audit.audit import audit_plan

pytestmark = pytest.mark.long

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
n_candidate_projectors = 600
n_candidate_cameras = 400
n_reference_projectors = 600
n_reference_cameras = 400

[workspace]
shape = "cone"
axis = [0.0, -1.0, -0.3]
half_angle_deg = 20.0

[limits]
min_conditioning = 0.3

[requirements]
coverage = 0.8
dominant_coverage = 0.8
min_reachable = 0.1
region_coverage = 0
"""


@pytest.fixture(scope="module", autouse=True)
def fewer_samples():
    """A flipped sign moves areas by far more than a sixth of the samples can hide."""
    with pytest.MonkeyPatch.context() as patch:
        work_little(patch)
        draw_fewer(patch, claims=2000)
        yield


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
def made(scene, tmp_path_factory):
    """The plan, and what it was written from."""
    path = tmp_path_factory.mktemp("rig") / "flips.toml"
    path.write_text(RIG)
    sources = []
    right = Draft.of

    def kept(partial, clock):
        sources.append((partial, clock))
        return right(partial, clock)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Draft, "of", kept)
        wishes = {"target": "surface", "cameras_by": "cover", "check": False}
        plan = pipeline.plan_rig(scene, load_rig(path), max_projectors=4, **wishes)
    return plan, sources[-1]


def audited(plan):
    return audit_plan(plan, n_samples=4000, seed=11)


def written_again(made):
    _, (draft, clock) = made
    return write_plan(draft, clock)


def test_the_maker_as_it_is_passes(made):
    plan, _ = made
    assert audited(plan).failures == ()
    assert written_again(made).coverage == plan.coverage


def test_a_sign_flipped_in_the_projection_is_seen(made, monkeypatch):
    right = PinholeModel.project

    def flipped(self, points):
        return right(self, points * [1.0, -1.0, 1.0])

    monkeypatch.setattr(PinholeModel, "project", flipped)
    failures = audited(written_again(made)).failures
    assert any("seen_area_m2" in line or "measured_m2" in line for line in failures)


def test_a_sign_flipped_in_the_visibility_is_seen(made, monkeypatch):
    """Rays leave the device the wrong way, so nothing is ever in their way."""
    right = visibility.RayCaster.blocked_local

    def flipped(self, start, along, reach):
        return right(self, start, -along, reach)

    monkeypatch.setattr(visibility.RayCaster, "blocked_local", flipped)
    failures = audited(written_again(made)).failures
    assert any("lit_m2" in line for line in failures)


def test_a_sign_flipped_in_the_ring_normal_is_seen(made, monkeypatch):
    """The cones lean the other way: m_z changes sign in the ring frame.

    A camera that stands well measures whichever way they lean. So one that doesn't
    takes its place: of those that were on offer, that to which it matters most.
    """
    plan, (draft, clock) = made
    samples = draft.scene.target_samples(Draw(500, 5))
    offered = draft.camera_stage.reference
    right = RingPattern.surfaces

    def flipped(pattern, points):
        rings = right(pattern, points)
        turn = pattern.projector.world_from_ring[:3, :3]
        normals = (rings.normals @ turn * [1.0, 1.0, -1.0]) @ turn.T
        return replace(rings, normals=normals)

    def measured():
        lit = lit_samples(draft.scene, plan.projectors, samples)
        return measured_by(draft.scene, offered, lit).sum(axis=0)

    true = measured()
    with monkeypatch.context() as patch:
        patch.setattr(RingPattern, "surfaces", flipped)
        differs = np.abs(measured() - true)
    changed = replace(draft, cameras=(offered[np.argmax(differs)],))
    sentence = "coverage.target.measured_m2: claimed"
    found = audited(write_plan(changed, clock)).failures
    assert not any(sentence in line for line in found)
    monkeypatch.setattr(RingPattern, "surfaces", flipped)
    found = audited(write_plan(changed, clock)).failures
    assert any(sentence in line for line in found)
