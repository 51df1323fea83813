"""COLMAP from 3.12 on: a model with one rig and one frame, as text and binary."""

import struct

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array

from .exported_rig import (
    Content,
    ExportedDevice,
    ExportedRig,
    id_words,
    numbers,
)

_PINHOLE, _FULL_OPENCV = 1, 6
_CAMERA = 0
_MODELS = {_PINHOLE: "PINHOLE", _FULL_OPENCV: "FULL_OPENCV"}


class ColmapModel:
    """`text/` and `binary/`, each a model that COLMAP opens."""

    name = "colmap"
    what = "COLMAP sparse model"
    notes = (
        "text/ and binary/ hold the same: cameras, rigs, frames, images (ID.png), "
        "no points. Metres; camera axes x right, y down, z ahead; the centre of the "
        "top-left pixel is (0.5, 0.5), half a pixel on from the plan's. Every "
        "device is a sensor of one rig, the first is its reference; a projector is "
        "a camera too. The model is PINHOLE, or FULL_OPENCV where the lens distorts "
        "(k1 k2 p1 p2 k3 0 0 0). Housings, mounts and the object have no place in "
        "it."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return a sentence if there is parallel light."""
        if not rig.parallel:
            return []
        return [f"{id_words(rig.parallel)}: left out, COLMAP has no parallel light"]

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return both models."""
        devices = [device for device in rig.devices if device.lens is not None]
        text, binary = _text(devices), _binary(devices)
        return {
            **{f"text/{name}.txt": part.encode() for name, part in text.items()},
            **{f"binary/{name}.bin": part for name, part in binary.items()},
        }


def _camera(device: ExportedDevice) -> tuple[int, list[float]]:
    """Return the number of the model, and its parameters."""
    k = device.panel_matrix
    params = [k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5]
    if not any(device.distortion):
        return _PINHOLE, params
    return _FULL_OPENCV, [*params, *device.distortion, 0.0, 0.0, 0.0]


def _motion(b_from_a: Array) -> list[float]:
    """Return the quaternion w, x, y, z and the translation."""
    x, y, z, w = Rotation.from_matrix(b_from_a[:3, :3]).as_quat()
    return [w, x, y, z, *b_from_a[:3, 3]]


def _in_rig(devices: list[ExportedDevice]) -> list[list[float]]:
    """Return sensor_from_rig of all but the first device, whose axes the rig has."""
    rig = devices[0].world_from_device
    return [_motion(device.device_from_world @ rig) for device in devices[1:]]


def _text(devices: list[ExportedDevice]) -> dict[str, str]:
    cameras, images, sensors, data = [], [], [], []
    for number, device in enumerate(devices, 1):
        model, params = _camera(device)
        width, height = device.model.resolution
        cameras.append(
            f"{number} {_MODELS[model]} {width} {height} {numbers(params, ' ')}"
        )
        pose = numbers(_motion(device.device_from_world), " ")
        images += [f"{number} {pose} {number} {device.id}.png", ""]
        data.append(f"CAMERA {number} {number}")
    rigs: list[str] = []
    frames: list[str] = []
    if devices:
        sensors = [
            f"CAMERA {number} 1 {numbers(pose, ' ')}"
            for number, pose in enumerate(_in_rig(devices), 2)
        ]
        rigs = [" ".join([f"1 {len(devices)} CAMERA 1", *sensors])]
        pose = numbers(_motion(devices[0].device_from_world), " ")
        frames = [f"1 1 {pose} {len(devices)} {' '.join(data)}"]
    parts = {
        "cameras": ("CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]", cameras),
        "rigs": ("RIG_ID, NUM_SENSORS, REF_SENSOR, SENSORS[]", rigs),
        "frames": (
            "FRAME_ID, RIG_ID, RIG_FROM_WORLD, NUM_DATA_IDS, DATA_IDS[]",
            frames,
        ),
        "images": ("IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", images),
        "points3D": ("POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]", []),
    }
    return {
        name: "".join(f"{line}\n" for line in [f"# {head}", *lines])
        for name, (head, lines) in parts.items()
    }


def _binary(devices: list[ExportedDevice]) -> dict[str, bytes]:
    n, one = len(devices), min(len(devices), 1)
    cameras, images = struct.pack("<Q", n), struct.pack("<Q", n)
    rigs, frames = struct.pack("<Q", one), struct.pack("<Q", one)
    if devices:
        rigs += struct.pack("<IIiI", 1, n, _CAMERA, 1)
        for number, pose in enumerate(_in_rig(devices), 2):
            rigs += struct.pack("<iIB7d", _CAMERA, number, 1, *pose)
        pose = _motion(devices[0].device_from_world)
        frames += struct.pack("<II7dI", 1, 1, *pose, n)
    for number, device in enumerate(devices, 1):
        model, params = _camera(device)
        size = device.model.resolution
        cameras += struct.pack("<IiQQ", number, model, *size)
        cameras += struct.pack(f"<{len(params)}d", *params)
        pose = _motion(device.device_from_world)
        images += struct.pack("<I7dI", number, *pose, number)
        images += f"{device.id}.png".encode() + b"\0" + struct.pack("<Q", 0)
        frames += struct.pack("<iIQ", _CAMERA, number, number)
    return {
        "cameras": cameras,
        "rigs": rigs,
        "frames": frames,
        "images": images,
        "points3D": np.zeros(1, dtype="<u8").tobytes(),
    }
