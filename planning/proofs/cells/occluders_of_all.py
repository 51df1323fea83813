"""What stands in the way of every device, wherever in the workspace it may be."""

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.visibility import Visibility
from geometry.shapes.clipping import clipped_to_ball
from planning.scene.scene import Scene


def occluders_of_all(scene: Scene, nearest_m: float) -> Visibility:
    """Return the object, and of obstacles what is nearer than any device may be.

    A ray from a sample to a device leaves the ball about the centre of the workspace
    before it ends, so that whatever it meets in there is in its way.

    Args:
        scene: Surface, obstacles and requirements.
        nearest_m: Least distance of devices from the centre of the workspace [m].
    """
    centre = np.array(scene.requirements.workspace.centre)
    inside = [
        clipped_to_ball(solid.mesh, centre, nearest_m) for solid in scene.obstructions
    ]
    meshes = [scene.mesh, *(mesh for mesh in inside if mesh is not None)]
    if len(meshes) == 1:
        return scene.visibility
    # Samples name their faces: those of the object come first.
    return Visibility(TriangleMesh.joined(meshes), threads=scene.threads)
