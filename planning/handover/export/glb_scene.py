"""glTF 2.0: one binary file, a node with a camera for each device."""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.poses import inverse, transform

from .exported_rig import (
    BOX_TRIANGLES,
    DEVICE_FROM_GL,
    Content,
    ExportedDevice,
    ExportedRig,
    id_words,
)

_ARRAY, _INDICES = 34962, 34963
_FLOAT, _UINT = 5126, 5125
_LINES, _TRIANGLES = 1, 4
_COLOURS = {
    "object": (0.75, 0.75, 0.75, 1.0),
    "obstacle": (0.45, 0.45, 0.45, 1.0),
    "camera": (0.2, 0.45, 0.8, 1.0),
    "projector": (0.9, 0.55, 0.15, 1.0),
}
_MATERIALS = {name: index for index, name in enumerate(_COLOURS)}
_NEAR_M = 0.01


class GlbScene:
    """`rig.glb`."""

    name = "gltf"
    what = "glTF 2.0, binary"
    notes = (
        "rig.glb: nodes `object`, the obstacles, and one a device with its camera; "
        "below it ID_body, ID_frustum and ID_mount. Metres; a node looks along its "
        "-z with +y up; coordinates are those of the frame above, whose up axis "
        "need not be y. A node's `extras` have K, resolution, distortion and pose "
        "in OpenCV's axes. The camera itself has the field of view about the "
        "optical axis alone. Vertices are single precision."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return a sentence for lens shift, and one for distortion."""
        beside = "stands in `extras` alone, glTF's cameras have none"
        pairs = (("lens shift", rig.shifted), ("distortion", rig.distorted))
        return [f"{id_words(of)}: {what} {beside}" for what, of in pairs if of]

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return `rig.glb`."""
        return {"rig.glb": _Glb(rig).content()}


class _Glb:
    """A file under construction."""

    def __init__(self, rig: ExportedRig) -> None:
        self._data = bytearray()
        self._tree: dict[str, list[Any]] = {
            key: []
            for key in ("nodes", "meshes", "cameras", "accessors", "bufferViews")
        }
        self._extras = {"plan": rig.plan.digest, "frame": rig.frame.words}
        tops = [self._solid("object", rig.mesh.vertices, rig.mesh.faces, "object")]
        for name, mesh in rig.obstacles.items():
            tops.append(self._solid(name, mesh.vertices, mesh.faces, "obstacle"))
        self._tops = [*tops, *(self._device(device) for device in rig.devices)]

    def content(self) -> bytes:
        """Return the file."""
        tree = {
            "asset": {"version": "2.0", "generator": "ringrig", "extras": self._extras},
            "scene": 0,
            "scenes": [{"nodes": self._tops}],
            **{key: entries for key, entries in self._tree.items() if entries},
            "materials": [
                {
                    "name": name,
                    "doubleSided": True,
                    "pbrMetallicRoughness": {"baseColorFactor": colour},
                }
                for name, colour in _COLOURS.items()
            ],
            "buffers": [{"byteLength": len(self._data)}],
        }
        text = json.dumps(tree, allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self._data), b"BIN\0") + self._data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _device(self, device: ExportedDevice) -> int:
        gl_from_device = DEVICE_FROM_GL
        local = transform(
            inverse(device.world_from_device @ DEVICE_FROM_GL),
            device.frustum_lines.reshape(-1, 3),
        )
        below = [
            self._node(
                f"{device.id}_frustum",
                mesh=self._mesh(local, None, device.kind, _LINES),
            )
        ]
        if device.body is not None and device.box is not None:
            corners = transform(device.device_from_world, device.box.corners)
            corners = transform(gl_from_device, corners)
            below.append(
                self._solid(f"{device.id}_body", corners, BOX_TRIANGLES, device.kind)
            )
        if device.device_from_mount is not None:
            pose = gl_from_device @ device.device_from_mount
            below.append(self._node(f"{device.id}_mount", matrix=_columns(pose)))
        return self._node(
            device.id,
            matrix=_columns(device.world_from_device @ DEVICE_FROM_GL),
            camera=self._added("cameras", _camera(device)),
            children=below,
            extras=_extras(device),
        )

    def _solid(
        self, name: str, vertices: Array, faces: NDArray[np.int64], material: str
    ) -> int:
        mesh = self._mesh(vertices, faces, material, _TRIANGLES)
        return self._node(name, mesh=mesh)

    def _mesh(
        self, points: Array, faces: NDArray[np.int64] | None, material: str, mode: int
    ) -> int:
        single = np.ascontiguousarray(points, dtype="<f4")
        primitive: dict[str, Any] = {
            "attributes": {
                "POSITION": self._accessor(
                    single,
                    _ARRAY,
                    _FLOAT,
                    "VEC3",
                    {
                        "min": single.min(axis=0).astype(float).tolist(),
                        "max": single.max(axis=0).astype(float).tolist(),
                    },
                )
            },
            "mode": mode,
            "material": _MATERIALS[material],
        }
        if faces is not None:
            flat = np.ascontiguousarray(faces, dtype="<u4").ravel()
            primitive["indices"] = self._accessor(flat, _INDICES, _UINT, "SCALAR", {})
        return self._added("meshes", {"primitives": [primitive]})

    def _accessor(
        self,
        values: NDArray[Any],
        target: int,
        component: int,
        kind: str,
        bounds: dict[str, Any],
    ) -> int:
        data = values.tobytes()
        view = {
            "buffer": 0,
            "byteOffset": len(self._data),
            "byteLength": len(data),
            "target": target,
        }
        self._data += data
        accessor = {
            "bufferView": self._added("bufferViews", view),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        return self._added("accessors", accessor | bounds)

    def _node(self, name: str, **entries: object) -> int:
        return self._added("nodes", {"name": name, **entries})

    def _added(self, kind: str, entry: dict[str, Any]) -> int:
        self._tree[kind].append(entry)
        return len(self._tree[kind]) - 1


def _columns(pose: Array) -> list[float]:
    return pose.T.ravel().tolist()


def _camera(device: ExportedDevice) -> dict[str, Any]:
    width, height = device.model.resolution
    far = 2.0 * device.reach_m
    if device.lens is None:
        across, down = (
            0.5 * np.array([width, height]) / np.diag(device.panel_matrix)[:2]
        )
        scope = {"xmag": across, "ymag": down, "znear": 0.0, "zfar": far}
        return {"name": device.id, "type": "orthographic", "orthographic": scope}
    fx, fy = (float(f) for f in np.diag(device.lens.camera_matrix)[:2])
    scope = {
        "yfov": float(2.0 * np.arctan(0.5 * height / fy)),
        "aspectRatio": width / height * fy / fx,
        "znear": _NEAR_M,
        "zfar": far,
    }
    return {"name": device.id, "type": "perspective", "perspective": scope}


def _extras(device: ExportedDevice) -> dict[str, Any]:
    return {
        "kind": device.kind,
        "existing": device.planned.existing,
        **device.model.to_document(),
        "lens_shift_px": device.lens_shift.tolist(),
        "world_from_device": device.world_from_device.tolist(),
    }
