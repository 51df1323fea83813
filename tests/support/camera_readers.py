"""Pixels of points by other programs' own code, from the files of an export.

Each function takes a folder and points (n, 3) by device, and returns pixels (n, 2) of
those devices that the format holds, the centre of the top-left one at (0, 0).
"""

import ast
import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Points = Mapping[str, Array]
# From the camera axes of glTF, USD and Blender (-z ahead, y up) to OpenCV's.
_CV_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])


def opencv(folder: Path, points: Points) -> dict[str, Array]:
    """By `cv2.FileStorage`, `projectPoints`, and `perspectiveTransform`."""
    import cv2

    store = cv2.FileStorage(str(folder / "rig.yaml"), cv2.FILE_STORAGE_READ)
    found: dict[str, Array] = {}
    for name, world in points.items():
        node = store.getNode(name)
        affine = node.getNode("pixels_from_world")
        if not affine.empty():
            found[name] = cv2.perspectiveTransform(world[:, None], affine.mat())[:, 0]
            found[name] = found[name][:, :2]
            continue
        keys = ("rvec", "tvec", "camera_matrix", "distortion_coefficients")
        found[name] = cv2.projectPoints(world, *(node.getNode(k).mat() for k in keys))[
            0
        ]
        found[name] = found[name][:, 0]
    return found


def colmap_text(folder: Path, points: Points) -> dict[str, Array]:
    """By `pycolmap.Reconstruction` of the text files."""
    return _colmap(folder / "text", points)


def colmap_binary(folder: Path, points: Points) -> dict[str, Array]:
    """By `pycolmap.Reconstruction` of the binary files."""
    return _colmap(folder / "binary", points)


def _colmap(folder: Path, points: Points) -> dict[str, Array]:
    import pycolmap

    model = pycolmap.Reconstruction(str(folder))
    found: dict[str, Array] = {}
    for image in model.images.values():
        name = image.name.removesuffix(".png")
        # Through rig and frame, not through the pose that images.txt repeats.
        rig, frame = model.rigs[image.frame.rig_id], model.frames[image.frame_id]
        sensor = image.camera.sensor_id
        pose = frame.rig_from_world
        if not rig.is_ref_sensor(sensor):
            pose = rig.sensor_from_rig(sensor) * pose
        seen = pose * points[name]
        found[name] = np.array(image.camera.img_from_cam(seen)) - 0.5
    return found


def gltf_extras(folder: Path, points: Points) -> dict[str, Array]:
    """By pygltflib's nodes and extras, and OpenCV's lens."""
    from pygltflib import GLTF2

    tree = GLTF2().load(str(folder / "rig.glb"))
    found: dict[str, Array] = {}
    for node in tree.nodes:
        if node.name in points:
            pose = np.array(node.matrix).reshape(4, 4).T @ _CV_FROM_GL
            found[node.name] = _seen(points[node.name], pose, node.extras)
    return found


def gltf_cameras(folder: Path, points: Points) -> dict[str, Array]:
    """By trimesh's scene graph and pygltflib's cameras, by glTF's own formulas."""
    import trimesh
    from pygltflib import GLTF2

    path = str(folder / "rig.glb")
    tree, scene = GLTF2().load(path), trimesh.load_scene(path)
    found: dict[str, Array] = {}
    for node in tree.nodes:
        if node.camera is None:
            continue
        pose, _ = scene.graph.get(node.name)
        local = _into(pose, points[node.name])
        camera = tree.cameras[node.camera]
        if camera.type == "orthographic":
            lens = camera.orthographic
            ndc = local[:, :2] / [lens.xmag, lens.ymag]
        else:
            lens = camera.perspective
            half = np.tan(0.5 * lens.yfov)
            ndc = local[:, :2] / -local[:, 2:] / [half * lens.aspectRatio, half]
        found[node.name] = _pixels(ndc, node.extras["resolution"])
    return found


def ros(folder: Path, points: Points) -> dict[str, Array]:
    """By yourdfpy's frames of the URDF, camera_info and OpenCV's plumb bob."""
    import yaml
    from yourdfpy import URDF

    urdf = URDF.load(str(folder / "rig.urdf"), load_meshes=True)
    found: dict[str, Array] = {}
    for name, world in points.items():
        path = folder / "camera_info" / f"{name}.yaml"
        if path.exists():
            pose = urdf.get_transform(f"{name}_optical_frame", "world")
            found[name] = _by_info(world, pose, yaml.safe_load(path.read_text()))
    return found


def ros_transforms(folder: Path, points: Points) -> dict[str, Array]:
    """By the static transforms that the launch file publishes, and camera_info."""
    import yaml

    tree = ast.parse((folder / "static_transforms.launch.py").read_text())
    rows = next(
        ast.literal_eval(line.value)
        for line in tree.body
        if isinstance(line, ast.Assign) and line.targets[0].id == "TRANSFORMS"
    )
    poses = {"world": np.eye(4)}
    for parent, child, *numbers in rows:
        pose = np.eye(4)
        pose[:3, 3] = numbers[:3]
        pose[:3, :3] = Rotation.from_quat(numbers[3:]).as_matrix()
        poses[child] = poses[parent] @ pose
    found: dict[str, Array] = {}
    for name, world in points.items():
        path = folder / "camera_info" / f"{name}.yaml"
        if path.exists():
            pose = poses[f"{name}_optical_frame"]
            found[name] = _by_info(world, pose, yaml.safe_load(path.read_text()))
    return found


def _by_info(world: Array, pose: Array, info: dict[str, Any]) -> Array:
    matrix = np.array(info["camera_matrix"]["data"]).reshape(3, 3)
    lens = {"K": matrix, "distortion": info["distortion_coefficients"]["data"]}
    return _seen(world, pose, lens)


def usd_frustum(folder: Path, points: Points) -> dict[str, Array]:
    """By `UsdGeom.Camera`'s own frustum: no distortion, single precision."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(folder / "rig.usda"))
    found: dict[str, Array] = {}
    for name, world in points.items():
        prim = stage.GetPrimAtPath(f"/rig/{name}")
        camera = UsdGeom.Camera(stage.GetPrimAtPath(f"/rig/{name}/optics"))
        frustum = camera.GetCamera(Usd.TimeCode.Default()).frustum
        view = np.array(frustum.ComputeViewMatrix())
        clip = np.c_[world, np.ones(len(world))] @ view
        clip = clip @ np.array(frustum.ComputeProjectionMatrix())
        size = prim.GetAttribute("ringrig:resolution").Get()
        found[name] = _pixels(clip[:, :2] / clip[:, 3:], size)
    return found


def usd_attributes(folder: Path, points: Points) -> dict[str, Array]:
    """By USD's transforms and the attributes ringrig:*, and OpenCV's lens."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(folder / "rig.usda"))
    found: dict[str, Array] = {}
    for name, world in points.items():
        prim = stage.GetPrimAtPath(f"/rig/{name}")
        pose = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0.0)).T
        optics = stage.GetPrimAtPath(f"/rig/{name}/optics")
        kind = UsdGeom.Camera(optics).GetProjectionAttr().Get()
        matrix = np.array(prim.GetAttribute("ringrig:matrix").Get()).reshape(3, 3)
        if kind == "orthographic":
            local = _into(pose @ _CV_FROM_GL, world)
            found[name] = local[:, :2] * np.diag(matrix)[:2] + matrix[:2, 2]
            continue
        lens = {
            "K": matrix,
            "distortion": list(prim.GetAttribute("ringrig:distortion").Get()),
        }
        found[name] = _seen(world, pose @ _CV_FROM_GL, lens)
    return found


def tables(folder: Path, points: Points) -> dict[str, Array]:
    """By Python's csv, scipy's quaternions and OpenCV's lens."""
    poses = {row["name"]: row for row in _rows(folder / "poses.csv")}
    found: dict[str, Array] = {}
    for row in _rows(folder / "optics.csv"):
        name, pose = row["name"], np.eye(4)
        place = poses[name]
        pose[:3, 3] = [1e-3 * float(place[f"{axis}_mm"]) for axis in "xyz"]
        turn = [float(place[f"q{axis}"]) for axis in "xyzw"]
        pose[:3, :3] = Rotation.from_quat(turn).as_matrix()
        middle = np.array([float(row["cx_px"]), float(row["cy_px"])])
        if row["light"] == "parallel":
            local = 1e3 * _into(pose, points[name])[:, :2]
            found[name] = local / float(row["pixel_pitch_mm"]) + middle
            continue
        fx, fy = float(row["fx_px"]), float(row["fy_px"])
        lens = {
            "K": np.array(
                [[fx, 0.0, middle[0]], [0.0, fy, middle[1]], [0.0, 0.0, 1.0]]
            ),
            "distortion": [float(row[key]) for key in ("k1", "k2", "p1", "p2", "k3")],
        }
        found[name] = _seen(points[name], pose, lens)
    return found


def aim_table(folder: Path, points: Points) -> dict[str, tuple[Array, Array]]:
    """Return landmarks [m] and their pixels by device, as aim.csv has them."""
    found: dict[str, tuple[Array, Array]] = {}
    for name in points:
        rows = [row for row in _rows(folder / "aim.csv") if row["device"] == name]
        places = [[1e-3 * float(row[f"{axis}_mm"]) for axis in "xyz"] for row in rows]
        pixels = [[float(row["u_px"]), float(row["v_px"])] for row in rows]
        found[name] = np.array(places), np.array(pixels)
    return found


def mitsuba(folder: Path, points: Points) -> dict[str, Array]:
    """By where Mitsuba's sensors see points, and its projectors light them.

    A projector with a pupil is many pinholes about its middle: their mean.
    """
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    found: dict[str, Array] = {}
    for path in sorted(folder.glob("*.xml")):
        scene = mi.load_file(str(path))
        shown = mi.Bitmap(str(folder / "patterns" / path.stem / "00-white.png"))
        at, lit = _at(mi, points[path.stem]), list[Array]()
        for light in scene.emitters():
            if light.id().startswith("light"):
                towards, _ = light.sample_direction(at, mi.Point2f(0.5))
                lit.append(np.array(towards.uv, dtype=np.float64).T)
        found[path.stem] = np.mean(lit, axis=0) * shown.size() - 0.5
    for sensor in scene.sensors():
        name = sensor.id()
        if sensor.needs_aperture_sample():
            found[name] = _by_rays(mi, sensor, points[name])
            continue
        seen, _ = sensor.sample_direction(_at(mi, points[name]), mi.Point2f(0.5))
        found[name] = np.array(seen.uv).T - 0.5
    return found


def _by_rays(mi: Any, sensor: Any, points: Array) -> Array:
    """Pixels by a thin lens's rays through its middle, which are a pinhole's.

    Its `sample_direction` gives pixels that are too large by the focus distance.
    """
    film = np.random.default_rng(0).random((1000, 2)).astype(np.float32)
    ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(film.T), mi.Point2f(0.5))
    # In an AD variant the matrix has a width of one.
    pose = np.array(sensor.world_transform().matrix, dtype=np.float64).reshape(4, 4)
    local = np.linalg.solve(pose[:3, :3], np.array(ray.d, dtype=np.float64))
    slopes = np.vstack([local[:2] / local[2], np.ones(len(film))])
    matrix = np.linalg.lstsq(slopes.T, film.astype(np.float64), rcond=None)[0]
    seen = _into(pose, points)
    slopes = np.column_stack([seen[:, :2] / seen[:, 2:], np.ones(len(seen))])
    return slopes @ matrix * sensor.film().crop_size() - 0.5


def _at(mi: Any, points: Array) -> Any:
    interaction = mi.SurfaceInteraction3f()
    interaction.p = mi.Point3f(points.T.astype(np.float32))
    return interaction


def _seen(world: Array, world_from_camera: Array, lens: Mapping[str, Any]) -> Array:
    """Pixels by OpenCV's lens, or of a panel in parallel light."""
    import cv2

    local = _into(world_from_camera, world)
    if lens["K"] is None:
        size = np.array(lens["resolution"])
        return local[:, :2] / lens["pixel_pitch_m"] + 0.5 * (size - 1)
    zero = np.zeros(3)
    matrix, lens_terms = np.array(lens["K"]), np.array(lens["distortion"])
    return cv2.projectPoints(local, zero, zero, matrix, lens_terms)[0][:, 0]


def _into(world_from_local: Array, world: Array) -> Array:
    return np.linalg.solve(world_from_local, np.c_[world, np.ones(len(world))].T)[:3].T


def _pixels(ndc: Array, size: Any) -> Array:
    """Of coordinates from -1 to 1, y up, across the image."""
    width, height = size
    across, down = 0.5 * width * (1.0 + ndc[:, 0]), 0.5 * height * (1.0 - ndc[:, 1])
    return np.column_stack([across, down]) - 0.5


def _rows(path: Path) -> list[dict[str, str]]:
    lines = path.read_text().splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))
