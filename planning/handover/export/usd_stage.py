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
# What may be up in a stage, and what is said where neither is; turns round by so much.
_UP_AXES = {"Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
_ELSE_UP, _SAME_AXIS = "Z", 1e-9
# Sizes of a lens that are tried for one that single precision keeps.
_SIZES = 1 << 20


class UsdStage:
    """`rig.usda`."""

    name = "usd"
    what = "USD stage"
    notes = (
        "rig.usda: /rig/object, /rig/obstacles and an Xform a device with its "
        "Camera `optics`, `body`, `frustum` and `mount`. Metres; cameras look along "
        "-z with +y up; lens shift is the apertures' offset, parallel light an "
        "orthographic camera. The attributes ringrig:* of an Xform hold K, "
        "distortion and size in double precision; USD's own attributes of cameras "
        "are single."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return a sentence for distortion, and one for an up that isn't +y or +z."""
        sentences: list[str] = []
        if rig.distorted:
            sentences.append(
                f"{id_words(rig.distorted)}: distortion stands in ringrig:distortion "
                f"alone, USD's cameras have none"
            )
        if _up_axis(rig) is None:
            x, y, z = _up(rig) + 0.0
            sentences.append(
                f"up is ({x:.4g}, {y:.4g}, {z:.4g}) in this frame; USD's upAxis, which "
                f"is +y or +z alone, says {_ELSE_UP}"
            )
        return sentences

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return `rig.usda`."""
        axis = _up_axis(rig) or _ELSE_UP
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


def _up(rig: ExportedRig) -> Array:
    """Return where the plan's up points to in the frame, however that is turned."""
    turn = rig.frame.frame_from_mesh[:3, :3]
    return turn @ np.array(rig.plan.requirements.workspace.up)


def _up_axis(rig: ExportedRig) -> str | None:
    """Return what USD calls the plan's up; None: it has no word for it."""
    for name, axis in _UP_AXES.items():
        if np.abs(_up(rig) - axis).max() <= _SAME_AXIS:
            return name
    return None


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
    # The middle of the image lies aside of the axis, in USD's axes.
    aside = pixel * device.lens_shift * [1.0, -1.0]
    values = _TENTHS * np.array([length, *(pixel * size), *aside])
    if device.lens is not None:
        values *= _best_scale(values, size)
    names = (
        *("focalLength", "horizontalAperture", "verticalAperture"),
        *("horizontalApertureOffset", "verticalApertureOffset"),
    )
    near, far = (0.01, 10.0 * device.reach_m)
    return [
        f'token projection = "{kind}"',
        *(f"float {k} = {float(v)!r}" for k, v in zip(names, values, strict=True)),
        f"float2 clippingRange = ({near}, {far})",
    ]


def _best_scale(values: Array, size: Array) -> float:
    """Return the factor of 1 to 2 that single precision hurts least.

    Only ratios of focal length, apertures and offsets matter, so that a lens may be
    told larger: of many sizes one has ratios that survive rounding, to 1e-6 px instead
    of 1e-4 px.
    """
    scale = np.linspace(1.0, 2.0, _SIZES, endpoint=False)
    length, *rest = (
        (value * scale).astype(np.float32).astype(np.float64) for value in values
    )
    worst = np.zeros(_SIZES)
    for axis in (0, 1):
        aperture, aside = rest[axis], rest[2 + axis]
        off_focal = length / aperture * (values[1 + axis] / values[0]) - 1.0
        off_middle = aside / aperture - values[3 + axis] / values[1 + axis]
        # At the image's border a focal length's share counts with the distance there.
        reach = 0.5 + abs(values[3 + axis] / values[1 + axis])
        off = size[axis] * (np.abs(off_focal) * reach + np.abs(off_middle))
        worst = np.maximum(worst, off)
    return float(scale[int(np.argmin(worst))])


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
