"""Run by a Python that has `bpy`: build a rig by its script, tell pixels of points.

python inside_blender.py FOLDER, which holds build_rig.py, points.npz and patterns/.
What Blender keeps of each camera, in single precision, goes into kept.json. The light
of the first projector with a pattern is rendered by Cycles onto a plane before it, as
seen from its own place: what it shows must be its pattern, pixel for pixel.
"""

import contextlib
import json
import os
import runpy
import sys
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector

PLANE = [(-3.0, -3.0, -1.0), (3.0, -3.0, -1.0), (3.0, 3.0, -1.0), (-3.0, 3.0, -1.0)]


def pixels(folder: Path) -> dict[str, np.ndarray]:
    """Return pixels of the points by device."""
    found = {}
    for name, points in np.load(folder / "points.npz").items():
        scene = bpy.data.scenes[name]
        bpy.context.window.scene = scene
        bpy.context.view_layer.update()
        width, height = scene.render.resolution_x, scene.render.resolution_y
        seen = [world_to_camera_view(scene, scene.camera, Vector(p)) for p in points]
        places = [[x * width, (1 - y) * height] for x, y, _ in seen]
        found[name] = np.array(places) - 0.5
    return found


def kept(device: dict) -> dict:
    """Return the numbers of a camera as Blender has them after the script ran."""
    scene = bpy.data.scenes[device["id"]]
    camera, render = scene.camera.data, scene.render
    return {
        "pose": [list(row) for row in scene.camera.matrix_world],
        "K": device["K"],
        "focal": camera.lens / camera.sensor_width,
        "width_m": camera.ortho_scale,
        "shift": [camera.shift_x, camera.shift_y],
        "pixel_aspect": [render.pixel_aspect_x, render.pixel_aspect_y],
        "resolution": [render.resolution_x, render.resolution_y],
    }


def light(folder: Path, device: dict) -> str:
    """Return how far the rendered pattern lies off, by correlation."""
    name = device["id"]
    for thing in list(bpy.data.objects):
        shines = thing.type == "LIGHT" and thing.name != f"{name}_light"
        if thing.type == "MESH" or shines:
            bpy.data.objects.remove(thing)
    plane = bpy.data.meshes.new("plane")
    plane.from_pydata(PLANE, [], [(0, 1, 2, 3)])
    screen = bpy.data.objects.new("plane", plane)
    screen.matrix_world = Matrix(device["world_from_view"])
    bpy.data.collections["rig"].objects.link(screen)
    scene = bpy.data.scenes[name]
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.cycles.pixel_filter_type = "BOX"
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "BW"
    scene.render.filepath = str(folder / "seen.png")
    # Cycles tells of its progress on stdout.
    with open(os.devnull, "w") as quiet, contextlib.redirect_stdout(quiet):
        bpy.ops.render.render(write_still=True, scene=name)
    seen, shown = grey(folder / "seen.png"), grey(folder / device["pattern"])
    steps = range(-2, 3)
    match = {
        (x, y): float(np.mean(np.roll(seen, (y, x), (0, 1)) * shown))
        for x in steps
        for y in steps
    }
    best = max(match, key=match.get)
    beside = max(value for key, value in match.items() if key != best)
    return (
        f"Cycles shows {name}'s pattern off by {best} px (correlation "
        f"{match[best]:.3f}, one pixel aside at most {beside:.3f})"
    )


def grey(path: Path) -> np.ndarray:
    """Return an image's first channel about its mean, of deviation 1."""
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    levels = np.array(image.pixels[:]).reshape(height, width, -1)[::-1, :, 0]
    return (levels - levels.mean()) / levels.std()


if __name__ == "__main__":
    place = Path(sys.argv[1])
    devices = runpy.run_path(str(place / "build_rig.py"))["DEVICES"]
    found = pixels(place)
    numbers = {device["id"]: kept(device) for device in devices}
    (place / "kept.json").write_text(json.dumps(numbers))
    shining = [d for d in devices if d["pattern"] and d["K"] is not None]
    told = light(place, shining[0]) if shining else "no projector shows an image"
    version = bpy.app.version_string
    np.savez(place / "pixels.npz", version=version, light=told, **found)
