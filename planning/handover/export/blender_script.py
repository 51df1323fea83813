"""Blender: a script that builds cameras, projector lights, housings and the object."""

import io
import pprint
from typing import Any

import numpy as np

from planning.verify.reconstruction.pattern_files import FOLDER, pattern_contents
from planning.verify.reconstruction.scanner import Scanner

from .exported_rig import (
    BOX_TRIANGLES,
    DEVICE_FROM_GL,
    Content,
    ExportedDevice,
    ExportedRig,
    id_words,
)

_MESHES = "meshes.npz"
# Frame that lights show: the first whose rings are a code; 0 and 1 are white and black.
_SHOWN = 2
# Beyond the image's corners, so that the cone cuts nothing off [rad].
_SPARE = np.deg2rad(1.0)

_SCRIPT = '''"""Builds a rig in Blender (4.2 or later): blender --python build_rig.py

A scene for each device has its resolution and pixel aspect, and its view as camera. All
show one collection. Lengths are metres; Blender keeps them in single precision.
"""

from math import pi
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

HERE = Path(__file__).resolve().parent
LIGHT_W = 100.0
SENSOR_MM = 36.0
DEVICES = {devices}


def main():
    rig = bpy.data.collections.new("rig")
    bpy.context.scene.collection.children.link(rig)
    meshes = np.load(HERE / "{meshes}")
    for name in [key[:-9] for key in meshes if key.endswith("_vertices")]:
        solid(rig, name, meshes[name + "_vertices"], meshes[name + "_faces"])
    for device in DEVICES:
        build(rig, device)


def build(rig, device):
    pose = Matrix(device["world_from_view"])
    view = placed(rig, device["id"], camera_of(device), pose)
    for key in ("kind", "K", "distortion", "resolution", "pixel_pitch_m"):
        if device[key] is not None:
            view["ringrig_" + key] = device[key]
    scene = bpy.data.scenes.new(device["id"])
    scene.collection.children.link(rig)
    scene.camera = view
    scene.render.engine = "CYCLES"
    render = scene.render
    render.resolution_x, render.resolution_y = device["resolution"]
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = device["pixel_aspect"]
    if device["kind"] == "projector":
        placed(rig, device["id"] + "_light", light_of(device), pose)
    if device["body"]:
        solid(rig, device["id"] + "_body", device["body"], device["body_faces"], pose)
    if device["world_from_mount"]:
        mount = Matrix(device["world_from_mount"])
        mount = placed(rig, device["id"] + "_mount", None, mount)
        mount.empty_display_type, mount.empty_display_size = "ARROWS", 0.05


def camera_of(device):
    camera = bpy.data.cameras.new(device["id"])
    camera.sensor_fit = "HORIZONTAL"
    camera.sensor_width = SENSOR_MM
    camera.clip_start, camera.clip_end = 0.01, device["far_m"]
    camera.shift_x, camera.shift_y = device["shift"]
    if device["K"] is None:
        camera.type, camera.ortho_scale = "ORTHO", device["width_m"]
    else:
        camera.lens = SENSOR_MM * device["focal"]
    return camera


def light_of(device):
    if device["K"] is None:
        sun = bpy.data.lights.new(device["id"], "SUN")
        sun.angle = 0.0
        return sun
    light = bpy.data.lights.new(device["id"], "SPOT")
    light.energy, light.shadow_soft_size = LIGHT_W, 0.0
    light.spot_size, light.spot_blend = min(device["cone"], pi), 0.0
    light.use_nodes = True
    tree = light.node_tree
    emission = tree.nodes["Emission"]
    image = tree.nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.load(str(HERE / device["pattern"]))
    image.image.colorspace_settings.name = "Non-Color"
    image.interpolation, image.extension = "Closest", "CLIP"
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    join = tree.nodes.new("ShaderNodeCombineXYZ")
    normal = tree.nodes.new("ShaderNodeTexCoord").outputs["Normal"]
    tree.links.new(normal, split.inputs[0])
    # A place of the image is scale * (x / z, y / z) + offset of the light's axes.
    for axis in (0, 1):
        slope = tree.nodes.new("ShaderNodeMath")
        slope.operation = "DIVIDE"
        tree.links.new(split.outputs[axis], slope.inputs[0])
        tree.links.new(split.outputs[2], slope.inputs[1])
        place = tree.nodes.new("ShaderNodeMath")
        place.operation = "MULTIPLY_ADD"
        tree.links.new(slope.outputs[0], place.inputs[0])
        place.inputs[1].default_value = device["image_scale"][axis]
        place.inputs[2].default_value = device["image_offset"][axis]
        tree.links.new(place.outputs[0], join.inputs[axis])
    tree.links.new(join.outputs[0], image.inputs[0])
    tree.links.new(image.outputs["Color"], emission.inputs["Color"])
    return light


def solid(rig, name, vertices, faces, pose=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(v) for v in vertices], [], [tuple(f) for f in faces])
    return placed(rig, name, mesh, pose or Matrix.Identity(4))


def placed(rig, name, data, pose):
    thing = bpy.data.objects.new(name, data)
    thing.matrix_world = pose
    rig.objects.link(thing)
    return thing


main()
'''


class BlenderScript:
    """`build_rig.py`, the meshes and the patterns that it loads."""

    name = "blender"
    what = "Blender script"
    notes = (
        "blender --python build_rig.py: a scene a device with its camera, "
        "resolution and pixel aspect; spot lights that project patterns/ID/*.png "
        "(change `pattern` in the script for another frame); housings, mounts, "
        "object and obstacles from meshes.npz. Metres; cameras and lights look "
        "along their -z with +y up. Blender keeps places, lenses and turns in "
        "single precision."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return a sentence for distortion, and one for parallel light."""
        sentences: list[str] = []
        if rig.distorted:
            sentences.append(
                f"{id_words(rig.distorted)}: distortion stands in ringrig_distortion "
                f"alone, Blender's cameras have none"
            )
        if rig.parallel:
            sentences.append(
                f"{id_words(rig.parallel)}: its pattern is left out, Blender's "
                f"parallel light shows no image"
            )
        return sentences

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return script, meshes and patterns."""
        patterns = pattern_contents(Scanner.of(rig.plan))
        shown = {
            device.id: [path for path in patterns if path.startswith(f"{device.id}/")]
            for device in rig.devices
        }
        devices = [
            _device(device, shown[device.id][min(_SHOWN, len(shown[device.id]) - 1)])
            if shown[device.id]
            else _device(device, "")
            for device in rig.devices
        ]
        text = pprint.pformat(devices, sort_dicts=False, compact=True)
        script = _SCRIPT.replace("{devices}", text).replace("{meshes}", _MESHES)
        return {
            "build_rig.py": script.encode(),
            _MESHES: _meshes(rig),
            **{f"{FOLDER}/{path}": write for path, write in patterns.items()},
        }


def _device(device: ExportedDevice, pattern: str) -> dict[str, Any]:
    """Return what the script reads of a device."""
    width, height = device.model.resolution
    fx, fy = (float(f) for f in np.diag(device.panel_matrix)[:2])
    aside, down = device.lens_shift.tolist()
    body = None
    if device.body is not None:
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"))
        corners = device.body.centre_m + signs.reshape(3, -1).T * device.body.half_m
        body = (corners @ DEVICE_FROM_GL[:3, :3]).tolist()
    mount = device.world_from_mount
    plain = device.model.to_document()
    cx, cy = device.panel_matrix[:2, 2].tolist()
    return {
        "id": device.id,
        "kind": device.kind,
        "world_from_view": (device.world_from_device @ DEVICE_FROM_GL).tolist(),
        "world_from_mount": None if mount is None else mount.tolist(),
        "K": plain["K"],
        "distortion": plain["distortion"],
        "resolution": [width, height],
        "pixel_pitch_m": plain["pixel_pitch_m"],
        # Blender's aspects are at least 1: height over width of a pixel is fx / fy.
        "pixel_aspect": [max(1.0, fy / fx), max(1.0, fx / fy)],
        "focal": fx / width,
        "width_m": width / fx,
        "shift": [aside / width, -down * (fx / fy) / width],
        "far_m": 10.0 * device.reach_m,
        "cone": 2.0 * (_half_cone(device) + float(_SPARE)),
        "image_scale": [-fx / width, -fy / height],
        "image_offset": [(cx + 0.5) / width, 1.0 - (cy + 0.5) / height],
        "pattern": f"{FOLDER}/{pattern}" if pattern else None,
        "body": body,
        "body_faces": BOX_TRIANGLES.tolist(),
    }


def _half_cone(device: ExportedDevice) -> float:
    if device.lens is None:
        return 0.0
    return float(np.arccos(device.lens.rays(device.lens.corners)[:, 2].min()))


def _meshes(rig: ExportedRig) -> bytes:
    named = {"object": rig.mesh}
    for index, mesh in enumerate(rig.obstacles.values()):
        named[f"obstacle{index}"] = mesh
    arrays: dict[str, Any] = {}
    for name, mesh in named.items():
        arrays |= {f"{name}_vertices": mesh.vertices, f"{name}_faces": mesh.faces}
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()
