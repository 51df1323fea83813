"""A ball's rings: how many devices its caps take, the widest gap, claims and reach."""

import numpy as np
import pytest
from support.factories import make_camera, make_projector, make_requirements, make_scene

from geometry.shapes.primitives import sphere
from planning.cameras.camera_cover import camera_candidate_views, plan_cameras
from planning.cameras.proved_cameras import camera_stage
from planning.projectors.projector_stage import plan_projectors
from planning.report.advice.projector_relaxations import reachability_relaxations
from planning.report.claims.claims import make_claims
from planning.report.claims.judged import Devices
from planning.rig.rig import load_rig
from planning.rings.ring_pitch import widest_gap
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import Draw
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.samples import merged

RADIUS = 0.1


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def scene(request):
    ball = sphere(RADIUS, subdivisions=4)
    rig = load_rig("default", light=request.param)
    required = make_requirements(ball, rig, max_projectors=6, dominant_coverage=0.6)
    made = make_scene(ball, required)
    return rig, made


@pytest.fixture(scope="module")
def stages(scene):
    rig, made = scene
    parallel = rig.light == "parallel"
    tilt = rig.ring_offset
    radii = uniform_radii(tilt + 0.15 if parallel else 0.3, 0.0035)
    template = make_projector(rig, radii, (tilt, -np.pi / 2))
    projectors = plan_projectors(made, (template,), 200)
    camera = make_camera(rig)
    offered = camera_candidate_views(made, (camera,), 160)
    cover = plan_cameras(made, projectors.projectors, offered)
    cameras = camera_stage(made, cover)
    return made, projectors, cameras


@pytest.mark.long
def test_a_ball_needs_as_many_projectors_as_its_caps_do(stages):
    """Caps of 60 degrees (parallel) hold a quarter of the area: 0.6 takes 3 or more."""
    _, projectors, cameras = stages
    least = projectors.certificate.candidates.lower_bound
    assert 3 <= least <= len(projectors.projectors) <= 4
    assert len(cameras.cameras) >= 2


@pytest.mark.long
def test_widest_gap_is_that_of_the_farthest_lit_sample(stages):
    made, projectors, _ = stages
    target = made.target_samples(Draw(3000, 8))
    gap = widest_gap(made, projectors.projectors, target)
    radii = projectors.projectors[0].ring_radii
    step = radii[1] - radii[0]
    if projectors.projectors[0].light == "parallel":
        assert gap == pytest.approx(step)
    else:
        assert step * 1.0 < gap < step * 1.3


def test_claims_of_a_ball_follow_from_its_caps(stages):
    """Everything is reachable; a projector lights its cap as seen from where it is."""
    made, projectors, cameras = stages
    devices = Devices(
        projectors.projectors, cameras.cameras, projectors.reference, cameras.reference
    )
    claims = make_claims(made, devices)
    area = 4 * np.pi * RADIUS**2
    assert claims.coverage.target.area_m2 == pytest.approx(area, rel=5e-3)
    assert (
        claims.coverage.target.reachable_by_projectors_m2
        == claims.coverage.target.area_m2
    )
    theta = np.radians(60.0)
    for projector, lit in zip(devices.projectors, claims.lit_area_m2, strict=True):
        cap = theta
        if projector.light == "diverging":
            distance = np.linalg.norm(projector.world_from_device[:3, 3])
            cap = theta - np.arcsin(RADIUS / distance * np.sin(theta))
        assert lit / area == pytest.approx((1 - np.cos(cap)) / 2, abs=0.01)
    assert claims.coverage.unreachable_by_cause == {}
    assert sum(claims.sole_area_m2) <= claims.coverage.target.measured_m2 + 1e-12
    assert claims.coverage.target.measured_m2 <= sum(claims.seen_area_m2) + 1e-12


def test_no_relaxation_is_offered_where_nothing_is_out_of_reach(stages):
    made, projectors, _ = stages
    assert reachability_relaxations(made, projectors.reference[::20]) == ()


def test_merged_samples_stand_for_the_same_area(stages):
    made, projectors, _ = stages
    a, b = made.target_samples(Draw(500, 1)), made.target_samples(Draw(1500, 2))
    both = merged(a, b)
    assert len(both) == 2000
    assert both.samples.weight * 2000 == pytest.approx(a.samples.weight * 500)
    stages_of = lit_stages(made, projectors.projectors, both)
    assert stages_of.shape == (2000, len(projectors.projectors))
    assert lit_margins(made, projectors.projectors, both).shape == stages_of.shape
