"""What one mounts by: the housing's angles, and places in the axes of the mesh."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from geometry.devices import PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import box
from planning.cli.main import commands
from planning.model.devices.bodies import Obstacle
from planning.report.page.device_tables import device_tables
from planning.report.summary.brief import brief
from planning.report.summary.devices.device_lines import device_lines
from planning.report.summary.devices.zone_lines import zone_lines
from planning.verify.audit.devices.camera_figures import camera_figures

CENTRE = np.array([0.3, -0.02, 0.5])


@pytest.fixture(scope="module")
def plan(handmade):
    return handmade.build_plan()


def moved(plan, handmade, **space):
    """A plan whose object's centre isn't the origin of the mesh."""

    def change(document):
        document["requirements"]["workspace"] |= {"centre": CENTRE.tolist(), **space}

    return handmade.tampered(plan, change)


def test_the_housing_is_turned_otherwise_than_the_image_where_the_lens_is_shifted(
    plan, handmade
):
    """By the angle between optical axis and middle ray, here tilted upwards."""

    def shift(document):
        document["projectors"][0]["K"] = [[1500.0, 0, 511.5], [0, 1500, 980], [0, 0, 1]]
        document["projectors"][0]["resolution"] = [1024, 768]

    lines = device_lines(handmade.tampered(plan, shift))
    numbers = next(line for line in lines if line.startswith("P1")).split()[1:]
    x, y, z, pan, tilt, roll, azimuth, elevation, standoff = map(float, numbers)
    at = np.array([0.42, 0.0, 0.9])
    at *= 1e3 / np.linalg.norm(at)
    assert [x, y, z] == pytest.approx(at, abs=0.05)
    # Up is +y: pan counts from +z towards +x.
    assert pan == pytest.approx(np.degrees(np.arctan2(-at[0], -at[2])), abs=0.05)
    assert (azimuth, tilt, roll) == (pan, 0.0, 0.0)
    shifted = np.degrees(np.arctan((980 - 383.5) / 1500))
    assert elevation == pytest.approx(shifted, abs=0.05)
    assert standoff == pytest.approx(1000.0)


def test_places_have_the_same_digits_wherever_they_are_printed(plan, handmade):
    """Halves of a tenth too, and nothing is at -0.0."""

    def stand(document):
        pose = document["projectors"][0]["world_from_device"]
        for row, at in zip(pose, (0.80135, -0.00001, -0.80145), strict=False):
            row[3] = at

    stood = handmade.tampered(plan, stand)
    rows = [*device_lines(stood), *brief(stood, [], []).splitlines()]
    places = [row.split()[1:4] for row in rows if row.startswith("P1")]
    (row,) = re.findall("P1</th>(.*?)</tr>", next(iter(device_tables(stood))))
    places.append(re.findall(">([^<>]+)</td>", row)[:3])
    assert places == [["801.4", "0.0", "-801.5"]] * 3


def test_the_table_says_where_the_centre_of_the_object_is(plan, handmade):
    text = "\n".join(device_lines(moved(plan, handmade)))
    assert "the object's centre is at 300.0, -20.0, 500.0 mm" in text
    assert "pan and azimuth count about +y from +z" in text


def zone(name, centre, half, axes=None):
    turn = np.eye(3) if axes is None else axes
    return {
        "name": name,
        "centre_m": list(centre),
        "half_m": list(half),
        "axes": np.asarray(turn).tolist(),
    }


def test_zones_are_told_in_the_axes_of_the_mesh(plan, handmade):
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    # Rows are the directions of the sides.
    turn = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
    down = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
    text = "\n".join(
        zone_lines(
            moved(
                plan,
                handmade,
                floor_m=-0.25,
                box=zone("box", (0.1, 0, 0), (0.5, 0.5, 0.5)),
                keep_out=[zone("robot", (0.9, 0, 0.3), (0.4, 0.3, 0.6), turn)],
                mounting=[zone("ceiling", (0, 0, 1.0), (1, 0.75, 0.005), down)],
            )
        )
    )
    assert "centre 300.0, -20.0, 500.0" in text
    # Up is +y.
    assert "floor: y >= -270.0" in text
    assert "room: x -100.0 to 900.0, y -520.0 to 480.0, z 0.0 to 1000.0" in text
    assert (
        "'robot': 800 x 600 x 1200 about 1200.0, -20.0, 800.0, turned 0, 0, 30 degrees"
    ) in text
    assert "only ground" in text
    assert (
        "'ceiling': centre 300.0, -20.0, 1500.0, normal (0, 0, -1); 2000 along "
        "(1, 0, 0), 1500 across, 10 thick"
    ) in text


def test_a_floor_under_an_up_that_points_down_is_an_upper_end(plan, handmade):
    text = "\n".join(
        zone_lines(moved(plan, handmade, up=[0.0, -1.0, 0.0], floor_m=-0.25))
    )
    assert "floor: y <= 230.0" in text


def test_obstacles_are_told_by_their_extent(plan):
    clamp = box((0.2, 0.1, 0.4))
    placed = TriangleMesh(clamp.vertices + [1.0, 2.0, 3.0], clamp.faces)
    surface = replace(plan.surface, obstacles=(Obstacle("clamp", placed),))
    text = "\n".join(zone_lines(replace(plan, surface=surface)))
    expected = "'clamp': x 900.0 to 1100.0, y 1950.0 to 2050.0, z 2800.0 to 3200.0"
    assert expected in text


def test_what_a_camera_sees_of_a_sphere_is_as_in_closed_form(plan, handmade):
    def widen(document):
        for camera in document["cameras"]:
            camera["K"] = [[2500.0, 0, 319.5], [0, 2500, 239.5], [0, 0, 1]]
            camera["distortion"] = [0.0] * 5
        limits = document["requirements"]["triangulation"]
        limits |= {"max_sigma_m": None, "min_ring_pitch_px": None}

    # All of the sphere is in the image.
    plan, radius = handmade.tampered(plan, widen), handmade.RADIUS_M
    figures = camera_figures(plan, threads=1)
    assert [camera.id for camera in figures] == ["C1", "C2"]
    for seen, camera in zip(figures, plan.cameras, strict=True):
        position = camera.world_from_device[:3, 3]
        away, model = np.linalg.norm(position), camera.device
        assert isinstance(model, PinholeModel)
        # A cone about the axis cuts the image plane in a circle.
        rim = model.focal_px * np.tan(np.arcsin(radius / away))
        width, height = model.resolution
        assert seen.filled == pytest.approx(np.pi * rim**2 / (width * height), rel=0.01)
        assert seen.sharp_m == model.range_m
        low, middle, high = seen.distance_m
        assert away - radius - 1e-4 <= low < middle < high <= away
        # It looks at the sphere's middle, so depth and distance hardly differ.
        assert seen.pixel_m == pytest.approx(middle / model.focal_px, rel=2e-3)
        for projector in plan.projectors:
            light = projector.world_from_device[:3, 3]
            apart = np.arccos(light @ position / away / np.linalg.norm(light))
            least, _, largest = seen.triangulation[projector.id]
            # Nearer than the middle both are seen apart by more.
            assert apart - 1e-6 < least < largest < 1.15 * apart


def test_plan_show_prints_places_devices_and_cameras(plan, handmade, tmp_path):
    path = handmade.save(plan, tmp_path)
    shown = CliRunner().invoke(commands, ["show", str(path)])
    assert shown.exit_code == 0, shown.output
    for words in ("OBJECT ", "housing's pan", "C2 ", "mm per pixel", "of the image"):
        assert words in shown.stdout
    answer = CliRunner().invoke(commands, ["show", str(path), "--json"])
    cameras = json.loads(answer.stdout)["cameras"]
    assert [camera["id"] for camera in cameras] == ["C1", "C2"]
    assert set(cameras[0]["triangulation"]) == {"P1", "P2"}
