"""ROS: camera_info files, static transforms as a launch file, and a URDF."""

from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import inverse

from .exported_rig import Content, ExportedDevice, ExportedRig, id_words, numbers

# REP 103: bodies have x ahead, y left, z up; optical frames x right, y down, z ahead.
_BODY_FROM_OPTICAL = np.array(
    [[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
)
_OBJECT = "object.stl"

_LAUNCH = '''"""Static transforms of a rig: ros2 launch ./static_transforms.launch.py"""

from launch import LaunchDescription
from launch_ros.actions import Node

# parent, child, x, y, z [m], qx, qy, qz, qw
TRANSFORMS = [
{rows}
]
NAMES = ("--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw")


def generate_launch_description():
    return LaunchDescription(
        [
            Node(
                package="tf2_ros",
                executable="static_transform_publisher",
                name=child + "_transform",
                arguments=[
                    *("--frame-id", parent, "--child-frame-id", child),
                    *(part for pair in zip(NAMES, map(repr, pose)) for part in pair),
                ],
            )
            for parent, child, *pose in TRANSFORMS
        ]
    )
'''


class RosFiles:
    """`camera_info/ID.yaml`, `static_transforms.launch.py`, `rig.urdf`, its meshes."""

    name = "ros"
    what = "ROS camera_info, static transforms and URDF"
    notes = (
        "camera_info/ID.yaml: as camera_info_manager reads them, plumb_bob; "
        "projectors are inverse cameras. static_transforms.launch.py (ROS 2) and "
        "rig.urdf have the same frames: `world`, ID (x ahead, y left, z up, at the "
        "optical centre), ID_optical_frame (x right, y down, z ahead; REP 103), "
        "ID_mount (z out of the device). Metres and radians; the centre of the "
        "top-left pixel is (0, 0). object.stl and obstacle*.stl: metres, single "
        "precision; the URDF names them by their place beside it."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return a sentence if there is parallel light."""
        if not rig.parallel:
            return []
        return [
            f"{id_words(rig.parallel)}: no camera_info, it has no model of parallel "
            f"light; frames and housings are there"
        ]

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return all files."""
        meshes = {_OBJECT: rig.mesh}
        for index, mesh in enumerate(rig.obstacles.values()):
            meshes[f"obstacle{index}.stl"] = mesh
        links = _links(rig)
        rows = [
            f'    ("{parent}", "{child}", {numbers(pose[:3, 3])}, '
            f"{numbers(Rotation.from_matrix(pose[:3, :3]).as_quat())}),"
            for parent, child, pose in links
        ]
        launch = _LAUNCH.format(rows="\n".join(rows))
        return {
            **{
                f"camera_info/{device.id}.yaml": _camera_info(device).encode()
                for device in rig.devices
                if device.lens is not None
            },
            "static_transforms.launch.py": launch.encode(),
            "rig.urdf": _urdf(rig, links, list(meshes)).encode(),
            **{name: _stl(mesh) for name, mesh in meshes.items()},
        }


def roll_pitch_yaw(turn: Array) -> list[float]:
    """Return the angles of R = Rz(yaw) Ry(pitch) Rx(roll), exact at the poles too."""
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    # The rows of R turned back by yaw: pitch is left in the first column.
    pitch = np.arctan2(-turn[2, 0], c * turn[0, 0] + s * turn[1, 0])
    roll = np.arctan2(s * turn[0, 2] - c * turn[1, 2], c * turn[1, 1] - s * turn[0, 1])
    return [float(roll), float(pitch), float(yaw)]


def _links(rig: ExportedRig) -> list[tuple[str, str, Array]]:
    """Return parent, child and pose of the child in the parent's axes."""
    links: list[tuple[str, str, Array]] = []
    for device in rig.devices:
        body = device.world_from_device @ inverse(_BODY_FROM_OPTICAL)
        links.append(("world", device.id, body))
        links.append((device.id, f"{device.id}_optical_frame", _BODY_FROM_OPTICAL))
        if device.device_from_mount is not None:
            mount = _BODY_FROM_OPTICAL @ device.device_from_mount
            links.append((device.id, f"{device.id}_mount", mount))
    return links


def _camera_info(device: ExportedDevice) -> str:
    width, height = device.model.resolution
    projection = np.column_stack([device.panel_matrix, np.zeros(3)])
    blocks = (
        ("camera_matrix", 3, 3, device.panel_matrix),
        ("distortion_coefficients", 1, 5, device.distortion),
        ("rectification_matrix", 3, 3, np.eye(3)),
        ("projection_matrix", 3, 4, projection),
    )
    lines = [
        f"image_width: {width}",
        f"image_height: {height}",
        f"camera_name: {device.id}",
        "distortion_model: plumb_bob",
    ]
    for name, rows, columns, values in blocks:
        data = numbers(values)
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {columns}"]
        lines.append(f"  data: [{data}]")
    return "\n".join(lines) + "\n"


def _urdf(
    rig: ExportedRig, links: list[tuple[str, str, Array]], meshes: list[str]
) -> str:
    seen = "".join(_visual(np.eye(4), f'<mesh filename="{name}"/>') for name in meshes)
    parts = [f'  <link name="world">{seen}</link>']
    boxes = {device.id: _box(device) for device in rig.devices}
    for parent, child, pose in links:
        inside = boxes.get(child, "")
        name = quoteattr(child)
        parts += [
            f"  <link name={name}>{inside}</link>",
            f'  <joint name={quoteattr(f"{child}_joint")} type="fixed">'
            f"<parent link={quoteattr(parent)}/><child link={name}/>"
            f"{_origin(pose)}</joint>",
        ]
    note = f"<!-- plan {rig.plan.digest} -->"
    head = ['<?xml version="1.0"?>', note, '<robot name="rig">']
    return "\n".join([*head, *parts, "</robot>", ""])


def _box(device: ExportedDevice) -> str:
    if device.body is None:
        return ""
    pose = _BODY_FROM_OPTICAL.copy()
    pose[:3, 3] = _BODY_FROM_OPTICAL[:3, :3] @ device.body.centre_m
    size = numbers(2.0 * np.array(device.body.half_m), " ")
    return _visual(pose, f'<box size="{size}"/>')


def _visual(pose: Array, shape: str) -> str:
    return f"<visual>{_origin(pose)}<geometry>{shape}</geometry></visual>"


def _origin(pose: Array) -> str:
    place, turn = numbers(pose[:3, 3], " "), numbers(roll_pitch_yaw(pose[:3, :3]), " ")
    return f'<origin xyz="{place}" rpy="{turn}"/>'


def _stl(mesh: TriangleMesh) -> bytes:
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    triangles = np.zeros(len(mesh.faces), dtype=kind)
    triangles["normal"], triangles["corners"] = mesh.face_normals, mesh.corners
    head = b"ringrig, metres".ljust(80)
    return head + np.uint32(len(triangles)).tobytes() + triangles.tobytes()
