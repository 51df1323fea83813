"""Cameras alone against every pair of them, looked at one by one."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from support.little_work import bound_roughly, draw_fewer
from support.plain_shapes import box
from support.view_rigs import alone_scene, cameras_about, some_samples

from geometry.shapes.primitives import sphere
from planning.cameras.photogrammetry.best_pairs import best_pairs
from planning.cameras.photogrammetry.measured_views import (
    measured_views,
    reached_by_views,
    unseen_causes,
)
from planning.cameras.photogrammetry.view_bound import bound_views
from planning.cameras.photogrammetry.view_stage import candidate_pairs, place_views
from planning.model.errors import InfeasibleLimitsError
from planning.proofs import camera_bound
from planning.scene.draws import DRAWS
from planning.scene.limits.view_pair_limits import VIEW_CAUSES
from planning.scene.measuring.camera_views import CandidateViews
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditCamera
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import SEEN, sight_steps
from planning.verify.audit.predicates.view_pairs import (
    GOOD,
    Sighted,
    pair_passes,
    view_terms,
)


@pytest.fixture(scope="module")
def scene():
    return alone_scene(sphere(0.1, subdivisions=3))


@pytest.fixture(scope="module")
def cameras():
    return cameras_about(9, 1.1, seed=3)


@pytest.fixture(scope="module")
def looked_at(scene, cameras):
    """Samples, who sees which (n_c, n), and which pairs measure (n_c, n_c, n)."""
    target = some_samples(scene, 300)
    drawn, n = target.samples, len(target)
    every = np.zeros(n, dtype=np.int64)
    samples = AuditSamples(
        *(drawn.points, drawn.normals, drawn.faces, np.zeros((n, 3))),
        *(every, every == 0, np.ones(n)),
    )
    shadow, limits = Shadow(scene.mesh, threads=1), scene.requirements
    eyes = [AuditCamera(c.device, c.world_from_device, ()) for c in cameras]
    seen = np.array(
        [sight_steps(eye, samples, limits.camera, shadow) == SEEN for eye in eyes]
    )
    good = np.zeros((len(eyes), len(eyes), n), dtype=bool)
    total = np.full(n, np.inf)
    for i, j in combinations(range(len(eyes)), 2):
        both = np.flatnonzero(seen[i] & seen[j])
        some = samples.take(both)
        views = [Sighted.of(eyes[k], some) for k in (i, j)]
        passes = pair_passes(*views, some.normals, limits.triangulation) == GOOD
        good[i, j, both] = good[j, i, both] = passes
        terms = view_terms(*views, some.normals, limits.triangulation)
        sigma = np.where(passes, np.sqrt(sum(t**2 for t in terms.values())), np.inf)
        total[both] = np.minimum(total[both], sigma)
    return target, seen, good, total


@pytest.mark.parametrize("views", [2, 3, 4])
def test_measured_are_samples_that_enough_see_and_a_pair_measures(
    scene, cameras, looked_at, views
):
    target, seen, good, _ = looked_at
    scene = replace(scene, requirements=replace(scene.requirements, min_views=views))
    enough = seen.sum(axis=0) >= views
    measured = good.any(axis=(0, 1)) & enough
    assert 0.1 < measured.mean() < 0.95
    found = measured_views(scene, cameras, target)
    np.testing.assert_array_equal(found.seen, seen.T)
    np.testing.assert_array_equal(found.measured, measured)
    np.testing.assert_array_equal(found.by_pair, (good.any(axis=0) & enough).T)
    for c in range(len(cameras)):
        rest = [k for k in range(len(cameras)) if k != c]
        left = good[np.ix_(rest, rest)].any(axis=(0, 1))
        left &= seen[rest].sum(axis=0) >= views
        np.testing.assert_array_equal(found.others[:, c], left)
    reached = reached_by_views(scene, cameras, target)
    np.testing.assert_array_equal(reached, measured)


def test_causes_are_of_the_camera_or_pair_that_came_furthest(scene, cameras, looked_at):
    target, seen, good, _ = looked_at
    few = slice(0, 4)
    cameras, seen, good = cameras[few], seen[few], good[few, few]
    found = measured_views(scene, cameras, target)
    names = np.array([*VIEW_CAUSES, ""])[unseen_causes(scene, cameras, target, found)]
    measured = good.any(axis=(0, 1)) & (seen.sum(axis=0) >= 2)
    assert set(names[measured]) == {""}
    dark = ~seen.any(axis=0)
    assert set(names[dark]) == {"camera_incidence"}
    once = seen.sum(axis=0) == 1
    assert set(names[once]) == {"few_views"}
    rest = ~measured & ~dark & ~once
    assert set(names[rest]) <= {"view_angle", "view_sigma"}
    assert "view_angle" in names[rest]


def test_the_best_pair_is_the_best_of_all(scene, cameras, looked_at):
    target, _, _, total = looked_at
    best = best_pairs(scene, cameras, target)
    np.testing.assert_allclose(best.sigma, total, rtol=1e-4)
    known = np.isfinite(total)
    root = np.sqrt(sum(term[known] ** 2 for term in best.terms.values()))
    np.testing.assert_allclose(root, total[known], rtol=1e-4)


def test_the_fewest_are_those_of_all_selections(monkeypatch):
    bound_roughly(monkeypatch)
    draw_fewer(monkeypatch, cameras=500)
    scene = alone_scene(
        box((0.12, 0.12, 0.02)), coverage=0.9, region_coverage=0.0, views=2
    )
    views = CandidateViews(scene, cameras_about(9, 1.1, seed=8))
    cover = candidate_pairs(scene, views, scene.target_samples(DRAWS.cameras))
    fewest = next(
        k
        for k in range(2, 10)
        if any(cover.enough(np.array(c)) for c in combinations(range(9), k))
    )
    # As if fresh samples agreed: what is aimed at above that is another test's.
    monkeypatch.setattr(
        "planning.cameras.photogrammetry.view_stage._lacking", lambda *_: 0.0
    )
    stage = place_views(scene, views)
    proof = stage.certificate
    assert len(stage.cameras) == fewest == proof.candidates.lower_bound
    assert proof.status == "optimal"
    assert cover.enough(np.array([views.cameras.index(c) for c in stage.cameras]))
    bounded = bound_views(scene, stage, [views.cameras[0].device], camera_bound.DEFAULT)
    anywhere = bounded.certificate.continuous
    assert 2 <= anywhere.lower_bound <= fewest
    assert anywhere.n_reached == int(cover.covered(np.arange(9)).sum())


def test_nothing_measured_names_the_limits():
    scene = alone_scene(sphere(0.1, subdivisions=2), accuracy_mm=1e-6)
    views = CandidateViews(scene, cameras_about(20, 1.1, seed=1))
    with pytest.raises(InfeasibleLimitsError, match="view_sigma 9"):
        place_views(scene, views)
