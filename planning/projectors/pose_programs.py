"""The pose program of section III for what stands in a scene: projectors, and heads."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from geometry.arrays import Array
from geometry.devices import PinholeModel
from geometry.poses import inverse
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits, Workspace
from planning.scene.codes.patterns import pattern_of
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.scene.workspace.admissible import half_spaces
from solvers.poses.pose_problem import PoseProgram

# A pixel of the image border stays free, so that rounding the pose loses nothing.
_PIXEL_MARGIN = 1.0
_MAX_MOVE_M = 0.3


def pose_program(
    scene: Scene, projector: PlannedProjector, assigned: Target
) -> PoseProgram:
    """State the pose program of one projector over the samples assigned to it."""
    device, workspace = projector.device, scene.safe_workspace
    return PoseProgram(
        light=projector.light,
        shell_m=workspace.projector_radius_m,
        range_m=device.range_m,
        sides=device.sides(_PIXEL_MARGIN),
        beam_radius_m=device.beam_reach,
        ring_radius=pattern_of(projector).outermost,
        ring_from_device=inverse(projector.world_from_ring)
        @ projector.world_from_device,
        **_of(scene.requirements.projector, workspace, projector.world_from_device),
        **_served(assigned),
    )


def view_program(
    scene: Scene,
    workspace: Workspace,
    view: PinholeModel,
    pose: Array,
    assigned: Target,
) -> PoseProgram:
    """State the pose program of a head: of a source that lights its measuring volume.

    Args:
        scene: Surface and limits.
        workspace: Where the origin of its frame may stand, as cameras may.
        view: From that origin, the field of the volume.
        pose: Where it begins, (4, 4).
        assigned: Samples that it must serve.
    """
    return PoseProgram(
        light="diverging",
        shell_m=workspace.camera_radius_m,
        range_m=view.range_m,
        sides=view.sides(),
        **_of(scene.requirements.projector, workspace, pose),
        **_served(assigned),
    )


def part_of_the_way(start: Array, end: Array, share: float) -> Array:
    """Return the pose a share of the way from one to another, (4, 4).

    The origin moves straight; the frame turns about one axis.
    """
    if share == 1.0:
        return end
    turns = Rotation.from_matrix(np.stack([start[:3, :3], end[:3, :3]]))
    pose = np.eye(4)
    pose[:3, :3] = Slerp([0.0, 1.0], turns)(share).as_matrix()
    pose[:3, 3] = (1.0 - share) * start[:3, 3] + share * end[:3, 3]
    return pose


def _served(assigned: Target) -> dict[str, Any]:
    samples = assigned.samples
    return {
        "points": samples.points,
        "normals": samples.normals,
        "steep": assigned.steep,
    }


def _of(limits: ProjectorLimits, workspace: Workspace, pose: Array) -> dict[str, Any]:
    """Eq. (2)'s limits, and where what begins at a pose may stand."""
    up, centre = np.array(workspace.up), np.array(workspace.centre)
    normals, offsets = half_spaces(workspace, pose[:3, 3] - centre)
    floor = -np.inf
    if workspace.floor_m is not None:
        floor = workspace.floor_m + float(up @ centre)
    return {
        "world_from_device": pose,
        "max_incidence": limits.max_incidence,
        "min_tangent_angle": limits.min_tangent_angle,
        "centre": centre,
        "axis": np.array(workspace.axis),
        "half_angle": workspace.half_angle,
        "up": up,
        "floor": floor,
        "max_move_m": _MAX_MOVE_M,
        "half_spaces": np.column_stack([normals, offsets + normals @ centre]),
    }
