"""USD: one stage as text, which needs no library of USD's."""

import numpy as np

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import transform

from .exported_rig import (
    BOX_QUADS,
    DEVICE_FROM_GL,
    Content,
    ExportedDevice,
    ExportedRig,
    id_words,
    numbers,
)

# Apertures and focal lengths count in tenths of the stage's unit.
_TENTHS = 10.0
# Width of the sensor that lenses are told for [m]: only ratios matter to a projection.
_SENSOR_M = 0.036
_LINE_M = 5e-4


class UsdStage:
    """`rig.usda`."""

    name = "usd"
    what = "USD stage"
    notes = (
        "rig.usda: /rig/object, /rig/obstacles and an Xform a device with its Camera",
        "`optics`, `body`, `frustum` and `mount`. Metres; cameras look along -z with +y",
        "up; lens shift is the apertures' offset, parallel light an orthographic camera.",
        "The attributes ringrig:* of an Xform hold K, distortion and size in double",
        "precision; USD's own attributes of cameras are single.",
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return a sentence for distortion."""
        if not rig.distorted:
            return []
        return [
            f"{id_words(rig.distorted)}: distortion stands in ringrig:distortion alone, "
            f"USD's cameras have none"
        ]

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return `rig.usda`."""
        axis = "Y" if int(np.argmax(np.abs(rig.up))) == 1 else "Z"
        obstacles = [
            _mesh(f"obstacle{index}", mesh, name)
            for index, (name, mesh) in enumerate(rig.obstacles.items())
        ]
        parts = [_mesh("object", rig.mesh), *obstacles, *map(_device, rig.devices)]
        text = f'''#usda 1.0
(
    defaultPrim = "rig"
    metersPerUnit = 1
    upAxis = "{axis}"
    customLayerData = {{
        string plan = "{rig.plan.digest}"
    }}
)

{_prim("Xform", "rig", parts)}
'''
        return {"rig.usda": text.encode()}


def _device(device: ExportedDevice) -> str:
    width, height = device.model.resolution
    parts = [
        _pose(device.world_from_device @ DEVICE_FROM_GL),
        f'custom string ringrig:kind = "{device.kind}"',
        f"custom double[] ringrig:matrix = [{numbers(device.panel_matrix)}]",
        f"custom double[] ringrig:distortion = [{numbers(device.distortion)}]",
        f"custom int2 ringrig:resolution = ({width}, {height})",
        _prim("Camera", "optics", _camera(device)),
    ]
    gl_from_world = DEVICE_FROM_GL @ device.device_from_world
    if device.box is not None:
        corners = transform(gl_from_world, device.box.corners)
        sides = [
            f"int[] faceVertexCounts = [{', '.join(['4'] * 6)}]",
            f"int[] faceVertexIndices = {[i for quad in BOX_QUADS for i in quad]}",
            f"point3f[] points = {_points(corners)}",
            'uniform token subdivisionScheme = "none"',
        ]
        parts.append(_prim("Mesh", "body", sides))
    lines = transform(gl_from_world, device.frustum_lines.reshape(-1, 3))
    curves = [
        'uniform token type = "linear"',
        f"int[] curveVertexCounts = {[2] * (len(lines) // 2)}",
        f"point3f[] points = {_points(lines)}",
        f'float[] widths = [{_LINE_M}] (interpolation = "constant")',
    ]
    parts.append(_prim("BasisCurves", "frustum", curves))
    if device.device_from_mount is not None:
        pose = DEVICE_FROM_GL @ device.device_from_mount
        parts.append(_prim("Xform", "mount", [_pose(pose)]))
    return _prim("Xform", device.id, parts)


def _camera(device: ExportedDevice) -> list[str]:
    size = np.array(device.model.resolution, dtype=np.float64)
    focal = np.diag(device.panel_matrix)[:2]
    kind, length = "perspective", _SENSOR_M * focal[0] / size[0]
    # Size of a pixel, and thereby of the aperture, at the focal length [m].
    pixel = length / focal
    if device.lens is None:
        kind, pixel = "orthographic", 1.0 / focal
    across, down = _TENTHS * pixel * size
    # The middle of the image lies aside of the axis, in USD's axes.
    aside, upward = _TENTHS * pixel * device.lens_shift * [1.0, -1.0]
    lines = {
        "horizontalAperture": across,
        "verticalAperture": down,
        "horizontalApertureOffset": aside,
        "verticalApertureOffset": upward,
        "focalLength": _TENTHS * length,
    }
    near, far = (0.01, 10.0 * device.reach_m)
    return [
        f'token projection = "{kind}"',
        *(f"float {key} = {float(value)!r}" for key, value in lines.items()),
        f"float2 clippingRange = ({near}, {far})",
    ]


def _mesh(name: str, mesh: TriangleMesh, title: str = "") -> str:
    flat = ", ".join(map(str, mesh.faces.ravel().tolist()))
    parts = [
        f"int[] faceVertexCounts = [{', '.join(['3'] * len(mesh.faces))}]",
        f"int[] faceVertexIndices = [{flat}]",
        f"point3f[] points = {_points(mesh.vertices)}",
        'uniform token subdivisionScheme = "none"',
    ]
    if title:
        quoted = title.replace("\\", "\\\\").replace('"', '\\"')
        parts.append(f'custom string ringrig:name = "{quoted}"')
    return _prim("Mesh", name, parts)


def _points(points: Array) -> str:
    return f"[{', '.join(f'({x!r}, {y!r}, {z!r})' for x, y, z in points.tolist())}]"


def _pose(pose: Array) -> str:
    # USD's vectors are rows: its matrices are ours transposed.
    rows = ", ".join(f"({numbers(row)})" for row in pose.T)
    return (
        f"matrix4d xformOp:transform = ( {rows} )\n"
        'uniform token[] xformOpOrder = ["xformOp:transform"]'
    )


def _prim(kind: str, name: str, parts: list[str]) -> str:
    inside = "".join(f"\n    {line}" for part in parts for line in part.splitlines())
    return f'def {kind} "{name}"\n{{{inside}\n}}'
