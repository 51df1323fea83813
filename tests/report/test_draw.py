"""The picture of a rig: what it shows stands where the plan says."""

import hashlib
import time

import numpy as np
import pytest
from PIL import Image
from support.bare_plan import bare_plan
from support.reconstruction_rigs import MESH_TABLE

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at, transform
from geometry.rays.rays import RayCaster
from geometry.shapes.sample_head.geodesic import geodesic_grid
from geometry.shapes.sample_head.sample_head import sample_head
from planning.model.plan import RigPlan
from planning.model.surface import Surface
from planning.report.drawing.face_colours import region_colours
from planning.report.drawing.figures import (
    ZONES,
    best_direction,
    device_figures,
    zone_figures,
)
from planning.report.drawing.panel import Panel, round_length
from planning.report.drawing.picture_view import (
    BACKGROUND,
    CLAY,
    PictureView,
    facing,
    fitted,
    save_picture,
)
from planning.report.drawing.rig_picture import draw_rig, draw_zones
from planning.report.drawing.shader import Shader

K_PROJECTOR = [[2100.0, 0, 639.5], [0, 2100.0, 399.5], [0, 0, 1]]
K_CAMERA = [[3500.0, 0, 1223.5], [0, 3500.0, 1023.5], [0, 0, 1]]


def surface_of(mesh):
    n = len(mesh.faces)
    front = mesh.face_normals @ [0.0, -1.0, 0.1] > 0.4
    region = np.where(front, np.where(mesh.face_centroids[:, 2] > -0.01, 0, 1), -1)
    empty = np.zeros((0, 4, 4))
    return Surface(
        mesh, np.zeros(n, int), region, np.zeros((n, 3)), empty, empty, empty
    )


def requirements(mesh, up=(0.0, 0.0, 1.0)):
    return {
        "max_projectors": 3,
        "max_cameras": None,
        "coverage": 0.95,
        "dominant_coverage": 0.9,
        "min_reachable": 0.9,
        "target": "dominant",
        "pattern": "rings",
        "projector": {"max_incidence": 1.05, "min_tangent_angle": 0.7},
        "camera": {"max_incidence": 1.22, "max_sample_distance_m": None},
        "triangulation": {"min_conditioning": 0.1, "noise_px": 0.1},
        "check": {
            "max_rms_m": 1e-4,
            "max_p95_m": 3e-4,
            "max_bias_m": 3e-5,
            "tau_m": 2e-3,
            "min_completeness": 0.9,
            "max_predicted_missing": 0.01,
        },
        "workspace": {
            "centre": mesh.centre.tolist(),
            "object_radius_m": mesh.radius,
            "up": list(up),
            "axis": list(up),
            "half_angle": np.pi,
            "projector_radius_m": [1.0, 1.3],
            "camera_radius_m": [1.0, 1.3],
            "floor_m": None,
            "n_reference_projectors": 0,
            "n_reference_cameras": 0,
            "reference_ring_radius": 0.2,
        },
    }


def direction(azimuth, elevation):
    """Degrees; azimuth 0 is in front of the face (-y), 90 on the subject's left."""
    a, e = np.deg2rad([azimuth, elevation])
    return np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])


def projector(mesh, name, azimuth, elevation, light):
    position = mesh.centre + 1.15 * direction(azimuth, elevation)
    pose = look_at(position, mesh.centre, np.array([0.0, 0.0, 1.0])).tolist()
    return {
        "id": name,
        "light": light,
        "world_from_device": pose,
        "world_from_ring": pose,
        "K": K_PROJECTOR if light == "diverging" else None,
        "resolution": [1280, 800],
        "pixel_pitch_m": None if light == "diverging" else 3.2e-4,
        "range_m": [0.8, 1.5],
        "ring_radii": [0.05, 0.12],
        "beam_radius": None,
    }


def camera(mesh, name, azimuth, elevation):
    position = mesh.centre + 1.1 * direction(azimuth, elevation)
    pose = look_at(position, mesh.centre, np.array([0.0, 0.0, 1.0]))
    return {
        "id": name,
        "world_from_device": pose.tolist(),
        "K": K_CAMERA,
        "distortion": [0.0] * 5,
        "resolution": [2448, 2048],
        "range_m": [0.8, 1.5],
    }


def plan_of(mesh, projectors, cameras, up=(0.0, 0.0, 1.0)):
    areas = {
        "area_m2": 0.06,
        "reachable_by_projectors_m2": 0.06,
        "lit_m2": 0.055,
        "reachable_by_cameras_m2": 0.055,
        "measured_m2": 0.05,
    }
    coverage = {"samples": 0, "surface": areas, "target": areas}
    causes = {"uncovered_by_cause": {}, "unreachable_by_cause": {}}
    return bare_plan(
        requirements(mesh, up),
        projectors,
        cameras,
        surface_of(mesh),
        meshes=[MESH_TABLE | {"path": "some/face.obj"}],
        coverage=coverage | causes,
    )


@pytest.fixture(scope="module")
def mesh():
    return sample_head(n_faces=8_000)


@pytest.fixture(scope="module")
def plan(mesh):
    projectors = [
        projector(mesh, "P1", -30, 10, "diverging"),
        projector(mesh, "P2", 40, 25, "parallel"),
    ]
    cameras = [
        camera(mesh, "C1", -60, 15),
        camera(mesh, "C2", 5, 40),
        camera(mesh, "C3", 70, -10),
    ]
    return plan_of(mesh, projectors, cameras)


def status_of(plan):
    surface = plan.surface
    status = np.where(surface.in_dominant, 1, 0).astype(np.int8)
    z = surface.mesh.face_centroids[:, 2]
    status[surface.in_dominant & (z < -0.08)] = 2
    status[surface.in_dominant & (z < -0.10)] = 3
    return status


def sphere(radius=0.1, centre=(0.0, 0.0, 0.0), frequency=24):
    grid = geodesic_grid(frequency)
    return TriangleMesh(radius * grid.directions + np.array(centre), grid.faces)


def pixels(image):
    return np.asarray(image.convert("RGB")).astype(int)


def like(image, colour, tolerance=40):
    """Pixels near a colour, as rows and columns."""
    rows, columns = np.nonzero(
        np.abs(pixels(image) - np.array(colour)).max(axis=2) <= tolerance
    )
    return rows, columns


ORANGE, BLUE = (200, 80, 0), (0, 90, 160)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0), (-1, 0, 0), (1.0, 2.0, 3.0)])
@pytest.mark.parametrize("towards", [(1, -2, 0.5), (0, 0, 1), (0, 1, 0), (-1, 0, 0)])
def test_views_are_right_handed_and_upright(up, towards):
    right, upward = facing(towards, up)
    back = np.cross(right, upward)
    assert back == pytest.approx(np.array(towards) / np.linalg.norm(towards))
    assert [right @ right, upward @ upward, right @ upward] == pytest.approx([1, 1, 0])
    assert upward @ np.array(up) >= -1e-12
    assert right @ np.array(up) == pytest.approx(0.0, abs=1e-12) or abs(
        np.dot(up, towards)
    ) == pytest.approx(np.linalg.norm(up) * np.linalg.norm(towards))


def test_seen_from_above_is_a_map():
    right, upward = facing((0, 0, 1), (0, 0, 1))
    assert right == pytest.approx([1, 0, 0])
    assert upward == pytest.approx([0, 1, 0])


@pytest.mark.parametrize("bad", [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0)])
def test_directions_without_length_are_refused(bad):
    with pytest.raises(ValueError, match="direction must have a length"):
        facing(bad, (0, 0, 1))
    with pytest.raises(ValueError, match="up must have a length"):
        facing((0, 0, 1), bad)


def test_a_fitted_view_holds_every_point_and_is_tight():
    points = np.random.default_rng(3).normal(size=(200, 3)) * [1.0, 0.2, 3.0] + 7.0
    view = fitted(points, (1, 2, 0.5), (0, 0, 1), (400, 300), margin_px=20)
    drawn = view.project(points)
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    assert np.all(low >= 20 - 1e-6)
    assert np.all(high <= np.array([380, 280]) + 1e-6)
    assert np.any(np.isclose(low, 20) & np.isclose(high, [380, 280]))
    # One pixel spans the same length in both directions.
    step = view.project(view.focus + 0.5 * view.up) - view.project(view.focus)
    assert step == pytest.approx([0.0, -0.5 / view.m_per_px])


def test_captions_above_and_below_have_a_margin_of_their_own():
    tall = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 1.0], [0.1, 0.3, 0.4]])
    view = fitted(tall, (1, 0, 0), (0, 0, 1), (400, 300), margin_px=(20, 60))
    pixels = view.project(tall)
    assert np.ptp(pixels[:, 1]) == pytest.approx(300 - 2 * 60)
    assert pixels[:, 1].min() == pytest.approx(60)
    assert pixels[:, 0].min() >= 20


def test_a_sphere_is_a_disc_of_its_own_size():
    ball = sphere(0.1, (3.0, -2.0, 5.0))
    view = PictureView(ball.centre, *facing((1, -1, 1), (0, 0, 1)), (240, 200), 0.001)
    shader = Shader(RayCaster(ball), np.full((len(ball.faces), 3), 200.0))
    seen = np.any(pixels(shader.shade(view)) < 250, axis=2)
    assert seen.sum() == pytest.approx(np.pi * 100**2, rel=0.01)
    rows, columns = np.nonzero(seen)
    assert [columns.mean() + 0.5, rows.mean() + 0.5] == pytest.approx(
        [120, 100], abs=0.3
    )


def shaded(mesh, direction, px, colours=CLAY):
    """Pixels of a mesh seen from a direction, in one colour or one for each face."""
    points = mesh.corners.reshape(-1, 3)
    view = fitted(points, direction, (0, 0, 1), (2 * px, 2 * px), margin_px=0.1 * px)
    colours = np.broadcast_to(np.array(colours, float), (len(mesh.faces), 3))
    return pixels(Shader(RayCaster(mesh), colours).shade(view).reduce(2))


def test_faces_show_their_colours_where_they_are():
    ball = sphere()
    colours = np.zeros((len(ball.faces), 3))
    colours[ball.face_centroids[:, 0] > 0] = (255, 0, 0)
    colours[ball.face_centroids[:, 0] <= 0] = (0, 0, 255)
    seen = shaded(ball, (0, -1, 0), 200, colours)
    # Seen from the front (-y), +x is on the right.
    assert seen[100, 150, 0] > 100 > seen[100, 150, 2]
    assert seen[100, 50, 2] > 100 > seen[100, 50, 0]
    assert seen[2, 2].tolist() == [255, 255, 255]
    above = shaded(ball, (0, -1, 0), 200)
    assert above[40, 100].sum() > above[170, 130].sum(), "light comes from above"


def test_flat_faces_keep_their_creases():
    corners = (
        np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.1
    )
    quads = [
        (0, 1, 3, 2),
        (4, 6, 7, 5),
        (0, 4, 5, 1),
        (2, 3, 7, 6),
        (0, 2, 6, 4),
        (1, 5, 7, 3),
    ]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    cube = TriangleMesh(corners, np.array(faces))
    seen = shaded(cube, (-0.3, -1, 0.2), 300)
    # Three flat faces: three shades, and hardly a pixel in between.
    _, counts = np.unique(seen.reshape(-1, 3), axis=0, return_counts=True)
    assert np.sort(counts)[-4:].sum() > 0.98 * 300 * 300


def test_a_coarse_sphere_is_shaded_like_a_fine_one():
    coarse, fine = (
        shaded(sphere(frequency=n), (-0.5, -0.8, 0.3), 200) for n in (10, 60)
    )
    rows, columns = np.indices(coarse.shape[:2])
    inside = np.hypot(rows - 99.5, columns - 99.5) < 80
    assert np.abs(coarse - fine)[inside].max() <= 5


def test_lines_behind_the_object_are_faint():
    ball = sphere()
    view = PictureView(np.zeros(3), *facing((0, -1, 0), (0, 0, 1)), (200, 200), 0.002)
    ink = {}
    for y in (-0.5, 0.5):
        panel = Panel(Image.new("RGB", (200, 200), "white"), view, RayCaster(ball))
        line = np.array([[-0.19, y, 0.0], [0.19, y, 0.0]])
        panel.polyline(line, (0, 0, 0), width=2)
        ink[y] = 255 - pixels(panel.image)[100, :, 0]
    assert np.all(ink[-0.5][10:190] > 200), "in front: all of it"
    assert np.all(ink[0.5][60:140] < 80), "behind: faint"
    assert np.all(ink[0.5][60:140] > 10), "behind, yet there"
    assert np.all(ink[0.5][10:45] > 200)


def test_a_diverging_beam_ends_at_the_corners_of_the_image(mesh, plan):
    figures = device_figures(plan, body_m=0.1)
    assert [f.device.id for f in figures] == ["P1", "P2", "C1", "C2", "C3"]
    for device, figure in zip((*plan.projectors, *plan.cameras), figures, strict=True):
        if device.id == "P2":
            continue
        inverse = np.linalg.inv(device.world_from_device)
        assert figure.beam[0][1] == pytest.approx(mesh.centre, abs=1e-9)
        assert len(figure.beam) == (6 if device.id == "P1" else 1)
        for outline in (figure.body[0], *figure.beam[5:]):
            drawn = device.device.project(transform(inverse, outline))
            width, height = np.array(device.device.resolution) - 0.5
            expected = [[-0.5, -0.5], [width, -0.5], [width, height], [-0.5, height]]
            assert drawn[:4] == pytest.approx(np.array(expected), abs=1e-6)
        for end in figure.beam[5:]:
            depth = transform(inverse, end)[:, 2]
            assert depth == pytest.approx(transform(inverse, mesh.centre[None])[0, 2])


def test_a_parallel_beam_is_as_wide_as_its_rings_all_along(plan):
    device = plan.projectors[1]
    figure = device_figures(plan, body_m=0.1)[1]
    inverse = np.linalg.inv(device.world_from_device)
    panel = transform(inverse, figure.body[0])
    half = 0.5 * 3.2e-4 * np.array([1280, 800])
    assert np.abs(panel[:, :2]) == pytest.approx(np.tile(half, (5, 1)))
    for line in (transform(inverse, line) for line in figure.beam[1:]):
        radius = np.hypot(line[:, 0], line[:, 1])
        assert radius == pytest.approx(np.full(len(line), 0.12))
    for edge in (transform(inverse, line) for line in figure.beam[1:5]):
        assert edge[1] - edge[0] == pytest.approx([0.0, 0.0, 1.15], abs=1e-9)


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)])
def test_the_best_direction_looks_down_and_parts_the_devices(up):
    up = np.array(up)
    right, ahead = facing(up, up)
    row = np.array([(0.2 * k - 0.4) * right - 1.0 * ahead for k in range(5)])
    back = best_direction(row, np.zeros(3), up)
    assert np.linalg.norm(back) == pytest.approx(1.0)
    assert np.sin(np.deg2rad(19)) < back @ up < np.sin(np.deg2rad(41))
    assert back @ -ahead > 0, "from the side that the devices stand on"
    flat = row - (row @ back)[:, None] * back
    gaps = np.linalg.norm(flat[1:] - flat[:-1], axis=1)
    assert gaps.min() > 0.1


def test_labels_find_room_of_their_own():
    view = PictureView(np.zeros(3), *facing((0, -1, 0), (0, 0, 1)), (800, 800), 0.001)
    panel = Panel(Image.new("RGB", (800, 800), "white"), view)
    for k in range(8):
        panel.label(np.array([0.004 * k, 0, 0]), f"C{k} 1100 mm", (0, 0, 0), size=12)
    boxes = panel.taken
    assert len(boxes) == 8
    for i, a in enumerate(boxes):
        assert 0 <= a[0] < a[2] <= 800
        assert 0 <= a[1] < a[3] <= 800
        for b in boxes[:i]:
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


@pytest.mark.parametrize(
    ("room", "length"),
    [(1.0, 1), (1.99, 1), (2, 2), (4.9, 2), (5, 5), (99, 50), (0.07, 0.05)],
)
def test_scale_bars_have_round_lengths(room, length):
    assert round_length(room) == pytest.approx(length)


def test_a_scale_bar_is_as_long_as_it_says():
    view = PictureView(np.zeros(3), *facing((0, -1, 0), (0, 0, 1)), (800, 600), 0.0007)
    panel = Panel(Image.new("RGB", (800, 600), "white"), view)
    panel.scale_bar(size=14)
    rows, columns = np.nonzero(pixels(panel.image)[:, :, 0] < 128)
    row = np.argmax(np.bincount(rows))
    span = np.ptp(columns[rows == row]) * view.m_per_px
    assert span == pytest.approx(0.100, abs=0.004)
    assert 0.5 * 0.28 * 800 * 0.0007 < span < 0.28 * 800 * 0.0007


@pytest.mark.parametrize(
    ("towards", "up", "rightwards", "upwards"),
    [
        ((0, 0, 1), (0, 0, 1), (196, 50, 40), (52, 128, 60)),
        ((0, -1, 0), (0, 0, 1), (196, 50, 40), (40, 80, 190)),
        ((0, 1, 0), (0, 1, 0), (40, 80, 190), (196, 50, 40)),
    ],
)
def test_axes_point_where_the_file_has_them(towards, up, rightwards, upwards):
    view = PictureView(np.zeros(3), *facing(towards, up), (400, 400), 0.001)
    panel = Panel(Image.new("RGB", (400, 400), "white"), view)
    panel.axes(size=15)
    all_rows, all_columns = np.nonzero(pixels(panel.image).min(axis=2) < 200)
    rows, columns = like(panel.image, rightwards, 10)
    assert np.ptp(columns) > 2 * np.ptp(rows)
    assert columns.max() >= all_columns.max() - 2
    rows, columns = like(panel.image, upwards, 10)
    assert np.ptp(rows) > 2 * np.ptp(columns)
    assert rows.min() <= all_rows.min() + 2


def test_the_picture_has_its_size_and_shows_both_kinds_of_device(plan):
    picture = draw_rig(plan, size=(1000, 640), face_status=status_of(plan))
    assert picture.size == (1000, 640)
    assert len(like(picture, ORANGE)[0]) > 200
    assert len(like(picture, BLUE)[0]) > 200


def test_a_mesh_whose_name_has_two_lines_is_told_in_one(plan):
    """Pillow measures no text of several lines."""
    record = plan.document.own_mesh.changed(path="two\nlines.obj")
    named = RigPlan(plan.document.changed(meshes=(record,)), plan.surface)
    picture = draw_rig(named, size=(1000, 640), face_status=status_of(named))
    assert len(like(picture, ORANGE)[0]) > 200


def test_devices_stand_on_the_right_sides_of_the_map(mesh):
    # In the map (upper right panel) +x is right and +y up: the projector stands at -x,
    # the camera at -y.
    one = plan_of(
        mesh,
        [projector(mesh, "P1", -90, 0, "diverging")],
        [camera(mesh, "C1", 0, 0)],
    )
    grey = np.full(len(mesh.faces), 0, dtype=np.int8)
    picture = draw_rig(one, size=(1600, 1000), face_status=grey)
    panel = picture.crop((920, 100, 1600, 530))
    clay = pixels(panel)
    warm = (clay[:, :, 0] - clay[:, :, 2] > 4) & (clay[:, :, 0] - clay[:, :, 2] < 24)
    object_row, object_column = (v.mean() for v in np.nonzero(warm))
    rows, columns = like(panel, ORANGE, 15)
    assert np.median(columns) < object_column - 100
    assert abs(np.median(rows) - object_row) < 40
    rows, columns = like(panel, BLUE, 15)
    assert np.median(rows) > object_row + 100
    assert abs(np.median(columns) - object_column) < 60


def test_status_is_loud_where_the_target_is_not_measured(plan):
    good = np.where(plan.surface.in_dominant, 1, 0).astype(np.int8)
    missed = status_of(plan)
    loud = []
    for status in (good, missed):
        seen = pixels(draw_rig(plan, size=(1000, 640), face_status=status))
        red, green, blue = np.moveaxis(seen, 2, 0)
        loud.append(np.count_nonzero((red - green > 60) & (blue - green > 40)))
    assert loud[0] == 0
    assert loud[1] > 300


def test_regions_have_colours_of_their_own():
    colours = region_colours(np.array([-1, 0, 1, 7, 8]))
    assert len(np.unique(colours[:4], axis=0)) == 4
    assert np.array_equal(colours[1], colours[4])


def test_the_file_is_the_same_every_time(tmp_path, plan):
    status = status_of(plan)
    for name in ("a.png", "b.png"):
        picture = draw_rig(plan, size=(900, 560), face_status=status)
        save_picture(picture, tmp_path / name)
    first, second = ((tmp_path / name).read_bytes() for name in ("a.png", "b.png"))
    assert hashlib.sha256(first).digest() == hashlib.sha256(second).digest()
    assert b"tIME" not in first
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (900, 560)
    assert len(list(tmp_path.iterdir())) == 2


def test_other_ups_and_device_counts_are_drawn(mesh):
    turned = TriangleMesh(mesh.vertices[:, [1, 2, 0]], mesh.faces)
    alone = plan_of(turned, [], [camera(turned, "C1", 20, 5)], up=(0.0, 1.0, 0.0))
    assert draw_rig(alone, size=(800, 500), face_status=status_of(alone)).size == (
        800,
        500,
    )
    # Devices that surround the object evenly stand on no side.
    around = plan_of(
        mesh,
        [
            projector(mesh, "P1", 0, 0, "parallel"),
            projector(mesh, "P2", 180, 0, "parallel"),
        ],
        [camera(mesh, "C1", 90, 0), camera(mesh, "C2", -90, 0)],
    )
    assert draw_rig(around, size=(800, 500), face_status=status_of(around)).size == (
        800,
        500,
    )


def test_what_cannot_be_drawn_is_refused(plan):
    n = len(plan.surface.mesh.faces)
    with pytest.raises(ValueError, match="at least 800 x 500"):
        draw_rig(plan, size=(300, 200), face_status=status_of(plan))
    with pytest.raises(ValueError, match="face_status must be"):
        draw_rig(plan, face_status=np.zeros(n - 1, dtype=np.int8))
    with pytest.raises(ValueError, match="must hold 0 to 3"):
        draw_rig(plan, face_status=np.full(n, 4, dtype=np.int8))


@pytest.mark.long
def test_a_large_mesh_is_drawn_in_seconds(plan):
    large = sample_head(n_faces=40_000)
    begin = time.process_time()
    document = plan.to_document()
    fine = plan_of(large, document["projectors"], document["cameras"])
    draw_rig(fine, face_status=status_of(fine))
    assert time.process_time() - begin < 4.0, "about 0.5 s on an idle core"


def zone(name, centre, half, degrees=0.0):
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    axes = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
    return {"name": name, "centre_m": centre, "half_m": half, "axes": axes}


def zoned(plan, **zones):
    required = plan.to_document()["requirements"]
    space = required["workspace"] | zones
    document = plan.to_document() | {"requirements": required | {"workspace": space}}
    return RigPlan.from_document(document, plan.surface)


PRESS = zone("press", [0.7, -0.2, 0.1], [0.3, 0.1, 0.2], 30.0)
CEILING = zone("ceiling", [0.0, 0.0, 0.9], [0.8, 0.5, 0.005])


def test_zones_are_boxes_about_the_centre_of_the_object(plan):
    ceiling, press = zone_figures(zoned(plan, keep_out=[PRESS], mounting=[CEILING]))
    assert [ceiling.kind, press.kind] == ["mounting plane", "keep out"]
    corners = np.unique(press.edges.reshape(-1, 3).round(12), axis=0)
    offset = corners - plan.surface.mesh.centre - PRESS["centre_m"]
    along = np.abs(offset @ np.array(PRESS["axes"]).T)
    assert along == pytest.approx(np.tile(PRESS["half_m"], (8, 1)))
    assert len(corners) == 8
    lengths = np.linalg.norm(np.diff(press.edges, axis=1)[:, 0], axis=1)
    sides = np.repeat(2.0 * np.array(PRESS["half_m"]), 4)
    assert np.sort(lengths) == pytest.approx(np.sort(sides))


def test_a_zone_is_drawn_along_its_edges_and_nowhere_else(plan):
    (press,) = zone_figures(zoned(plan, keep_out=[PRESS]))
    middle = press.edges.mean(axis=(0, 1))
    view = PictureView(middle, np.eye(3)[0], np.eye(3)[1], (400, 400), 2.5e-3)
    panel = Panel(
        Image.new("RGB", view.size, BACKGROUND), view, RayCaster(plan.surface.mesh)
    )
    draw_zones(panel, [press])
    drawn = pixels(panel.image)
    rows, columns = np.nonzero(drawn.sum(axis=2) < 3 * 255)
    local = (np.stack([columns, rows], axis=1) + 0.5 - 200.0) * 2.5e-3 * [1, -1]
    along = np.abs(local @ np.array(PRESS["axes"])[:2, :2].T)
    # Two pixels of line stick out on either side.
    beyond = along - np.array(PRESS["half_m"][:2])
    assert np.all(beyond <= 5e-3)
    assert np.all(beyond.max(axis=1) >= -5e-3)
    assert len(rows) * 2.5e-3 / 2 == pytest.approx(2 * (0.6 + 0.2), rel=0.3)
    line = drawn[rows, columns].min(axis=0)
    assert line[0] > line[1] + 40


def test_a_slab_seen_edge_on_is_a_line(plan):
    (ceiling,) = zone_figures(zoned(plan, mounting=[CEILING]))
    middle = ceiling.edges.mean(axis=(0, 1))
    view = PictureView(middle, np.eye(3)[0], np.eye(3)[2], (400, 400), 0.1)
    panel = Panel(
        Image.new("RGB", view.size, BACKGROUND), view, RayCaster(plan.surface.mesh)
    )
    draw_zones(panel, [ceiling])
    rows, _ = np.nonzero(pixels(panel.image).sum(axis=2) < 3 * 255)
    assert 0 < np.ptp(rows) + 1 <= 4


def test_the_picture_holds_the_zones_and_names_them(plan):
    small = (800, 500)
    room = zone("box", [0.0, 0.0, 0.0], [1.0, 1.0, 1.0])
    status = status_of(plan)
    crowded = zoned(plan, box=room, keep_out=[PRESS])
    picture = draw_rig(crowded, size=small, face_status=status)
    plain = draw_rig(plan, size=small, face_status=status)
    # In the legend, below the object: there is no such colour without zones.
    for kind, count in (("room", 1), ("keep out", 1), ("mounting plane", 0)):
        rows, columns = like(picture, ZONES[kind], tolerance=0)
        assert (np.count_nonzero((columns > 456) & (rows > 400)) > 50) == count
        assert len(like(plain, ZONES[kind], tolerance=0)[0]) == 0


def test_a_device_that_stands_already_is_framed_and_named(plan):
    first, *rest = plan.to_document()["cameras"]
    old = [first | {"existing": True, "name": "old camera"}, *rest]
    known = RigPlan.from_document(plan.to_document() | {"cameras": old}, plan.surface)
    assert [f.device.existing for f in device_figures(known, body_m=0.1)] == [
        "",
        "",
        "old camera",
        "",
        "",
    ]
    status = status_of(plan)
    pictures = [draw_rig(shown, face_status=status) for shown in (plan, known)]
    blue = [len(like(picture, BLUE, tolerance=30)[0]) for picture in pictures]
    # Two square frames of 16 px a side and 2 px wide, and the letters of the name.
    assert blue[1] - blue[0] > 2 * 4 * 14 * 2
