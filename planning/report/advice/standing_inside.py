"""Devices that stand inside the object, where nothing is lit or measured."""

from collections.abc import Sequence

import numpy as np

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene.scene import Scene


def standing_inside(
    scene: Scene, devices: Sequence[PlannedProjector | PlannedCamera]
) -> str:
    """Return how many poses stand inside the object and what to do, or nothing.

    From there a ray away from the object's centre meets the surface from behind.
    """
    space = scene.requirements.workspace
    places = np.stack([device.world_from_device[:3, 3] for device in devices])
    outwards = places - np.array(space.centre)
    length = np.linalg.norm(outwards, axis=1, keepdims=True)
    ways = np.where(length > 0.0, outwards / np.maximum(length, 1e-300), space.up)
    faces, _ = scene.visibility.caster.first_hits(places, ways)
    met = faces >= 0
    along = np.einsum("ij,ij->i", scene.mesh.face_normals[faces[met]], ways[met])
    n = int((along > 0.0).sum())
    if not n:
        return ""
    return (
        f"; {n} of {len(devices)} poses stand inside the object or behind its surface: "
        f"raise placement.standoff_mm, or move the workspace out"
    )
