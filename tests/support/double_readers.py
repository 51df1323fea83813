"""Pixels of points by what files hold, in double precision.

Mitsuba and Blender compute in single precision, in which a pixel near 2,000 comes in
steps of 1.2e-4 px. These readers tell how far the files themselves are off.
"""

import ast
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from support.camera_readers import Points

Array = NDArray[np.float64]


def mitsuba_in_double(folder: Path, points: Points) -> dict[str, Array]:
    """By Mitsuba's own parser and its transforms of doubles (3.6: `xml_to_props`).

    Its wheels have no variant in double precision. The chain is the one of
    `perspective_projection` in Mitsuba's sensor.h, which computes in single precision.
    A projector with a pupil is many pinholes about its middle: their mean.
    """
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    found: dict[str, Array] = {}
    for path in sorted(folder.glob("*.xml")):
        parts = [properties for _, properties in mi.xml_to_props(str(path))]
        films = {part.id(): part for part in parts if part.plugin_name() == "hdrfilm"}
        with Image.open(folder / "patterns" / path.stem / "00-white.png") as white:
            size = white.size
        lights = [part for part in parts if part.plugin_name() == "projector"]
        at = points[path.stem]
        lit = [_seen(mi, light, at, size, size) for light in lights]
        found[path.stem] = np.mean(lit, axis=0)
        for part in parts:
            if part.plugin_name() in ("perspective", "thinlens"):
                refers = {value for _, value in part.named_references()}
                film = next(film for name, film in films.items() if name in refers)
                whole = film["width"], film["height"]
                crop = film["crop_width"], film["crop_height"]
                offset = film["crop_offset_x"], film["crop_offset_y"]
                at = points[part.id()]
                found[part.id()] = _seen(mi, part, at, whole, crop, offset)
    return found


def _seen(
    mi: Any,
    device: Any,
    points: Array,
    film: tuple[int, int],
    crop: tuple[int, int],
    offset: tuple[int, int] = (0, 0),
) -> Array:
    aspect = film[0] / film[1]
    near = device.get("near_clip", 1e-4)
    far = device.get("far_clip", 1e4)
    transform = mi.ScalarTransform4d
    chain = (
        transform()
        .scale([film[0] / crop[0], film[1] / crop[1], 1.0])
        .translate([-offset[0] / film[0], -offset[1] / film[1], 0.0])
        .scale([-0.5, -0.5 * aspect, 1.0])
        .translate([-1.0, -1.0 / aspect, 0.0])
        .perspective(device["fov"], near, far)
    )
    local = np.array(device["to_world"].inverse().matrix) @ _four(points)
    shown = np.array(chain.matrix) @ local
    return (shown[:2] / shown[3]).T * crop - 0.5


def blender_in_double(folder: Path, points: Points) -> dict[str, Array]:
    """By the numbers of build_rig.py, before Blender rounds them."""
    tree = ast.parse((folder / "build_rig.py").read_text())
    devices: Iterable[dict[str, Any]] = next(
        ast.literal_eval(line.value)
        for line in tree.body
        if isinstance(line, ast.Assign) and line.targets[0].id == "DEVICES"
    )
    return {
        each["id"]: blender_pixels(points[each["id"]], each["world_from_view"], each)
        for each in devices
    }


def blender_pixels(points: Array, pose: Any, device: dict[str, Any]) -> Array:
    """Pixels (n, 2) of a camera of Blender whose sensor fits the width.

    Args:
        points: Places (n, 3) in the world.
        pose: `matrix_world` of the camera, (4, 4).
        device: `focal` over the image's width or `width_m` of parallel light,
            `shift`, `pixel_aspect` and `resolution`.
    """
    local = np.linalg.solve(np.array(pose, dtype=np.float64), _four(points))
    parallel = device["K"] is None
    across = local[:2] / (device["width_m"] if parallel else -local[2])
    if not parallel:
        across *= device["focal"]
    width, height = device["resolution"]
    aspect = device["pixel_aspect"]
    x, y = width * (across - np.reshape(device["shift"], (2, 1)))
    rise = y * aspect[0] / aspect[1]
    return np.column_stack([0.5 * width + x, 0.5 * height - rise]) - 0.5


def _four(points: Array) -> Array:
    return np.vstack([points.T, np.ones(len(points))])
