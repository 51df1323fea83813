"""Poses moved one at a time find what a lattice of candidates misses.

Parallel light within 45 degrees lights caps of 0.146 of a ball. Six, 90 degrees apart,
don't overlap and light 0.879; five light 0.732 at most. A lattice of 40 poses needs
seven for 0.865.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene
from support.plain_shapes import grid, joined

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.projectors import moved_projectors as moved
from planning.projectors.candidate_set import CandidateSet, CandidateSource
from planning.projectors.moved_projectors import _Moves, moved_projectors
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.all_poses import Effort
from planning.proofs.selection import CandidateCover, select_fewest
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import Draw
from planning.scene.workspace.candidates import Candidates

EFFORT = Effort(finest=6, maps=6, budget=2e9, shadows=0.0, most_samples=2000, starts=4)


def scene_of(mesh, share, incidence_deg):
    rig = load_rig("default", light="parallel")
    required = make_requirements(mesh, rig, max_projectors=9)
    limits = replace(
        required.projector,
        max_incidence=np.radians(incidence_deg),
        min_tangent_angle=0.0,
    )
    required = replace(required, projector=limits, dominant_coverage=share)
    template = make_projector(rig, uniform_radii(0.15, 0.0035))
    return make_scene(mesh, required), template


def lattice_of(scene, template, n):
    poses = Candidates(template, scene.requirements.workspace).over(n)
    samples = scene.target_samples(Draw(2000, 100))
    source = CandidateSource(scene, (template,))
    return source, CandidateSet.over(scene, samples, poses)


@pytest.fixture(scope="module")
def ball():
    return lattice_of(*scene_of(sphere(0.1, subdivisions=4), 0.865, 45.0), 40)


@pytest.mark.long
def test_six_caps_are_found_where_the_lattice_needs_seven(ball):
    source, offer = ball
    assert select_fewest(offer.cover).needed == 7
    found = moved_projectors(source, offer, 6, starts=4)
    assert len(found) == 6
    lit = CandidateSet.over(offer.scene, offer.samples, found).reached
    assert lit.sum() >= 0.865 * (offer.reached | lit).sum()
    axes = np.array([pose.world_from_device[:3, 2] for pose in found])
    apart = np.degrees(np.arccos(np.clip(axes @ axes.T, -1.0, 1.0)))
    assert np.min(apart + 360 * np.eye(6)) > 75.0
    again = moved_projectors(source, offer, 6, starts=4)
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one.world_from_device, other.world_from_device)


def test_what_no_poses_can_do_and_what_is_not_asked_for_is_not_found(ball):
    source, offer = ball
    assert moved_projectors(source, offer, 5, starts=2) == ()
    assert moved_projectors(source, offer, 6, starts=0) == ()


def test_existing_poses_stay_and_are_not_returned(ball):
    source, offer = ball
    standing = replace(offer, n_existing=1)
    found = moved_projectors(source, standing, 6, starts=6)
    assert len(found) == 5
    lit = CandidateSet.over(offer.scene, offer.samples, found).reached
    assert (lit | offer.lit[:, 0]).sum() >= 0.865 * offer.reached.sum()


def test_what_fresh_samples_deny_is_asked_for_again_and_given_up(ball, monkeypatch):
    source, offer = ball
    asked = []

    def denied(_, projectors, draw):
        asked.append((len(projectors), draw))
        return False

    monkeypatch.setattr(moved, "confirms", denied)
    assert moved_projectors(source, offer, 6, starts=1) == ()
    assert len(asked) > 1
    assert len({draw for _, draw in asked}) == len(asked)


@pytest.mark.long
def test_as_few_as_there_may_be_are_found_where_candidates_need_two_more():
    """Ten poses light 0.87 of a ball by eight caps; six need 0.146 each."""
    scene, template = scene_of(sphere(0.1, subdivisions=4), 0.87, 45.0)
    asked = replace(scene.requirements, max_projectors=6)
    source, offer = lattice_of(replace(scene, requirements=asked), template, 10)
    stage = ProjectorStage.over(offer, select_fewest(offer.cover))
    assert stage.certificate.needed.count == 8
    effort = replace(EFFORT, budget=2e8)
    proof = prove_fewest(offer.scene, stage, source.templates, effort).certificate
    assert (proof.count, proof.needed.count, proof.status) == (6, 6, "optimal")


def upright(axis):
    """A plate that stands up and faces along an axis of the ground."""
    plate = grid(0.1, 0.1, divisions=(6, 6))
    turned = {
        "x": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        "y": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
    }[axis]
    return TriangleMesh(plate.vertices @ np.array(turned).T, plate.faces)


@pytest.mark.long
def test_two_projectors_light_a_cross_for_which_candidates_need_three(monkeypatch):
    """Light along a plate's normal runs along the other, which then has no shadow.

    So two light all of both. Off it by an angle a, the other's shadow is a strip of
    0.05 tan a, and poses of a coarse lattice are off by more than 95 % allow. One
    lights 0.75 at most: of light between the normals each plate takes half of the
    other's at least, as far as it isn't over its edge.
    """
    mesh = joined(upright("x"), upright("y"))
    source, offer = lattice_of(*scene_of(mesh, 0.97, 60.0), 24)
    stage = ProjectorStage.over(offer, select_fewest(offer.cover))
    assert stage.certificate.needed.count == 3
    # Else the cells that weren't refuted say where to look.
    monkeypatch.setattr(CandidateSource, "towards", lambda *_: ())
    shadows, found = replace(EFFORT, shadows=np.inf), []
    for starts in (0, 2):
        effort = replace(shadows, starts=starts)
        proved = prove_fewest(offer.scene, stage, source.templates, effort)
        needed, bound = proved.certificate.needed, proved.certificate.continuous
        found.append((needed.count, bound.lower_bound))
    assert found == [(3, 2), (2, 2)]

    # Nobody looks for two where there may be one, and two are proved to be needed.
    one = replace(offer.scene.requirements, max_projectors=1)
    scene = replace(offer.scene, requirements=one)
    stage = replace(stage, candidates=replace(offer, scene=scene))
    proved = prove_fewest(scene, stage, source.templates, effort)
    assert proved.certificate.needed.count == 3


def test_what_poses_cover_beside_the_known_ones_is_required_too():
    known = np.zeros((10, 1), dtype=bool)
    known[:4] = True
    candidates = SimpleNamespace(cover=CandidateCover(known, 1.0), reached=known[:, 0])
    moves = _Moves(None, candidates, np.random.default_rng(0))
    covered = np.arange(10) < 6
    assert moves.missed(covered) == 0.0
    covered[0] = False
    # Six are required then, and five of them covered.
    assert abs(moves.missed(covered) - 1.0 / 6.0) < 1e-12
