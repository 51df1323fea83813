"""Run by a Python that has `bpy`: build a rig by its script, tell pixels of points.

python inside_blender.py FOLDER, which holds build_rig.py and points.npz.
"""

import runpy
import sys
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

folder = Path(sys.argv[1])
runpy.run_path(str(folder / "build_rig.py"))
found = {}
for name, points in np.load(folder / "points.npz").items():
    scene = bpy.data.scenes[name]
    bpy.context.window.scene = scene
    bpy.context.view_layer.update()
    render = scene.render
    width, height = render.resolution_x, render.resolution_y
    seen = [world_to_camera_view(scene, scene.camera, Vector(p)) for p in points]
    found[name] = np.array([[x * width, (1 - y) * height] for x, y, _ in seen]) - 0.5
np.savez(folder / "pixels.npz", version=bpy.app.version_string, **found)
