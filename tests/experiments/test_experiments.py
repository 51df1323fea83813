"""Section VII of the paper: what is set up, what is measured, how far it errs."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.paper_equations import (
    coordinate_transform,
    projected,
    projection_matrix,
)
from support.plain_shapes import box, grid, joined
from support.reconstruction_rigs import single

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.experiments.ground_truth import (
    Errors,
    judged_labels,
    prior_mesh,
    true_labels,
)
from planning.experiments.paper_devices import (
    CAMERA_PX,
    PRINTED,
    bearing,
    placed_camera,
    placed_projector,
)
from planning.experiments.paper_figures import (
    camera_images,
    draw_errors,
    draw_redundancy,
    draw_viewpoints,
)
from planning.experiments.point_panels import RINGS, PanelStage, signed_colours
from planning.experiments.ring_outcomes import lit_and_seen, ring_outcomes
from planning.experiments.run import (
    DARK,
    Outcome,
    double_density,
    run_experiment,
)
from planning.experiments.setups import (
    FACE_RADII_M,
    box_experiment,
    face_experiment,
)
from planning.experiments.table import outcome_document, outcome_lines
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.check.accuracy import measure_accuracy
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.triangulate import intersect_rings
from planning.verify.reconstruction.density.second_sequence import second_sequence
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.render.render import render_lines
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.reconstruction.single_shot.single_shot import (
    drawn_lines,
    shoot_rig,
)

# Edges just soft enough for images to be sampled once a pixel, which is quicker.
SOFT = replace(DARK, projector_blur_m=0.3e-3)
CLEAN = replace(SOFT, noisy=False, albedo_variation=0.0)


@pytest.fixture(scope="module")
def of_box() -> Outcome:
    return run_experiment(box_experiment(variant="fits"), photometry=SOFT, threads=1)


@pytest.fixture(scope="module")
def of_face() -> Outcome:
    return run_experiment(face_experiment(variant="fits"), photometry=SOFT, threads=1)


@pytest.mark.parametrize("make", [box_experiment, face_experiment])
@pytest.mark.parametrize("variant", ["printed", "fits"])
def test_devices_stand_as_the_paper_says(make, variant):
    experiment = make(variant=variant)
    plan = experiment.scanner
    assert len(plan.projectors) == len(plan.cameras) == 2
    middle = 0.5 * (np.array(CAMERA_PX) - 1.0)
    aimed = plan.projectors[0]
    target = aimed.centre + aimed.axis
    for camera in plan.cameras:
        assert camera.resolution == (1280, 720)
        np.testing.assert_allclose(camera.project(target[None]), middle[None])
        assert np.linalg.norm(camera.centre - target) == pytest.approx(1.0)
        # +y of the image points down.
        above = camera.project((target + [0.0, 0.0, 1e-3])[None])[0]
        assert above[1] < middle[1] - 1.0
        assert abs(above[0] - middle[0]) < 0.1 * (middle[1] - above[1])
    for projector in plan.projectors:
        assert projector.resolution == (1024, 768)
        np.testing.assert_allclose(
            projector.centre + projector.axis, target, atol=1e-12
        )
    # The target is on the object, or a few millimetres before it.
    rays = np.array([[0.0, 1.0, 0.0]])
    _, away = RayCaster(experiment.mesh).first_hits(target[None] - rays, rays)
    assert abs(away[0] - 1.0) < 0.02


def test_what_the_paper_prints_is_kept():
    face, boxed = face_experiment(), box_experiment()
    np.testing.assert_allclose(face.radii_m, np.array([1, 2, 4]) * 25.4e-3)
    assert len(boxed.radii_m) == 7
    matrix = face.scanner.cameras[0].matrix
    np.testing.assert_array_equal(matrix, [[8e3, 0, 174], [0, 8e3, 68], [0, 0, 1]])
    np.testing.assert_allclose(face.optics.field_m, [0.160, 0.090])
    assert face.light == "parallel"
    diverging = face_experiment(light="diverging")
    tangents = diverging.scanner.projectors[0].pattern.radii
    np.testing.assert_allclose(tangents * 1.0, FACE_RADII_M)


def test_the_box_is_measured_to_three_hundredths_of_a_millimetre(of_box):
    errors = of_box.union.errors
    assert errors.rms_m < 0.03e-3
    assert abs(errors.bias_m) < 0.003e-3
    assert errors.outliers == 0.0
    parts = [one.errors.rms_m for one in of_box.clouds[:4]]
    assert of_box.merged.errors.rms_m < 0.6 * min(parts)
    assert of_box.merged.complete[1] == of_box.union.complete[1]
    assert of_box.merged.complete[0] > of_box.union.complete[0] - 1e-3
    by_name = {one.name: one for one in of_box.clouds}
    assert list(by_name) == [
        "P1 with C1",
        "C1, all projectors",
        "C2, all projectors",
        "all points",
        "merged",
    ]
    shares = [one.complete[0] for one in of_box.clouds[:4]]
    assert shares[0] < min(shares[1:3])
    assert max(shares[1:3]) < shares[3] == max(shares)
    assert 0.05 < of_box.reconstruction.redundant_fraction < 0.5
    kept = of_box.union.cloud.take(of_box.reconstruction.merged.stays).points
    # Points that stay were moved along their light by what noise had done.
    moved = np.linalg.norm(kept - of_box.merged.cloud.points, axis=1)
    assert 0.0 < np.sqrt(np.mean(moved**2)) < 2.0 * errors.rms_m
    # Both sides of the box's edge, up to the outermost ring of either projector.
    assert by_name["all points"].complete[1] > 0.99


def test_points_project_back_onto_their_edges_by_eq_3(of_box):
    """x = M y, M = M_in M_ex; M is 3 x 4, so that depth comes from the ring alone."""
    cloud = of_box.union.cloud
    for c, camera in enumerate(of_box.experiment.scanner.cameras):
        matrix = projection_matrix(camera)
        assert matrix.shape == (3, 4)
        own = cloud.take(cloud.camera == c)
        np.testing.assert_allclose(projected(matrix, own.points), own.pixels, atol=1e-6)
        # Every point of the ray has this image: without the ring M has no inverse.
        farther = own.points + 0.05 * own.rays
        np.testing.assert_allclose(projected(matrix, farther), own.pixels, atol=1e-6)


def test_eq_4_is_the_coaxial_case_of_eq_3():
    """z = f R / sqrt(u^2 + v^2), its right side (f R / z)^2 = u^2 + v^2 completed."""
    target, straight = np.zeros(3), bearing(0.0, 0.0)
    projector = placed_projector("P1", "parallel", straight, target, FACE_RADII_M)
    camera = placed_camera("C1", PRINTED, straight, target)
    camera = replace(camera, world_from_device=projector.world_from_device)
    turn = np.linspace(0.0, 6.0, 50)
    radii = np.resize(FACE_RADII_M, 50)
    depth = np.linspace(0.8, 1.2, 50)
    local = np.column_stack([radii * np.cos(turn), radii * np.sin(turn), depth])
    pose = camera.world_from_device
    pixels = projected(projection_matrix(camera), local @ pose[:3, :3].T + pose[:3, 3])
    offset = pixels - camera.matrix[:2, 2]
    np.testing.assert_allclose(np.sum(offset**2, axis=1), (8e3 * radii / depth) ** 2)
    roots = np.ones(50, dtype=np.int8)
    rays = camera.rays(pixels)
    hits = intersect_rings(camera.centre, rays, radii, roots, projector)
    found = (hits.points - pose[:3, 3]) @ pose[:3, 2]
    np.testing.assert_allclose(found, 8e3 * radii / np.linalg.norm(offset, axis=1))


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_points_of_the_second_projector_come_into_the_frame_of_the_first_by_eq_6(light):
    """Y2 = J y2, each projector's points triangulated in its own ring frame."""
    experiment = box_experiment(variant="fits", light=light)
    cloud = reconstruct(
        single(experiment, projector=1), seed=0, photometry=SOFT
    ).everything
    first, second = experiment.scanner.projectors
    y2 = second.to_ring(cloud.points)
    radii = experiment.scanner.projectors[1].pattern.radii[cloud.ring]
    across = np.hypot(y2[:, 0], y2[:, 1])
    on_ring = across / y2[:, 2] if light == "diverging" else across
    np.testing.assert_allclose(on_ring, radii, atol=1e-9)
    j = coordinate_transform(first, second)
    moved = y2 @ j[:3, :3].T + j[:3, 3]
    np.testing.assert_allclose(moved, first.to_ring(cloud.points), atol=1e-12)
    assert np.abs(moved - y2).max() > 0.05


def of_devices(mesh: TriangleMesh, projectors: list, cameras: list) -> Scanner:
    """Other devices about another object."""
    n = len(mesh.faces)
    return replace(
        box_experiment().scanner,
        projectors=tuple(projectors),
        cameras=tuple(cameras),
        mesh=mesh,
        region=np.zeros(n, dtype=np.int64),
        target=np.ones(n, dtype=bool),
    )


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_outcomes_of_rings_on_a_plate_are_the_arcs_that_fit(light):
    """Panel 0.230 m high, image 0.160 x 0.090 m, a plate square before both."""
    flat = grid(0.6, 0.6, divisions=(1, 1))
    # A quarter turn about x: the plate's normal comes to lie along -y.
    turned = flat.vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    plate = TriangleMesh(turned, flat.faces)
    np.testing.assert_allclose(plate.face_normals, [[0, -1, 0]] * 2, atol=1e-12)
    radii = np.array([0.02, 0.06, 0.13])
    straight, target = bearing(0.0, 0.0), np.zeros(3)
    plan = of_devices(
        plate,
        [placed_projector("P1", light, straight, target, radii)],
        [placed_camera("C1", PRINTED, straight, target)],
    )
    outcomes = ring_outcomes(plan, Cloud.empty())
    width, height = (0.3072, 0.2304) if light == "parallel" else (0.5, 0.375)
    for ring, radius in zip(outcomes, radii, strict=True):
        assert ring.on_object == pytest.approx(arc(radius, width, height), abs=2e-3)
        # The rest of the circle is in the panel's corners, outside the image.
        seen = arc(radius, *PRINTED.field_m) / ring.on_object
        # The lens looks past the plate, so that its image is no exact rectangle.
        assert ring.seen["C1"] == pytest.approx(seen, abs=0.03)
        assert ring.measured["C1"] == ring.measured_by_any == 0.0
    everywhere = ring_outcomes(plan, on_plate(radii))
    for ring in everywhere:
        assert ring.measured == ring.seen
        assert ring.measured_by_any == ring.seen["C1"]
    assert outcomes[0].seen["C1"] == 1.0
    assert 0.2 < outcomes[1].seen["C1"] < 0.8
    assert outcomes[2].seen["C1"] == 0.0
    if light == "parallel":
        assert outcomes[2].on_object < 0.8


def on_plate(radii: np.ndarray) -> Cloud:
    """Points all around circles on the plate, as if one camera had measured them."""
    turn, ring = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 2000), np.arange(len(radii)))
    turn, ring = turn.ravel(), ring.ravel()
    points = radii[ring, None] * np.column_stack(
        [np.cos(turn), np.zeros(len(turn)), np.sin(turn)]
    )
    n, one = len(points), np.zeros(len(points))
    index = np.zeros(n, dtype=np.int16)
    return Cloud(
        points, points, points, points[:, :2], index, index,
        ring.astype(np.int16), one, points, one, one, one,
    )  # fmt: skip


def arc(radius: float, width: float, height: float) -> float:
    """Share of a circle inside a rectangle about its centre."""
    turn = np.linspace(0.0, 2.0 * np.pi, 100_001)
    x, y = np.abs(radius * np.cos(turn)), np.abs(radius * np.sin(turn))
    return float(np.mean((x < 0.5 * width) & (y < 0.5 * height)))


def test_of_a_box_the_front_is_lit_and_seen_and_the_back_is_not(of_box):
    plan = of_box.experiment.scanner
    # Left and right of the front edge; behind; on top, which no projector lights.
    inner = np.array([[-0.02, -0.0649, 0.0], [0.02, -0.0649, 0.0], [0.0, 0.08, 0.0]])
    points = np.vstack([inner, [0.0, 0.0, 0.06]])
    normals = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 1]])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    expected = [True, True, False, False]
    assert lit_and_seen(plan, points, normals).tolist() == expected
    # Something small in the light of both projectors, in no camera's view.
    blocks = [plan.mesh]
    for planned in plan.projectors:
        middle = points[0] - 0.3 * planned.world_from_device[:3, 2]
        small = box((0.02, 0.02, 0.02))
        blocks.append(TriangleMesh(small.vertices + middle, small.faces))
    shaded = of_devices(joined(*blocks), list(plan.projectors), list(plan.cameras))
    expected[0] = False
    assert lit_and_seen(shaded, points, normals).tolist() == expected


def test_rings_that_are_measured_were_seen_and_landed(of_face):
    for ring in of_face.outcomes:
        assert 0.4 < ring.on_object <= 1.0
        for name, measured in ring.measured.items():
            assert measured <= ring.seen[name]
        assert ring.measured_by_any >= max(ring.measured.values())
        assert ring.measured_by_any > 0.6
    # The ring of 4 inches is wider than the head: a false projection.
    assert [ring.on_object < 0.6 for ring in of_face.outcomes] == [
        False,
        False,
        True,
    ] * 2


def test_few_rings_make_false_edges_where_one_surface_hides_another(of_face, of_box):
    """Beyond a step of depth the next annulus is often the next number too."""
    errors = of_face.union.errors
    assert 0.005 < errors.outliers < 0.04
    cloud = of_face.union.cloud
    middle = of_face.union.distances[cloud.ring == 1]
    assert Errors.of(middle).rms_m < 0.03e-3
    assert errors.rest_m < errors.rms_m
    assert of_box.union.errors.outliers == 0.0


def test_as_printed_the_image_holds_a_fraction_of_the_rings(of_face):
    printed = face_experiment()
    outcomes = ring_outcomes(printed.scanner, Cloud.empty())
    outer = [ring for ring in outcomes if ring.ring == 2]
    assert all(max(ring.seen.values()) < 0.05 for ring in outer)
    inner = [ring for ring in outcomes if ring.ring == 0]
    assert all(min(ring.seen.values()) > 0.7 for ring in inner)
    fitting = [ring for ring in of_face.outcomes if ring.ring == 2]
    assert all(max(ring.seen.values()) > 0.7 for ring in fitting)


def test_errors_are_summarised_by_hand():
    found = Errors.of(np.array([0.003, -0.0004, 0.0003, 0.0003]))
    assert found.n == 4
    assert found.rms_m == pytest.approx(np.sqrt((9 + 0.16 + 0.09 + 0.09) / 4) * 1e-3)
    assert found.bias_m == pytest.approx(0.0008)
    assert found.outliers == 0.25
    assert found.rest_m == pytest.approx(np.sqrt((0.16 + 0.09 + 0.09) / 3) * 1e-3)
    assert Errors.of(np.zeros(0)) == Errors(0)


@pytest.mark.long
def test_a_second_sequence_doubles_the_density(of_box):
    """Between flat rings there is one each; the edge bends most about the centre."""
    shifted = second_sequence(of_box.experiment.scanner, of_box.union.cloud)
    for before, after in zip(
        of_box.experiment.scanner.projectors, shifted.projectors, strict=True
    ):
        wanted = before.pattern.radii - 0.006
        wanted[0] = 0.004
        np.testing.assert_allclose(after.pattern.radii, wanted)
    first, both = of_box.union, double_density(of_box, shifted, threads=1)
    assert 1.8 < len(both.cloud) / len(first.cloud) < 2.2
    assert first.complete[0] < 0.92
    assert both.complete[0] > 0.98
    assert both.errors.rms_m < 1.1 * first.errors.rms_m
    # Rings are numbered outwards through both sequences.
    ring = shifted.projectors[0]
    own = both.cloud.take(both.cloud.projector == 0)
    radius = np.hypot(*ring.to_ring(own.points)[:, :2].T)
    every = 0.006 * np.arange(1, 15)
    every[0] = 0.004
    np.testing.assert_allclose(radius, every[own.ring], atol=1e-9)


@pytest.mark.long
def test_distortion_and_ambient_light_are_switches(of_box):
    """A lens that is known costs nothing, one that isn't costs accuracy."""
    bent = box_experiment(variant="fits", distortion=-0.2)
    known = reconstruct(single(bent), seed=0, photometry=SOFT)
    assert known.accuracy.rms_m < 0.025e-3
    straight = single(box_experiment(variant="fits"))
    unknown = reconstruct(straight, seed=0, photometry=SOFT, truth=single(bent))
    assert unknown.accuracy.rms_m > 0.1e-3
    bright = replace(SOFT, ambient=1.0)
    lit = reconstruct(straight, seed=0, photometry=bright).accuracy.rms_m
    dark = of_box.clouds[0].errors.rms_m
    assert 1.3 * dark < lit < 5.0 * dark


@pytest.mark.long
def test_single_images_are_labelled_by_a_prior_that_is_roughly_right(of_face):
    experiment = of_face.experiment
    prior = prior_mesh(experiment.mesh, 6e-3)
    moved = prior.vertices - experiment.mesh.vertices
    np.testing.assert_allclose(moved, [[0.0, 5e-3, 0.0]] * len(moved), atol=1e-12)
    plan = single(experiment)
    shots = shoot_rig(plan, prior, tolerance_m=6e-3, photometry=SOFT, seed=0)
    labels = judged_labels(plan, shots)
    assert labels.n == sum(
        (
            labels.right,
            labels.wrong,
            labels.stray,
            labels.off_prior,
            labels.ambiguous,
        )
    )
    assert labels.right > 0.95 * labels.n
    # The object is within the tolerance; what is wrong is the line, at its ends.
    assert labels.wrong <= 0.001 * labels.n
    assert labels.stray < 0.01 * labels.n
    (shot,) = shots
    assert len(shot.decoded.cloud) == pytest.approx(
        len(of_face.clouds[0].cloud), rel=0.15
    )
    far = measure_accuracy(shot.decoded.cloud, experiment.mesh).distances
    # Lines aren't edges: fewer steps of depth look like one.
    assert Errors.of(far).outliers < 0.6 * of_face.clouds[0].errors.outliers


@pytest.mark.long
def test_an_experiment_of_single_images_says_so():
    experiment = box_experiment(variant="fits")
    shot = run_experiment(experiment, photometry=SOFT, tolerance_m=2e-3)
    assert shot.labels is not None
    assert shot.labels.right > 0.85 * shot.labels.n
    assert "labels by the prior mesh" in outcome_lines(shot)[-1]
    assert outcome_document(shot)["labels"]["right"] == shot.labels.right
    assert shot.union.errors.rms_m < 0.1e-3


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_truth_of_labels_is_that_of_the_coded_sequence(of_box, light):
    """Edges that were decoded from a sequence lie on their rings, with their roots."""
    plan = single(box_experiment(variant="fits", light=light))
    # Nearly blind points too: there the cone's tilt decides the sign of r.m.
    plan = replace(plan, limits=replace(plan.limits, min_conditioning=0.02))
    cloud = reconstruct(plan, seed=0, photometry=SOFT).everything
    pair = PairCalibration(plan.projectors[0], plan.cameras[0])
    caster = RayCaster(of_box.experiment.mesh)
    ring, root = true_labels(cloud.pixels, pair, caster, 1e-3)
    assert np.abs(cloud.conditioning).min() < 0.03
    np.testing.assert_array_equal(ring, cloud.ring)
    assert np.mean(root == np.sign(cloud.conditioning)) > 0.999
    beside = np.column_stack([cloud.pixels[:, 0] + 15.0, cloud.pixels[:, 1]])
    off, _ = true_labels(beside, pair, caster, 1e-3)
    assert np.mean(off == -1) > 0.7


def test_lines_are_a_millimetre_wide_at_the_object_or_narrow_beside_their_gaps():
    for light, away in (("parallel", 1.0), ("diverging", 1.0), ("diverging", 2.5)):
        plan = box_experiment(light=light).scanner
        source, mesh = plan.projectors[0], plan.mesh
        pose = source.world_from_device
        move = pose[:3, 3] + away * pose[:3, 2] - mesh.centre
        moved = TriangleMesh(mesh.vertices + move, mesh.faces)
        patterns = source.pattern_for(plan.cameras[0])
        width, lines = drawn_lines(source, patterns, moved)
        assert width * (away if light == "diverging" else 1.0) == pytest.approx(1e-3)
        np.testing.assert_allclose(np.diff(lines.radii)[::2], width)
        fine = replace(patterns, radii=np.array([0.001, 0.002, 0.0025]))
        assert drawn_lines(source, fine, moved)[0] <= 0.4 * 0.5e-3 + 1e-12


def test_light_of_both_projectors_adds_up_in_one_image():
    experiment = box_experiment(variant="fits")
    caster = RayCaster(experiment.mesh, threads=1)
    camera = experiment.scanner.cameras[0]
    seen = view(camera, experiment.mesh, caster, CLEAN)
    shown = []
    for projector in experiment.scanner.projectors:
        lines = projector.pattern_for(camera).lines(1e-3)
        shown.append(Shown(projector, projector, lines, caster))
    both, one, other = (
        render_lines(seen, some, CLEAN, (0,)).stack[0].ravel().astype(float)
        for some in (shown, shown[:1], shown[1:])
    )
    parts = np.column_stack([one, other])
    gains, *_ = np.linalg.lstsq(parts, both, rcond=None)
    assert np.abs(parts @ gains - both).max() < 1e-3 * both.max()
    assert gains.min() > 0.2
    # Rings of both cross: brighter than either alone.
    assert both.max() > 1.2 * (parts * gains).max()


def test_camera_images_show_bright_rings_where_edges_were_measured(of_box):
    images = camera_images(of_box.experiment, SOFT)
    assert [image.shape for image in images] == [(720, 1280)] * 2
    cloud = of_box.union.cloud
    for c, image in enumerate(images):
        u, v = np.rint(cloud.pixels[cloud.camera == c]).astype(int).T
        assert np.median(image[v, u]) > 60
        assert np.mean(image > 30) < 0.1


def test_figures_are_drawn_and_show_what_stays(of_box):
    stage = PanelStage(of_box.experiment.mesh, (200, 150))
    for draw, size in (
        (draw_viewpoints, (600, 210)),
        (draw_redundancy, (400, 210)),
        (draw_errors, (400, 226)),
    ):
        picture = draw(of_box, stage)
        assert isinstance(picture, Image.Image)
        assert picture.size == size
        assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 50


def test_points_behind_the_object_are_not_drawn():
    stage = PanelStage(box((0.1, 0.1, 0.1)), (100, 100))
    red = np.array([[255.0, 0.0, 0.0]])
    front, back = (
        np.asarray(stage.panel("x", np.array([[0.0, y, 0.0]]), red)).astype(int)
        for y in (-0.05, 0.05)
    )

    def drawn(picture: np.ndarray) -> int:
        return int(np.count_nonzero(picture[..., 0] - picture[..., 1] > 60))

    assert drawn(front) >= 4
    assert drawn(back) == 0


def test_colours_of_signed_errors_saturate_and_tell_the_sides_apart():
    low, inside, zero, outside, high = signed_colours(
        np.array([-9.0, -1.0, 0.0, 1.0, 9.0]), 1.0
    )
    np.testing.assert_array_equal(low, inside)
    np.testing.assert_array_equal(high, outside)
    assert inside[2] > inside[0]
    assert outside[0] > outside[2]
    assert zero.min() > 200
    assert len(set(RINGS)) == 7


def test_tables_and_documents_say_the_same(of_face):
    document = json.loads(json.dumps(outcome_document(of_face), allow_nan=False))
    text = "\n".join(outcome_lines(of_face))
    assert "f = 2800 px, centre (639.5, 359.5)" in text
    assert "3 circles: 25.4, 50.8, 101.6 mm" in text
    assert [cloud["name"] for cloud in document["clouds"]][-1] == "merged"
    for cloud in document["clouds"]:
        errors = cloud["errors"]
        row = next(line for line in text.splitlines() if line.startswith(cloud["name"]))
        assert f"{errors['n']:d}" in row
        assert f"{1e3 * errors['rms_m']:.3f}" in row
    assert len(document["rings"]) == 6
    assert document["rings"][0]["errors"]["n"] + document["rings"][3]["errors"][
        "n"
    ] == int(np.sum(of_face.union.cloud.ring == 0))
