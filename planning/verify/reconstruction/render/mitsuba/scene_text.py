"""A rig as a scene of Mitsuba 3, written without Mitsuba.

Lengths are metres in the mesh's world. Mitsuba's devices look along +z, with x to the
left and y up, and pixel (0, 0) begins at 0; ours (OpenCV) have x to the right, y down,
and the centre of that pixel at 0. A panel W pixels wide whose principal point is c and
whose focal length is f therefore shows at (x_m, y_m, z) of Mitsuba's frame what lies at
::

    x = (W/2 - 1/2 - c_x) z / f_x - x_m
    y = (H/2 - 1/2 - c_y) z / f_y - y_m f_x / f_y

of ours: a shear, which a projector's `to_world` may hold. A camera's may not; its film
is the part of a larger one that has the principal point in its middle.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from planning.model.devices.bodies import Body
from planning.model.errors import InputError
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.patterns.defocus import Defocus
from planning.verify.reconstruction.scanner import Scanner

MATERIALS = "materials"
# What the parameters of a scene are unless others are given.
DEFAULTS = {"material": "matt", "max_depth": 4, "spp": 64}
# Parallel light comes from a projector so far away [m]: 0.2 m off the axis it strays by
# 0.2 um over 0.1 m of depth about the object's middle.
_FAR_M = 1e5
# Mitsuba refuses a camera that is stretched by more.
_MOST_STRETCHED = 1e-4


class SceneError(InputError):
    """A rig that a scene of Mitsuba can't hold."""


@dataclass(frozen=True)
class Window:
    """A part of a camera's image: top-left pixel (u, v), columns and rows."""

    left: int
    top: int
    width: int
    height: int

    @classmethod
    def whole(cls, camera: CameraCalibration) -> Self:
        """Return all of a camera's image."""
        return cls(0, 0, *camera.resolution)


@dataclass(frozen=True)
class Shine:
    """What a projector does in a scene.

    Attributes:
        projector: That shines.
        frame: The image that it shows unless another is given.
        pupil: Points (x, y) of its pupil in device axes [m], which share the light; at
            the distance in focus all put the same pixel in the same place.
    """

    projector: ProjectorCalibration
    frame: str
    pupil: Sequence[tuple[float, float]] = ((0.0, 0.0),)


def scene_text(
    scanner: Scanner,
    shine: Shine | None,
    windows: Sequence[Window],
    *,
    ambient: float = 0.0,
) -> str:
    """Return a scene file: one projector's light on the object, and all cameras.

    Sensors are in the order of the rig's cameras, one a window. Parameters of the file
    are those of `DEFAULTS`, and `frame`.

    Args:
        scanner: What stands there.
        shine: Which projector shines, and what; None: none does.
        windows: What is rendered of each camera's image.
        ambient: Radiance of the room; a white surface has 1 where the projector's light
            falls on it squarely, at the depth of the object's middle.

    Raises:
        SceneError: If a camera has a lens that Mitsuba lacks.
    """
    defaults = DEFAULTS if shine is None else DEFAULTS | {"frame": shine.frame}
    parts = [f'<default name="{k}" value="{value}"/>' for k, value in defaults.items()]
    parts.append(f'<include filename="{MATERIALS}/$material.xml"/>')
    if shine is not None:
        parts += _light(scanner, shine)
    if ambient > 0.0:
        parts.append(_tag("emitter", "constant", _value("rgb", "radiance", ambient)))
    parts += [
        _camera(camera, window, camera.focus)
        for camera, window in zip(scanner.cameras, windows, strict=True)
    ]
    parts += _dark(scanner, None if shine is None else shine.projector)
    return scene_of(parts)


def scene_of(parts: Iterable[str]) -> str:
    """Return a file of these elements."""
    return "\n".join(['<scene version="3.0.0">', *parts, "</scene>", ""])


def obstacle_names(scanner: Scanner) -> list[str]:
    """Return the names of the mesh files of a rig's obstacles, in their order."""
    return [f"obstacle{k}.ply" for k in range(len(scanner.obstacles))]


def _light(scanner: Scanner, shine: Shine) -> list[str]:
    """The image that is projected, and a pinhole for each point of the pupil."""
    projector = shine.projector
    depth = max(float((scanner.mesh.centre - projector.centre) @ projector.axis), 1e-3)
    half = 0.5 * projector.resolution[0] / float(projector.matrix[0, 0])
    if projector.light.name == "parallel":
        # In this light `matrix` gives metres on the panel, not slopes.
        depth += _FAR_M
        half /= depth
    image = _tag(
        "texture",
        "bitmap",
        _value("string", "filename", "$frame"),
        _value("boolean", "raw", "true"),
        _value("string", "filter_type", "nearest"),
        _value("string", "wrap_mode", "clamp"),
        name="irradiance",
    )
    # Each light has the image as its own: Mitsuba 3.6 loads a scene by several threads,
    # and crashes where many refer to one.
    return [
        _tag(
            "emitter",
            "projector",
            image,
            _value("float", "fov", float(np.rad2deg(2.0 * np.arctan(half)))),
            _value("float", "scale", depth**2 / len(shine.pupil)),
            _pose(world_from_light(projector, point, scanner.projector_focus)),
            id=f"light{k or ''}",
        )
        for k, point in enumerate(shine.pupil)
    ]


def world_from_light(
    projector: ProjectorCalibration, point: tuple[float, float], focus: Defocus | None
) -> Array:
    """Return the pose with shear, (4, 4), of a projector at a point of its pupil."""
    focal = np.diag(projector.matrix)[:2]
    device_from_light = np.diag([-1.0, -focal[0] / focal[1], 1.0, 1.0])
    if projector.light.name == "parallel":
        device_from_light[2, 3] = -_FAR_M
    else:
        middle = 0.5 * (np.array(projector.resolution) - 1.0)
        device_from_light[:2, 2] = (middle - projector.matrix[:2, 2]) / focal
        if focus is not None:
            device_from_light[:2, 2] -= np.array(point) / focus.focus_m
            device_from_light[:2, 3] = point
    return projector.world_from_device @ device_from_light


def _camera(camera: CameraCalibration, window: Window, focus: Defocus | None) -> str:
    """A sensor whose film is a part of one about the principal point."""
    fx, fy = (float(f) for f in np.diag(camera.matrix)[:2])
    if any(camera.distortion):
        raise SceneError(
            f"{camera.id}: its lens distorts (k1, k2, p1, p2, k3 = "
            f"{', '.join(f'{k:g}' for k in camera.distortion)}), and Mitsuba has no "
            f"such lens; undistort its images and give the plan a camera without, or "
            f"use the built-in renderer"
        )
    if not abs(fx / fy - 1.0) <= _MOST_STRETCHED:
        raise SceneError(
            f"{camera.id}: focal lengths {fx:g} and {fy:g} px differ by "
            f"{abs(fx / fy - 1.0):.2%}, and Mitsuba's pixels are square (to "
            f"{_MOST_STRETCHED:.2%}); use the built-in renderer"
        )
    begin = camera.matrix[:2, 2] + 0.5 - np.array([window.left, window.top])
    size = np.array([window.width, window.height])
    # Whole pixels to the middle of the film, beyond either side of the window.
    reach = np.ceil(np.maximum(np.maximum(begin, size - begin), 1.0)).astype(int)
    offset = np.rint(reach - begin).astype(int)
    rest = reach - begin - offset
    device_from_camera = np.diag([-1.0, -fx / fy, 1.0, 1.0])
    device_from_camera[:2, 2] = rest / np.array([fx, fy])
    columns, rows = 2 * (reach + 1)
    numbers = {
        "width": columns,
        "height": rows,
        "crop_offset_x": offset[0] + 1,
        "crop_offset_y": offset[1] + 1,
        "crop_width": size[0],
        "crop_height": size[1],
    }
    film = _tag(
        "film",
        "hdrfilm",
        *(_value("integer", key, int(number)) for key, number in numbers.items()),
        _value("string", "pixel_format", "rgb"),
        _value("string", "component_format", "float32"),
        _value("boolean", "sample_border", "false"),
        '<rfilter type="box"/>',
    )
    sampler = _tag("sampler", "multijitter", _value("integer", "sample_count", "$spp"))
    lens = [
        _value("float", "fov", float(np.rad2deg(2.0 * np.arctan(0.5 * columns / fx)))),
        _value("string", "fov_axis", "x"),
        _value("float", "near_clip", _before(camera.body)),
        _value("float", "far_clip", 1e4),
    ]
    kind = "perspective"
    if focus is not None:
        kind = "thinlens"
        lens += [
            _value("float", "aperture_radius", 0.5 * focus.aperture_m),
            _value("float", "focus_distance", focus.focus_m),
        ]
    pose = _pose(camera.world_from_device @ device_from_camera)
    return _tag("sensor", kind, *lens, pose, film, sampler, id=camera.id)


def _before(body: Body | None) -> float:
    """Depth [m] from which a camera sees: beyond its own housing."""
    front = 0.0 if body is None else body.centre_m[2] + body.half_m[2]
    return max(1e-3, 1e-3 + front)


def _dark(scanner: Scanner, shining: ProjectorCalibration | None) -> list[str]:
    """Housings and obstacles, which reflect nothing.

    The housing of the projector that shines ends at its optical centre; what stands at
    other stations isn't there.
    """
    stations = ("",) if shining is None else ("", shining.station)
    black = '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
    shapes: list[str] = []
    for device in (*scanner.projectors, *scanner.cameras):
        if device.body is None or device.station not in stations:
            continue
        middle, half = np.array(device.body.centre_m), np.array(device.body.half_m)
        low, high = middle - half, middle + half
        if device is shining:
            high[2] = min(high[2], -1e-4)
        if not low[2] < high[2]:
            continue
        box = np.eye(4)
        box[:3, :3] = np.diag(0.5 * (high - low))
        box[:3, 3] = 0.5 * (high + low)
        shapes.append(
            _tag("shape", "cube", _pose(device.world_from_device @ box), black)
        )
    for name, solid in zip(obstacle_names(scanner), scanner.obstacles, strict=True):
        if solid.station in stations:
            file = _value("string", "filename", name)
            shapes.append(_tag("shape", "ply", file, black))
    return shapes


def _pose(matrix: Array) -> str:
    numbers = " ".join(repr(float(value)) for value in matrix.ravel())
    return f'<transform name="to_world"><matrix value="{numbers}"/></transform>'


def _value(kind: str, name: str, value: object) -> str:
    return f'<{kind} name="{name}" value="{value}"/>'


def _tag(element: str, kind: str, *parts: str, **names: str) -> str:
    name = "".join(f' {key}="{value}"' for key, value in names.items())
    inside = "".join(f"\n  {line}" for part in parts for line in part.splitlines())
    return f'<{element} type="{kind}"{name}>{inside}\n</{element}>'
