"""OpenCV: one FileStorage file in YAML with every device."""

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array

from .exported_rig import Content, ExportedDevice, ExportedRig, numbers


class OpencvStorage:
    """`rig.yaml` for `cv2.FileStorage`."""

    name = "opencv"
    what = "OpenCV FileStorage"
    notes = (
        "rig.yaml: a node for each device. Metres; OpenCV's camera axes: x right, y "
        "down, z ahead; the centre of the top-left pixel is (0, 0). "
        "cv2.projectPoints(points, rvec, tvec, camera_matrix, "
        "distortion_coefficients) rvec and tvec are of device_from_world. In "
        "parallel light there is no camera matrix: cv2.perspectiveTransform(points, "
        "pixels_from_world) gives u, v, 0."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return nothing: it holds all that plans do."""
        return []

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return `rig.yaml`."""
        lines = ["%YAML:1.0", "---", f'plan: "{rig.plan.digest}"']
        lines.append(f"devices: [ {', '.join(_quoted(d.id) for d in rig.devices)} ]")
        for device in rig.devices:
            lines.append(f"{device.id}:")
            lines += [f"   {line}" for line in _node(device)]
        return {"rig.yaml": ("\n".join(lines) + "\n").encode()}


def _node(device: ExportedDevice) -> list[str]:
    width, height = device.model.resolution
    lines = [f"kind: {device.kind}", f"image_width: {width}", f"image_height: {height}"]
    there = device.device_from_world
    if device.lens is None:
        # Rows u, v, 0 and 1: an affine camera.
        affine = np.eye(4)
        affine[:2, :2] = device.panel_matrix[:2, :2]
        affine[:2, 3] = device.panel_matrix[:2, 2]
        affine[2, 2] = 0.0
        lines += _matrix("pixels_from_world", affine @ there)
    else:
        lines += _matrix("camera_matrix", device.lens.camera_matrix)
        lines += _matrix("distortion_coefficients", np.array([device.distortion]).T)
    rvec = Rotation.from_matrix(there[:3, :3]).as_rotvec()
    lines += _matrix("rvec", rvec[:, None]) + _matrix("tvec", there[:3, 3:])
    return lines + _matrix("world_from_device", device.world_from_device)


def _matrix(name: str, values: Array) -> list[str]:
    rows, columns = np.shape(values)
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        f"   data: [ {numbers(values)} ]",
    ]


def _quoted(text: str) -> str:
    return f'"{text}"'
