"""Where few samples are lit, more are drawn before cameras are first chosen.

A projector in parallel light, at 30 degrees at most, lights (1 - cos 30) / 2 of a ball:
a fifteenth.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.factories import (
    make_camera,
    make_projector,
    make_requirements,
    make_scene,
)
from support.little_work import draw_fewer

from geometry.shapes.primitives import sphere
from planning.cameras import camera_cover
from planning.cameras.camera_cover import (
    camera_candidate_views,
    first_samples,
    plan_cameras,
)
from planning.projectors.candidate_set import CandidateSource
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import DRAWS
from planning.scene.measuring.measured import lit_samples


@pytest.fixture
def lit_ball(monkeypatch):
    """A scene, and one projector."""
    draw_fewer(monkeypatch, cameras=300, fresh_cameras=900)
    mesh, rig = sphere(0.06), load_rig("default", light="parallel")
    required = make_requirements(mesh, rig, target="surface", max_projectors=1)
    limits = replace(
        required.projector, max_incidence=np.radians(30.0), min_tangent_angle=0.0
    )
    scene = make_scene(mesh, replace(required, projector=limits))
    template = make_projector(rig, uniform_radii(0.2, 0.0035), (0.14, -1.57))
    return scene, CandidateSource(scene, (template,)).lattice(1)[:1], rig


@pytest.mark.parametrize(("least", "joined"), [(10, 0), (40, 1), (100, 2), (9999, 3)])
def test_draws_join_until_enough_is_lit(monkeypatch, lit_ball, least, joined):
    scene, projectors, _ = lit_ball
    monkeypatch.setattr(camera_cover, "_LEAST_LIT", least)
    target, stream = first_samples(scene, projectors)
    assert stream == 1 + joined
    assert len(target) == 300 + 900 * joined
    draws = [DRAWS.cameras, *(DRAWS.fresh_cameras.later(k) for k in (1, 2, 3))]
    points = [scene.target_samples(draw).samples.points for draw in draws]
    ends = np.cumsum([0, *map(len, points)])
    for (begin, end), own in zip(pairwise(ends[: joined + 2]), points, strict=False):
        assert np.array_equal(target.samples.points[begin:end], own)
    lit = len(lit_samples(scene, projectors, target).target)
    assert lit == pytest.approx(len(target) * (1 - np.cos(np.pi / 6)) / 2, rel=0.3)
    assert (lit >= least) == (joined < 3)


def test_a_cover_is_confirmed_by_none_of_the_draws_that_joined(monkeypatch, lit_ball):
    scene, projectors, rig = lit_ball
    monkeypatch.setattr(camera_cover, "_LEAST_LIT", 100)
    confirming, judged = [], camera_cover.denial

    def denial(*given):
        confirming.append(given[-1].samples.points)
        return judged(*given)

    monkeypatch.setattr(camera_cover, "denial", denial)
    views = camera_candidate_views(scene, (make_camera(rig),), 60)
    cover = plan_cameras(scene, projectors, views)
    first, _ = first_samples(scene, projectors)
    assert len(cover.samples.target) >= 100
    assert confirming
    known = set(map(bytes, first.samples.points))
    for points in confirming:
        assert known.isdisjoint(map(bytes, points))
