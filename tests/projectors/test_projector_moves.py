"""A projector moves to more margin, but never into a shadow."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene
from support.plain_shapes import box

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedProjector
from planning.projectors.candidate_set import CandidateSet
from planning.projectors.projector_poses import _between, widen_margins
from planning.projectors.projector_stage import ProjectorStage, plan_projectors
from planning.projectors.share_margin import margin_at_share, to_keep
from planning.proofs.quotas import Quotas, RegionFloors
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import Draw
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.lights import ring_frame
from planning.scene.limits import projector_limits
from planning.scene.workspace.candidates import aimed_poses


@pytest.fixture(scope="module")
def shaded():
    """A plate of 40 mm, 80 mm below a lid of 100 mm that hides it from above.

    At 50 degrees from its normal all of it is lit; the best pose, straight above it
    within the step that is allowed, lies in the shadow of the lid.
    """
    plate = box((0.04, 0.04, 0.002), divisions=8)
    lid = box((0.1, 0.1, 0.002), divisions=2)
    mesh = TriangleMesh(
        np.concatenate([plate.vertices, lid.vertices + [0.0, 0.0, 0.081]]),
        np.concatenate([plate.faces, lid.faces + len(plate.vertices)]),
    )
    rig = load_rig("default")
    required = make_requirements(mesh, rig, max_projectors=1, target=None)
    ours = (mesh.face_normals[:, 2] > 0.9) & (mesh.face_centroids[:, 2] < 0.01)
    region = np.where(ours, 0, -1)
    scene = make_scene(mesh, required, region=region)
    turn = np.radians(50.0)
    outwards = np.array([np.sin(turn), 0.0, np.cos(turn)])
    radius = float(np.mean(required.workspace.projector_radius_m))
    position = np.array(required.workspace.centre) + radius * outwards
    up = np.array(required.workspace.up)
    device = rig.projector_device()
    (pose,) = aimed_poses(position[None], np.zeros(3), up, device)
    start = PlannedProjector(
        "",
        "diverging",
        pose,
        ring_frame(pose, device, 0.0, 0.0),
        device,
        uniform_radii(0.6, 0.0035),
    )
    rows = scene.target_samples(Draw(800, 1))
    candidates = CandidateSet.over(scene, rows, (start,))
    return scene, ProjectorStage({}, {}, (start,), candidates)


def margins(scene, stage, projectors):
    lit = (
        lit_stages(scene, projectors, stage.candidates.samples) == projector_limits.LIT
    )
    return lit_margins(scene, projectors, stage.candidates.samples, lit)


def test_no_move_ends_in_shadow(shaded):
    scene, stage = shaded
    before = margins(scene, stage, stage.projectors)
    assert np.isfinite(before).all()
    moved = widen_margins(scene, stage)
    after = margins(scene, stage, moved)
    assert np.isfinite(after).mean() >= 0.9
    gained = margin_at_share(after, 720) - margin_at_share(before, 720)
    assert gained > np.radians(2.0)


def test_moves_that_fresh_samples_deny_are_undone(shaded, monkeypatch):
    scene, stage = shaded
    chosen = stage.projectors

    def confirms(_, projectors, draw):
        return projectors == chosen

    monkeypatch.setattr("planning.projectors.projector_poses.confirms", confirms)
    assert widen_margins(scene, stage) == chosen
    monkeypatch.setattr(
        "planning.projectors.projector_poses.confirms", lambda *_: False
    )
    assert widen_margins(scene, stage) != chosen


@pytest.mark.long
def test_moves_reach_no_more_than_what_was_proved_is_a_share_of():
    """Parallel light from a cone of 40 degrees: turned beams would reach round a ball.

    Such light has more margin, but what is required would then be a share of more.
    """
    mesh = sphere(0.06, subdivisions=3)
    rig = load_rig("default", light="parallel")
    required = make_requirements(mesh, rig, max_projectors=4)
    cone = replace(
        required.workspace, axis=(0.0, -1.0, 0.0), half_angle=float(np.radians(40.0))
    )
    required = replace(required, workspace=cone, dominant_coverage=0.85)
    whole = np.zeros(len(mesh.faces), dtype=int)
    scene = make_scene(mesh, required, region=whole)
    template = make_projector(rig, uniform_radii(0.2, 0.0035), (0.14, -1.57))
    stage = plan_projectors(scene, (template,), 400, rounds=1)
    moved = widen_margins(scene, stage)
    before = margins(scene, stage, stage.projectors)
    after = margins(scene, stage, moved)
    reached = stage.candidates.reached
    beyond = np.isfinite(after[~reached]).sum(axis=0)
    assert np.all(beyond <= 0.002 * reached.sum())
    share = int(np.ceil(0.85 * reached.sum()))
    assert margin_at_share(after, share) > margin_at_share(before, share)


@pytest.mark.parametrize(
    ("offered", "taken"),
    [
        (np.where(np.arange(1000) < 940, 0.3, -np.inf), True),
        # Wider for the 900 that count, but fresh samples may fall short of them.
        (np.where(np.arange(1000) < 905, 0.3, -np.inf), False),
        (np.where(np.arange(1000) < 940, 0.1, -np.inf), False),
    ],
)
def test_poses_between_are_taken_if_wider_with_light_to_spare(
    offered, taken, monkeypatch
):
    class State:
        """Margins of 1,000 samples by one projector."""

        scene, projectors, samples, margins = None, ["P"], np.arange(1000), None

        def __init__(self, margin):
            self.margin = margin[:, None]

        def on(self, some):
            return State(self.margin[some, 0])

        def with_all(self, projectors):
            return State(offered)

        def survives(self, margin):
            return True

    monkeypatch.setattr(
        "planning.projectors.projector_poses.widest_between", lambda *given: ("Q",)
    )
    state = State(np.where(np.arange(1000) < 940, 0.2, -np.inf))
    quotas = Quotas(900, RegionFloors.none(1000), np.zeros(1, dtype=int))
    kept = to_keep(state.margin, quotas)
    found = _between(state, quotas, kept, 640)
    assert (found is not state) is taken
