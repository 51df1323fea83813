"""Floors of regions on a box in parallel light, where what lights a side is known.

A side is lit iff the light meets it at 50 degrees at most: one projector lights two
sides that share an edge (at 45 degrees each), never three, and never opposite ones.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene
from support.little_work import draw_fewer
from support.plain_shapes import box

from planning.model.progress import Stopwatch
from planning.projectors.fewest_projectors import confirms
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import plan_projectors
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.all_poses import Effort
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import Draw
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.steps import stages

# Two sides of 100 cm2, the others of 20 cm2.
SIZE = (0.02, 0.1, 0.1)
BIG = ((1, 0, 0), (-1, 0, 0))
EFFORT = Effort(finest=4, maps=4, budget=2e8, shadows=0.0)


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch):
    draw_fewer(monkeypatch, projectors=300, fresh_projectors=300)


def planned(sides, floor, **wishes):
    """Scene, stage with both bounds, and the projectors at their widest margins."""
    mesh = box(SIZE, divisions=4)
    sides = np.array(sides)
    facing = mesh.face_normals @ sides.T > 0.9
    region = np.where(facing.any(axis=1), facing.argmax(axis=1), -1)
    rig = load_rig("default", light="parallel")
    required = make_requirements(
        mesh, rig, target="dominant", region_coverage=floor, **wishes
    )
    limits = replace(
        required.projector, max_incidence=np.radians(50.0), min_tangent_angle=0.0
    )
    scene = make_scene(mesh, replace(required, projector=limits), region=region)
    template = make_projector(rig, uniform_radii(0.2, 0.0035), (0.14, -1.57))
    stage = plan_projectors(scene, (template,), 120)
    stage = prove_fewest(scene, stage, (template,), EFFORT)
    return scene, stage, widen_margins(scene, stage)


def lit_shares(scene, projectors, n_sides):
    samples = scene.target_samples(Draw(600, 77))
    lit = np.any(lit_stages(scene, projectors, samples) == LIT, axis=1)
    region = scene.region[samples.samples.faces]
    return [float(lit[region == side].mean()) for side in range(n_sides)]


@pytest.mark.parametrize(
    ("allowed", "least", "count"), [(5, 0, 2), (5, 3, 3), (2, 3, 2), (5, 9, 2)]
)
def test_projectors_beyond_the_fewest_stand_where_they_are_allowed(
    monkeypatch, allowed, least, count
):
    asked = {"max_projectors": allowed, "dominant_coverage": 0.8}
    # Two light four sides of six, three all of them.
    small = ((0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
    scene, stage, _ = planned((*BIG, *small), 0.0, **asked)
    monkeypatch.setattr(stages, "proved_projectors", lambda *_: stage)
    request = SimpleNamespace(prove=False, least_projectors=least)
    ready = SimpleNamespace(request=request, scene=scene, templates=())
    found = stages.bounded_projectors(ready, stage, Stopwatch())
    proof = found.certificate
    assert len(found.projectors) == proof.count == proof.needed.count == count
    # What was proved of the fewest stays.
    assert proof.needed.lower_bound == 2
    assert proof.status == ("optimal" if count == 2 else "feasible")


def test_a_floor_lights_a_small_region_with_as_many_projectors():
    sides = (*BIG, (0, 0, 1))
    asked = {"max_projectors": 5, "dominant_coverage": 0.8}
    scene, without, projectors = planned(sides, 0.0, **asked)
    # Frontal light has most margin for the four fifths that count.
    assert lit_shares(scene, projectors, 3) == [1.0, 1.0, 0.0]
    scene, stage, projectors = planned(sides, 0.5, **asked)
    assert lit_shares(scene, projectors, 3) == [1.0, 1.0, 1.0]
    for found in (without, stage):
        assert found.certificate.status == "optimal"
        assert found.certificate.count == found.certificate.needed.lower_bound == 2


def test_floors_that_the_fewest_happen_to_meet_change_nothing():
    asked = {"max_projectors": 5, "dominant_coverage": 0.8}
    _, without, free = planned(BIG, 0.0, **asked)
    _, stage, projectors = planned(BIG, 0.5, **asked)
    assert stage.certificate.count == without.certificate.count == 2
    for one, other in zip(free, projectors, strict=True):
        assert np.allclose(one.world_from_device, other.world_from_device)


def test_fresh_samples_confirm_the_total_and_every_floor():
    sides = (*BIG, (0, 0, 1))
    asked = {"max_projectors": 5, "dominant_coverage": 0.8}
    # Frontal light leaves the small side dark: enough of all, but a floor is missed.
    scene, stage, frontal = planned(sides, 0.0, **asked)
    candidates = stage.candidates.extended(frontal)
    chosen = np.arange(2) + len(stage.candidates.projectors)
    required = replace(scene.requirements, region_coverage=0.5)
    floored = replace(candidates, scene=replace(scene, requirements=required))
    assert confirms(candidates, candidates.of(chosen), 5)
    assert not confirms(floored, candidates.of(chosen), 5)
    assert not confirms(candidates, candidates.of(chosen[:1]), 5)


def test_a_floor_costs_a_projector_and_both_bounds_say_so():
    sides = (*BIG, (0, 0, 1), (0, 1, 0), (0, 0, -1))
    asked = {"max_projectors": 5, "dominant_coverage": 0.75}
    _, without, _ = planned(sides, 0.0, **asked)
    assert without.certificate.needed.count == 2
    scene, stage, projectors = planned(sides, 0.5, **asked)
    proof = stage.certificate
    assert proof.status == "optimal"
    assert proof.count == proof.candidates.lower_bound == 3
    assert proof.continuous.lower_bound == 3
    # Two light the total: of them no more is said than what they may light.
    two = next(row for row in proof.by_count if row.count == 2)
    assert two.upper_bound_m2 >= proof.required_m2
    assert proof.one_fewer.upper_bound_m2 >= two.value_m2
    assert lit_shares(scene, projectors, 5) == [1.0] * 5


def test_where_too_few_are_allowed_as_many_floors_as_can_be_are_met():
    sides = (*BIG, (0, 0, 1), (0, 1, 0), (0, 0, -1))
    asked = {"max_projectors": 2, "dominant_coverage": 0.75}
    scene, stage, projectors = planned(sides, 0.5, **asked)
    assert stage.certificate.status == "infeasible"
    assert (stage.certificate.count, stage.certificate.needed.count) == (2, 3)
    assert sorted(lit_shares(scene, projectors, 5)) == [0.0, 1.0, 1.0, 1.0, 1.0]
