"""What each format's files say, taken apart by hand: no reader has to be installed."""

import ast
import json
import re
import struct
import xml.etree.ElementTree as Xml
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from support.camera_readers import aim_table
from support.exported_plans import exported_plan, points_before
from support.reconstruction_rigs import changed
from support.solid_readers import mounts

from geometry.devices import PinholeModel
from geometry.files.readers import load_mesh
from geometry.poses import inverse, transform
from planning.handover.export.export_formats import FORMATS
from planning.handover.export.export_frames import frame_of
from planning.handover.export.exported_rig import ExportedRig
from planning.handover.export.mount_tables import MountTables
from planning.handover.export.ros_files import roll_pitch_yaw
from planning.handover.export.sheets.landmarks import Landmarks
from planning.handover.export.usd_stage import UsdStage
from planning.handover.export.write_exports import write_export
from planning.model.errors import InputError
from planning.rig.mounted import read_mounted
from planning.rig.rig import load_rig

EXACT_PX = 1e-6
NUMBER = r"-?[\d.]+(?:e-?\d+)?"
CV_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def rig():
    plan = exported_plan()
    turned = frame_of("100,-50,30,40,20,-10", plan.requirements.workspace)
    return ExportedRig.of(plan, turned)


@pytest.fixture(scope="module")
def folder(rig, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports")
    for form in FORMATS:
        if form.name != "blender":
            write_export(rig, form, folder / form.name)
    return folder


def numbers_of(text):
    return np.array([float(word) for word in re.findall(NUMBER, text)])


def holds(device, pose, matrix, distortion=(0.0,) * 5):
    """Whether optics and pose (OpenCV's axes) re-project as the plan does."""
    points = points_before(device, 100)
    lens = PinholeModel(np.array(matrix), (1, 1), (0.0, 1.0), tuple(distortion))
    if device.lens is None:
        # A pinhole a billion metres away: its slopes are those of parallel light.
        matrix = np.array(matrix)
        local = transform(inverse(pose), points)[:, :2]
        pixels = local * np.diag(matrix)[:2] + matrix[:2, 2]
    else:
        pixels = lens.project(transform(inverse(pose), points))
    np.testing.assert_allclose(pixels, device.project(points), atol=EXACT_PX)


def has_corners(points, device, within):
    """Whether all corners of a device's housing are among points (n, 3)."""
    apart = np.linalg.norm(points[:, None] - device.box.corners, axis=2)
    return apart.min(axis=0).max() < within


def pose_of(quaternion_wxyz, translation):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(np.roll(quaternion_wxyz, -1)).as_matrix()
    pose[:3, 3] = translation
    return pose


def test_distortion_of_projectors_that_the_plan_lost_is_told(tmp_path):
    def bent(document):
        figures = document["rig"]["projector"].setdefault("figures", {})
        figures["distortion"] = [-0.03, 0.01, 0.0, 0.0, 0.0]

    plan = changed(exported_plan(), bent)
    bare = ExportedRig.of(plan, frame_of(None, plan.requirements.workspace))
    for form in FORMATS[:2]:
        lacks = write_export(bare, form, tmp_path / form.name).lacks
        assert "P1, P2: without the rig file's distortion" in lacks[0]


def test_opencv_s_matrices_re_project(rig, folder):
    text = (folder / "opencv" / "rig.yaml").read_text()
    for device in rig.devices:
        block = re.search(rf"^{device.id}:\n((?:   .*\n)+)", text, re.M)[1]
        found = {
            name: numbers_of(data)
            for name, data in re.findall(r"(\w+): !!.*\n(?:.*\n){3}.*\[(.*)\]", block)
        }
        pose = found["world_from_device"].reshape(4, 4)
        there = np.eye(4)
        there[:3, :3] = Rotation.from_rotvec(found["rvec"]).as_matrix()
        there[:3, 3] = found["tvec"]
        np.testing.assert_allclose(there @ pose, np.eye(4), atol=1e-12)
        if device.lens is None:
            points = points_before(device, 50)
            flat = (
                found["pixels_from_world"].reshape(4, 4) @ np.c_[points, np.ones(50)].T
            )
            np.testing.assert_allclose(flat[:2].T, device.project(points), atol=1e-9)
        else:
            matrix = found["camera_matrix"].reshape(3, 3)
            holds(device, inverse(there), matrix, found["distortion_coefficients"])


def test_colmap_s_rig_and_frame_re_project(rig, folder):
    def rows(name):
        lines = (folder / "colmap" / "text" / f"{name}.txt").read_text().splitlines()
        return [line.split() for line in lines if line and not line.startswith("#")]

    [of_rig], [of_frame] = rows("rigs"), rows("frames")
    in_world = pose_of(*np.split(np.array(of_frame[2:9], float), [4]))
    sensors = {1: np.eye(4)}
    for part in np.split(np.array(of_rig[4:]), (len(of_rig) - 4) // 10):
        sensors[int(part[1])] = pose_of(*np.split(part[3:].astype(float), [4]))
    devices = {device.id: device for device in rig.devices}
    binary = (folder / "colmap" / "binary" / "cameras.bin").read_bytes()[8:]
    for camera, image in zip(rows("cameras"), rows("images"), strict=True):
        number, model, width, height, *params = camera
        device = devices.pop(image[9].removesuffix(".png"))
        fx, fy, cx, cy, *lens = map(float, params)
        assert (int(width), int(height)) == device.model.resolution
        matrix = [[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]]
        there = sensors[int(number)] @ in_world
        holds(device, inverse(there), matrix, lens[:5] or (0.0,) * 5)
        alone = pose_of(*np.split(np.array(image[1:8], float), [4]))
        np.testing.assert_allclose(alone, there, atol=1e-12)
        head = struct.unpack_from("<IiQQ", binary)
        assert head[0] == int(number)
        assert head[1] == {"PINHOLE": 1, "FULL_OPENCV": 6}[model]
        values = struct.unpack_from(f"<{len(params)}d", binary, 24)
        assert values == tuple(map(float, params))
        binary = binary[24 + 8 * len(params) :]
    assert not binary
    assert devices.keys() == {"P2"}


def test_a_glb_has_a_node_a_device_and_our_own_reader_reads_it(rig, folder):
    path = folder / "gltf" / "rig.glb"
    data = path.read_bytes()
    tree = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    nodes = {node["name"]: node for node in tree["nodes"]}
    for device in rig.devices:
        node = nodes[device.id]
        pose = np.array(node["matrix"]).reshape(4, 4).T @ CV_FROM_GL
        extras, camera = node["extras"], tree["cameras"][node["camera"]]
        matrix = extras["K"] or device.panel_matrix
        holds(device, pose, matrix, extras["distortion"] or (0.0,) * 5)
        width, height = device.model.resolution
        half = np.array(matrix)[[0, 1], [0, 1]] / [width, height] * 2.0
        scope = camera[camera["type"]]
        if device.lens is None:
            assert [scope["xmag"], scope["ymag"]] == pytest.approx(1.0 / half)
        else:
            tall = np.tan(0.5 * scope["yfov"])
            assert 1.0 / tall == pytest.approx(half[1])
            assert 1.0 / tall / scope["aspectRatio"] == pytest.approx(half[0])
        below = {tree["nodes"][child]["name"] for child in node["children"]}
        assert below >= {f"{device.id}_body", f"{device.id}_frustum"}
        assert (f"{device.id}_mount" in below) == (device.id in ("P1", "C1"))
    mesh = load_mesh(path, unit="m")
    boxes = sum(
        8.0 * (a * b + b * c + c * a)
        for a, b, c in (device.box.half for device in rig.devices)
    )
    assert mesh.area == pytest.approx(rig.mesh.area + boxes, rel=1e-5)
    for device in rig.devices:
        assert has_corners(mesh.vertices, device, 1e-6)


def origin_of(element):
    angles = numbers_of(element.get("rpy"))
    pose = np.eye(4)
    pose[:3, 3] = numbers_of(element.get("xyz"))
    pose[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
    return pose


def test_ros_frames_re_project(rig, folder):
    tree = Xml.parse(folder / "ros" / "rig.urdf").getroot()
    poses = {"world": np.eye(4)}
    for joint in tree.findall("joint"):
        pose = origin_of(joint.find("origin"))
        child, parent = joint.find("child"), joint.find("parent")
        poses[child.get("link")] = poses[parent.get("link")] @ pose
    for device in rig.devices:
        path = folder / "ros" / "camera_info" / f"{device.id}.yaml"
        assert path.exists() == (device.id != "P2")
        pose = poses[f"{device.id}_optical_frame"]
        if path.exists():
            blocks = re.findall(r"(\w+):\n  rows.*\n.*\n  data: (.*)", path.read_text())
            data = {name: numbers_of(values) for name, values in blocks}
            matrix = data["camera_matrix"].reshape(3, 3)
            holds(device, pose, matrix, data["distortion_coefficients"])
        box = tree.find(f"link[@name='{device.id}']/visual")
        size = numbers_of(box.find("geometry/box").get("size"))
        place = poses[device.id] @ origin_of(box.find("origin"))
        signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
        assert has_corners(transform(place, 0.5 * signs * size), device, 1e-12)
        # REP 103: x of the body is the optical axis, z its way up.
        np.testing.assert_allclose(poses[device.id][:3, 0], pose[:3, 2], atol=1e-12)
        np.testing.assert_allclose(poses[device.id][:3, 2], -pose[:3, 1], atol=1e-12)
        if device.world_from_mount is not None:
            mount = poses[f"{device.id}_mount"]
            np.testing.assert_allclose(mount, device.world_from_mount, atol=1e-11)
    assert len(load_mesh(folder / "ros" / "object.stl", unit="m").faces) == len(
        rig.mesh.faces
    )


def test_angles_of_a_urdf_are_exact_at_the_poles():
    for pitch in (90.0, -90.0, 89.9999999):
        turn = Rotation.from_euler("ZYX", [30, pitch, 50], degrees=True).as_matrix()
        back = Rotation.from_euler("xyz", roll_pitch_yaw(turn)).as_matrix()
        np.testing.assert_allclose(back, turn, atol=1e-15)


def test_usd_s_cameras_re_project_in_single_precision(rig, folder):
    text = (folder / "usd" / "rig.usda").read_text()
    assert text.count("{") == text.count("}")
    for device in rig.devices:
        block = text[text.index(f'def Xform "{device.id}"') :]
        rows = re.search(r"matrix4d xformOp:transform = \((.*)\)\n", block)[1]
        pose = numbers_of(rows).reshape(4, 4).T @ CV_FROM_GL
        camera = {
            name: float(np.float32(value))
            for name, value in re.findall(rf"float (\w+) = ({NUMBER})", block)[:5]
        }
        size = np.array(device.model.resolution)
        opening = np.array([camera["horizontalAperture"], camera["verticalAperture"]])
        aside = [camera["horizontalApertureOffset"], camera["verticalApertureOffset"]]
        middle = 0.5 * (size - 1) - size * aside / opening * [1.0, -1.0]
        scale = camera["focalLength"] if device.lens else 10.0
        matrix = np.diag([*(size * scale / opening), 1.0])
        matrix[:2, 2] = middle
        body = re.search(r'def Mesh "body"(?:.*\n)*?.*points = (.*)', block)[1]
        corners = transform(pose @ CV_FROM_GL, numbers_of(body[1:]).reshape(-1, 3))
        assert has_corners(corners, device, 1e-12)
        # Distortion is what USD's cameras lack.
        straight = replace(device.planned, device=device.model)
        if device.lens is not None:
            lens = replace(device.lens, distortion=(0.0,) * 5)
            straight = replace(device.planned, device=lens)
        holds(replace(device, planned=straight), pose, matrix)


@pytest.mark.parametrize(
    ("up", "frame", "axis", "told"),
    [
        ([0.0, 1.0, 0.0], None, "Y", None),
        ([0.0, 0.0, 1.0], "100,-50,30,40,0,0", "Z", None),
        ([0.0, 0.0, 1.0], "0,0,0,0,0,90", "Y", None),
        ([-1.0, 0.0, 0.0], None, "Z", "up is (-1, 0, 0) in this frame"),
        ([0.0, -1.0, 0.0], None, "Z", "up is (0, -1, 0) in this frame"),
        ([0.0, 0.0, 1.0], "0,0,0,0,20,0", "Z", "up is (0.342, 0, 0.9397) in this"),
    ],
)
def test_usd_s_up_is_the_plan_s_or_is_told(rig, up, frame, axis, told):
    def stood(document):
        document["requirements"]["workspace"]["up"] = up

    plan = changed(rig.plan, stood)
    stage = ExportedRig.of(plan, frame_of(frame, plan.requirements.workspace))
    text = UsdStage().files(stage)["rig.usda"].decode()
    assert f'upAxis = "{axis}"' in text
    found = [line for line in UsdStage().lacks(stage) if "upAxis" in line]
    assert len(found) == (told is not None)
    assert all(told in line for line in found)


@pytest.mark.parametrize("frame", [None, "0,0,0"])
def test_poses_of_the_mesh_s_frame_are_read_back(rig, tmp_path, frame):
    plan = rig.plan
    same = ExportedRig.of(plan, frame_of(frame, plan.requirements.workspace))
    write_export(same, MountTables(), tmp_path)
    mounted = read_mounted(tmp_path / "poses.csv", load_rig("default"))
    devices = (*plan.projectors, *plan.cameras)
    for table, device in zip(mounted.tables, devices, strict=True):
        assert table.name == device.id
        pose = np.array(table.pose_mm)
        pose[:3, 3] *= 1e-3
        np.testing.assert_allclose(pose, device.world_from_device, atol=1e-12)


def test_poses_of_another_frame_are_refused_where_they_are_read(folder):
    """A comment alone would let them be read as the mesh's, metres away."""
    told = r"poses.csv: line 3: 'P1' is in another frame \(.* 100, -50, 30 mm.*\), must"
    with pytest.raises(InputError, match=told):
        read_mounted(folder / "csv" / "poses.csv", load_rig("default"))


def test_tables_have_distances_for_a_tape(rig, folder):
    assert mounts(folder / "csv", rig)[0] <= 0.005 + 1e-9
    text = (folder / "csv" / "mounts.csv").read_text()
    assert "azimuth 40, tilt 20, roll -10" in text
    assert "P1,projector,,mount," in text
    assert "C2,camera,,optical centre," in text
    assert "C3,camera,left wing,optical centre," in text


def test_step_s_solids_are_closed_and_where_the_housings_are(rig, folder):
    text = (folder / "step" / "rig.step").read_text()
    entities = dict(re.findall(r"^#(\d+)=(.*);$", text, re.M))
    used = {name for body in entities.values() for name in re.findall(r"#(\d+)", body)}
    assert used <= entities.keys()
    senses = re.findall(r"ORIENTED_EDGE\('',\*,\*,#(\d+),\.([TF])\.\)", text)
    n = len(rig.devices)
    assert len(senses) == 24 * n
    # Every edge twice, once each way.
    assert {edge for edge, _ in senses} == {edge for edge, way in senses if way == "T"}
    assert len({edge for edge, _ in senses}) == 12 * n
    assert len(set(senses)) == 24 * n
    points = {
        name: numbers_of(body[body.index(",") :])
        for name, body in entities.items()
        if body.startswith("CARTESIAN_POINT")
    }
    vertices = re.findall(r"VERTEX_POINT\('',#(\d+)\)", text)
    corners = np.array([points[name] for name in vertices])
    want = np.concatenate([1e3 * device.box.corners for device in rig.devices])
    np.testing.assert_allclose(corners, want, atol=1e-9)
    assert text.count("MANIFOLD_SOLID_BREP") == n
    assert "'P1 mount'" in text
    assert "'C2 mount'" not in text


def test_a_drawing_has_three_views_with_dimensions(rig, folder):
    lines = (folder / "drawing" / "rig.dxf").read_text().splitlines()
    pairs = list(zip(lines[::2], lines[1::2], strict=True))
    points: list[list[float]] = []
    words: list[str] = []
    kind = ""
    for code, value in pairs:
        kind = value if code == "0" else kind
        if kind == "POINT" and code in ("10", "20"):
            points.append(float(value))
        if kind == "TEXT" and code == "1":
            words.append(value)
    places = np.array(points).reshape(3, -1, 2)
    n = len(rig.datums)
    of_c2 = [d.id for d in rig.devices].index("C2")
    centre = 1e3 * rig.devices[of_c2].world_from_device[:3, 3]
    front, top, side = places[:, n + of_c2]
    np.testing.assert_allclose(front, centre[[0, 2]])
    assert top[0] == pytest.approx(centre[0])
    assert side[1] == pytest.approx(centre[2])
    # No view lies on another.
    assert places[1, :, 1].min() > places[0, :, 1].max()
    assert places[2, :, 0].min() > places[0, :, 0].max()
    apart = centre - 1e3 * rig.datums[0]
    for axis in range(3):
        assert words.count(f"C2 {apart[axis]:.2f}") == 2


def test_an_aiming_sheet_marks_what_the_device_sees(rig, folder):
    found = aim_table(folder / "aim", [device.id for device in rig.devices])
    landmarks = Landmarks(rig)
    for device in rig.devices:
        places, pixels = found[device.id]
        assert len(places) == 3
        np.testing.assert_allclose(device.project(places), pixels, atol=1e-9)
        image = np.asarray(Image.open(folder / "aim" / f"{device.id}.png"))
        assert image.shape[::-1] == device.model.resolution
        for u, v in np.rint(pixels).astype(int):
            assert image[v, u] == 255
        # On a body about its centre what faces the device is on its side.
        start = device.world_from_device[:3, 3]
        toward = (places - rig.centre) @ (start - rig.centre)
        assert np.all(toward > 0.0)
        apart = np.linalg.norm(pixels - np.roll(pixels, 1, axis=0), axis=1)
        assert apart.min() > 100.0
        seen = landmarks.vertices[landmarks.seen_by(device)]
        np.testing.assert_allclose(seen, places, atol=1e-12)
        text = (folder / "aim" / f"{device.id}.txt").read_text()
        assert f"{pixels[0, 0]:.1f}" in text
        assert "D4" in text


def test_blender_s_script_compiles_and_its_numbers_re_project(rig):
    [form] = [form for form in FORMATS if form.name == "blender"]
    files = form.files(rig)
    tree = ast.parse(files["build_rig.py"])
    [table] = [
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "DEVICES"
    ]
    for entry, device in zip(ast.literal_eval(table), rig.devices, strict=True):
        pose = np.array(entry["world_from_view"]) @ CV_FROM_GL
        width, height = device.model.resolution
        tall, wide = entry["pixel_aspect"][::-1]
        fx = entry["focal"] * width if device.lens else width / entry["width_m"]
        # Height over width of a pixel; Blender's shifts count in widths of the image.
        fy = fx * wide / tall
        right, up = np.array(entry["shift"]) * width * [1.0, wide / tall]
        middle = 0.5 * (width - 1) - right, 0.5 * (height - 1) + up
        matrix = [[fx, 0.0, middle[0]], [0.0, fy, middle[1]], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(matrix, device.panel_matrix, rtol=1e-12)
        holds(device, pose, matrix, entry["distortion"] or (0.0,) * 5)
        corners = transform(pose @ CV_FROM_GL, np.array(entry["body"]))
        assert has_corners(corners, device, 1e-12)
        if device.kind == "projector":
            assert entry["pattern"] in files
            # The light's z is behind it: x / z is the slope to the left.
            scale, offset = np.array(entry["image_scale"]), entry["image_offset"]
            ray = np.array([0.1, -0.05, 1.0])
            u, v = (device.panel_matrix @ ray)[:2]
            place = scale * (ray[:2] * [1.0, -1.0] / -ray[2]) + offset
            assert place[0] * width - 0.5 == pytest.approx(u)
            assert (1.0 - place[1]) * height - 0.5 == pytest.approx(v)
