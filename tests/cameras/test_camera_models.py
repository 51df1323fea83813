"""Cameras of two models on a ball: which are taken, and what a stock leaves."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_camera, make_requirements, make_scene
from support.little_work import draw_fewer

from geometry.devices import PinholeModel
from geometry.shapes.primitives import sphere
from planning.cameras.camera_cover import camera_candidate_views, candidate_cover
from planning.cameras.camera_routes import better_route, cover_by_cover
from planning.cameras.proved_cameras import camera_stage
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import Stock
from planning.projectors.projector_stage import plan_projectors
from planning.proofs.device_stock import within_stock
from planning.proofs.marginals import marginals
from planning.proofs.selection import select_fewest
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.lights import ring_frame
from planning.scene.workspace.model_candidates import one_of_each


@pytest.fixture(scope="module")
def ball():
    mesh, rig = sphere(0.1, subdivisions=4), load_rig("default")
    required = make_requirements(mesh, rig, max_projectors=6, dominant_coverage=0.6)
    scene, eye = make_scene(mesh, required), np.eye(4)
    lens, radii = rig.projector_device(), uniform_radii(0.3, 0.0035)
    ring = ring_frame(eye, lens, rig.ring_offset, -np.pi / 2)
    template = PlannedProjector("", rig.light, eye, ring, lens, radii)
    with pytest.MonkeyPatch.context() as patch:
        draw_fewer(patch, cameras=800, fresh_cameras=1500)
        stage = plan_projectors(scene, (template,), 120, rounds=1)
        wide = replace(make_camera(rig), model="wide")
        matrix = np.diag([2.6, 2.6, 1.0]) @ wide.device.camera_matrix
        matrix[:2, 2] = wide.device.camera_matrix[:2, 2]
        lens = PinholeModel(matrix, wide.device.resolution, wide.device.range_m)
        narrow = replace(wide, device=lens, model="narrow")
        yield scene, stage.projectors, (wide, narrow)


def chosen(ball, *stock: Stock):
    scene, projectors, cameras = ball
    required = replace(scene.requirements, stock=stock)
    scene = replace(scene, requirements=required)
    offered = camera_candidate_views(scene, cameras, 40)
    cover = cover_by_cover(scene, projectors, offered)
    return scene, projectors, cover


def taken(cover) -> dict[str, int]:
    models = [camera.model for camera in cover.cameras]
    return {model: models.count(model) for model in ("wide", "narrow")}


def test_each_model_offers_as_many_poses(ball):
    scene, _, cameras = ball
    offer = scene.candidates(cameras)
    found = offer.over(60)
    models = [camera.model for camera in found]
    assert models.count("wide") >= 30
    assert models.count("narrow") >= 30
    around = offer.around(found[:1], 60)
    assert {camera.model for camera in around} == {found[0].model}
    assert [one.model for one in one_of_each(found)] == ["wide", "narrow"]


def test_a_stock_binds_and_its_bound_holds(ball):
    _, _, free = chosen(ball)
    scene, projectors, cover = chosen(ball, Stock("camera", "wide", 1))
    assert taken(free)["wide"] > 2
    assert taken(cover)["wide"] <= 1
    assert len(cover.cameras) >= len(free.cameras)
    assert cover.selection.status != "infeasible"
    assert free.selection.lower_bound <= cover.selection.lower_bound
    proof = camera_stage(scene, cover).certificate
    assert proof.candidates.lower_bound <= proof.count == len(cover.cameras)
    counts = scene.requirements.stock_of("camera")
    for devices in camera_stage(scene, cover).by_count.values():
        assert within_stock(devices, counts)
    # The paper's route is of one model.
    _, routes, rival = better_route(scene, projectors, cover, "both")
    assert (routes.taken, routes.paper, rival) == ("cover", None, ())
    assert "one model" in routes.why


def test_a_stock_that_isnt_enough_is_taken_and_said(ball):
    _, _, free = chosen(ball)
    stock = (Stock("camera", "wide", 1), Stock("camera", "narrow", 1))
    scene, _, cover = chosen(ball, *stock)
    assert taken(cover) == {"wide": 1, "narrow": 1}
    assert cover.selection.status == "infeasible"
    assert cover.selection.needed == len(free.cameras)
    proof = camera_stage(scene, cover).certificate
    assert max(row.count for row in proof.by_count) == 2
    assert proof.greedy_count >= proof.needed.lower_bound


def test_of_a_stock_that_isnt_enough_nothing_idle_is_taken(ball):
    """Each that is taken measures what no other does; bounds rise with counts."""
    stock = (Stock("camera", "wide", 1), Stock("camera", "narrow", 2))
    scene, _, cover = chosen(ball, *stock)
    cameras = cover.candidates.cameras
    problem = candidate_cover(scene, cover.measured, cover.samples, cameras)
    problem = replace(problem, share=1.0)
    selection = select_fewest(problem)
    assert selection.status == "infeasible"
    for one in selection.chosen:
        others = selection.chosen[selection.chosen != one]
        assert problem.n_covered(others) < selection.n_covered
    found = sorted(marginals(problem, selection).n_covered.items())
    bounds = [bound for _, (_, bound) in found]
    assert bounds == sorted(bounds)
    assert all(covered <= bound for _, (covered, bound) in found)
