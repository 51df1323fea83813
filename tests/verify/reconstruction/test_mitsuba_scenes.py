import xml.etree.ElementTree as Xml
from dataclasses import replace

import numpy as np
import pytest
from support import reconstruction_rigs as rigs

from geometry.files.readers import load_mesh
from geometry.shapes.primitives import sphere
from planning.model.devices.bodies import Body
from planning.model.errors import InputError
from planning.verify.reconstruction.patterns.defocus import Defocus
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.render.mitsuba.materials import (
    MATERIAL_NAMES,
    Surface,
)
from planning.verify.reconstruction.render.mitsuba.path_traced import (
    MissingRendererError,
    mitsuba,
)
from planning.verify.reconstruction.render.mitsuba.physics import Physics
from planning.verify.reconstruction.render.mitsuba.scene_files import (
    pupil_points,
    write_object,
    write_scenes,
)
from planning.verify.reconstruction.render.mitsuba.scene_text import (
    SceneError,
    Shine,
    Window,
    scene_text,
)
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.scanner import Scanner

# Single precision: Mitsuba's rays are this exact [px].
EXACT_PX = 2e-3


def shifted(device, shift):
    """A device of which the principal point lies elsewhere."""
    matrix = device.matrix.copy()
    matrix[:2, 2] += shift
    return replace(device, matrix=matrix)


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def scanner(request):
    """Lens shifts of whole and broken pixels, two focal lengths, other lenses."""
    ball = sphere(0.05, subdivisions=3)
    rig = Scanner.of(rigs.small_rig(ball, request.param))
    shifts = [(0.3, -0.45), (101.0, 40.25), (-333.37, 200.11)]
    cameras = [shifted(one, by) for one, by in zip(rig.cameras, shifts, strict=True)]
    projectors = rig.projectors
    if request.param == "diverging":
        projectors = [shifted(rig.projectors[0], (3.3, 420.4)), rig.projectors[1]]
        stretched = projectors[1].matrix.copy()
        stretched[1, 1] *= 1.02
        projectors[1] = replace(projectors[1], matrix=stretched)
    return replace(
        rig,
        cameras=tuple(replace(one, focus=Defocus(1.1, 1e-3)) for one in cameras),
        projectors=tuple(projectors),
    )


def elements(scanner, p=0):
    windows = [Window.whole(camera) for camera in scanner.cameras]
    shine = Shine(scanner.projectors[p], "white.png")
    return Xml.fromstring(scene_text(scanner, shine, windows))


def numbers(element):
    kinds = ("float", "integer")
    found = {
        one.get("name"): float(one.get("value"))
        for one in element.iter()
        if one.tag in kinds and "$" not in one.get("value")
    }
    matrix = element.find("transform/matrix").get("value").split()
    return found, np.array(matrix, dtype=float).reshape(4, 4)


def mitsuba_rays(element, pixels):
    """Origin and directions of places of the window, as Mitsuba's manual has them.

    From the upper left corner of its first pixel; x is to the left and y up.
    """
    found, pose = numbers(element)
    film = np.array([found["width"], found["height"]])
    begin = np.array([found["crop_offset_x"], found["crop_offset_y"]])
    half = np.tan(np.radians(found["fov"]) / 2) * np.array([1.0, film[1] / film[0]])
    x, y = (half * (1.0 - 2.0 * (pixels + begin) / film)).T
    rays = np.column_stack([x, y, np.ones(len(x))]) @ pose[:3, :3].T
    return pose[:3, 3], rays / np.linalg.norm(rays, axis=1)[:, None]


def mitsuba_panel(element, points, resolution):
    """Where a projector's image lights points, in pixels from its upper left corner."""
    found, pose = numbers(element)
    x, y, z = np.linalg.solve(pose, np.c_[points, np.ones(len(points))].T)[:3]
    half = np.tan(np.radians(found["fov"]) / 2) * z
    width, height = resolution
    u, v = 0.5 * width * (1.0 - x / half), 0.5 * (height - width * y / half)
    return np.column_stack([u, v])


def test_a_camera_of_the_scene_looks_along_the_plan_s_rays(scanner):
    sensors = elements(scanner).findall("sensor")
    pixels = np.array([[0.0, 0.0], [100.0, 1200.0], [2047.0, 3.0], [1500.0, 700.0]])
    for sensor, camera in zip(sensors, scanner.cameras, strict=True):
        origin, rays = mitsuba_rays(sensor, pixels + 0.5)
        np.testing.assert_allclose(origin, camera.centre, atol=1e-12)
        np.testing.assert_allclose(rays, camera.rays(pixels), atol=1e-12)
        found, _ = numbers(sensor)
        assert (found["crop_width"], found["crop_height"]) == camera.resolution
        assert sensor.get("type") == "thinlens"
        assert found["focus_distance"] == 1.1
        assert found["aperture_radius"] == 0.5e-3


def test_a_projector_of_the_scene_lights_points_from_the_plan_s_pixels(scanner):
    points = np.random.default_rng(0).normal(size=(50, 3)) * 0.03
    for p, projector in enumerate(scanner.projectors):
        emitter = elements(scanner, p).find("emitter[@type='projector']")
        found = mitsuba_panel(emitter, points, projector.resolution)
        expected, _ = projector.panel(points)
        near = 2e-3 if projector.light.name == "parallel" else 1e-9
        np.testing.assert_allclose(found - 0.5, expected, atol=near)


def test_every_point_of_the_pupil_shows_the_same_at_the_distance_in_focus(scanner):
    if scanner.projectors[0].light.name == "parallel":
        pytest.skip("parallel light has no pupil")
    rig, projector = (
        replace(scanner, projector_focus=Defocus(1.2, 12e-3)),
        scanner.projectors[0],
    )
    pupil = pupil_points(rig)
    windows = [Window.whole(camera) for camera in rig.cameras]
    scene = Xml.fromstring(scene_text(rig, Shine(projector, "x.png", pupil), windows))
    emitters = scene.findall("emitter[@type='projector']")
    # Mitsuba 3.6 crashes where many refer to one image.
    assert all(e.find("texture[@type='bitmap']") is not None for e in emitters)
    flat = np.random.default_rng(0).uniform(-0.05, 0.05, (20, 2))
    pose = projector.world_from_device
    away = {}
    for depth in (1.2, 1.0):
        points = np.c_[flat, np.full(20, depth)] @ pose[:3, :3].T + pose[:3, 3]
        expected, _ = projector.panel(points)
        places = [
            mitsuba_panel(one, points, projector.resolution) - 0.5 - expected
            for one in emitters
        ]
        away[depth] = np.array(places)
    np.testing.assert_allclose(away[1.2], 0.0, atol=1e-9)
    # The blur of similar triangles, c / 4 in standard deviation, and no edge moves.
    blur = rig.projector_focus.blur_m(np.array(1.0)) * projector.matrix[0, 0]
    np.testing.assert_allclose(away[1.0].std(axis=0), blur, rtol=0.06)
    np.testing.assert_allclose(away[1.0].mean(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"distortion": (0.1, 0.0, 0.0, 0.0, 0.0)}, "C2: its lens distorts"),
        ({"matrix": np.diag([3000.0, 3100.0, 1.0])}, "3000 and 3100 px differ by 3.23"),
    ],
)
def test_lenses_that_mitsuba_lacks_are_refused(scanner, change, message):
    first, second, third = scanner.cameras
    rig = replace(scanner, cameras=(first, replace(second, **change), third))
    with pytest.raises(SceneError, match=message):
        elements(rig)


def test_more_light_than_falls_on_it_is_refused():
    with pytest.raises(InputError, match=r"give back 1\.08 of the light"):
        Surface(albedo=0.9, texture=0.2)


def test_housings_shade_but_not_their_own_device(scanner):
    body = Body((0.0, 0.0, -0.05), (0.03, 0.03, 0.07))
    devices = [replace(one, body=body) for one in scanner.projectors]
    camera = replace(scanner.cameras[0], body=body)
    rig = replace(scanner, projectors=tuple(devices), cameras=(camera,))
    scene = elements(rig)
    assert numbers(scene.find("sensor"))[0]["near_clip"] == pytest.approx(0.021)
    cubes = [numbers(cube)[1] for cube in scene.findall("shape[@type='cube']")]
    fronts = []
    for cube, device in zip(cubes, (*devices, camera), strict=True):
        local = np.linalg.inv(device.world_from_device) @ cube
        fronts.append(local[2, 3] + local[2, 2])
    np.testing.assert_allclose(fronts, [-1e-4, 0.02, 0.02])


@pytest.fixture(scope="module")
def small():
    """One projector of 640 x 400 pixels and two small cameras."""
    ball = sphere(0.05, subdivisions=4)
    projector = rigs.diverging("P1", rigs.direction(-15.0, 5.0), 0.06, 5e-3)
    projector["K"] = [[1120.0, 0.0, 319.5], [0.0, 1120.0, 199.5], [0.0, 0.0, 1.0]]
    projector["resolution"] = [640, 400]
    return Scanner.of(rigs.plan_of(ball, [projector], rigs.two_small_cameras()))


def test_an_export_holds_all_that_its_scene_names(small, tmp_path):
    (tmp_path / "README.txt").write_text("A rig of ringrig as scenes for Mitsuba 3 ...")
    (tmp_path / "P9.xml").write_text("of an older plan")
    scenes = write_scenes(small, tmp_path, Surface(albedo=0.4, texture=0.0))
    assert [scene.name for scene in scenes] == ["P1.xml"]
    assert sorted(tmp_path.glob("*.xml")) == scenes
    text = scenes[0].read_text()
    frame = Xml.fromstring(text).find("default[@name='frame']").get("value")
    assert (tmp_path / frame).is_file()
    for name in MATERIAL_NAMES:
        part = Xml.parse(tmp_path / "materials" / f"{name}.xml").getroot()
        assert (tmp_path / part.find("shape/string").get("value")).is_file()
    back = load_mesh(tmp_path / "object.ply", unit="m")
    np.testing.assert_allclose(back.area, small.mesh.area, rtol=1e-5)
    assert "focused" in (tmp_path / "README.txt").read_text()


def test_without_mitsuba_the_pip_command_is_told(monkeypatch):
    def absent(name):
        raise ImportError(f"No module named {name!r}")

    module = "planning.verify.reconstruction.render.mitsuba.path_traced"
    monkeypatch.setattr(f"{module}.import_module", absent)
    with pytest.raises(MissingRendererError, match=r"pip install 'ringrig\[render\]'"):
        mitsuba(1)


@pytest.fixture(scope="module")
def mi():
    pytest.importorskip("mitsuba", reason="Mitsuba isn't installed: ringrig[render]")
    return mitsuba(1)


def test_mitsuba_s_rays_are_the_plan_s(scanner, mi, tmp_path):
    write_object(scanner, tmp_path, Surface())
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200, 3)) * 0.03
    windows = [Window.whole(camera) for camera in scanner.cameras]
    for projector in scanner.projectors:
        width, height = projector.resolution
        white = mi.Bitmap(np.ones((height, width, 3), np.float32))
        white.write(str(tmp_path / "white.exr"))
        text = scene_text(scanner, Shine(projector, "white.exr"), windows)
        (tmp_path / "P.xml").write_text(text)
        scene = mi.load_file(str(tmp_path / "P.xml"))
        at = mi.SurfaceInteraction3f()
        at.p = mi.Point3f(points.T.astype(np.float32))
        towards, _ = scene.emitters()[0].sample_direction(at, mi.Point2f(0.5))
        found = np.array(towards.uv).T * projector.resolution - 0.5
        np.testing.assert_allclose(found, projector.panel(points)[0], atol=EXACT_PX)
        np.testing.assert_allclose(
            np.array(towards.d).T, -projector.aim(points)[1], atol=3e-6
        )
    for sensor, camera in zip(scene.sensors(), scanner.cameras, strict=True):
        pixels = rng.uniform(0.0, np.array(camera.resolution) - 1.0, (200, 2))
        film = ((pixels + 0.5) / camera.resolution).T.astype(np.float32)
        ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(film), mi.Point2f(0.5))
        along = np.array(ray.d).T
        along /= np.linalg.norm(along, axis=1)[:, None]
        near = EXACT_PX / camera.focal_px
        np.testing.assert_allclose(along, camera.rays(pixels), atol=near)


def test_mitsuba_measures_what_the_built_in_renderer_does(small, mi):
    light = Photometry(projector_blur_m=1e-3, noisy=False, ambient=0.1)
    ours = reconstruct(small, seed=0, photometry=light)
    physics = Physics(bounces=0, spp=16)
    theirs = reconstruct(small, seed=0, photometry=light, physics=physics)
    assert theirs.n_points == pytest.approx(ours.n_points, rel=0.05)
    # A flipped axis or half a pixel would be 0.1 mm.
    assert theirs.accuracy.rms_m < 2.0 * ours.accuracy.rms_m
    assert theirs.accuracy.bias_m == pytest.approx(ours.accuracy.bias_m, abs=3e-6)
    again = reconstruct(small, seed=0, photometry=light, physics=physics)
    assert np.array_equal(again.everything.points, theirs.everything.points)
