"""The pose program of section III: each projector moves to the largest margins."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from geometry.devices import PinholeModel
from geometry.poses import inverse
from solvers.pose_program import PoseProgram, pose_margins, pose_slack, solve_pose

from . import lighting
from .lighting import Target
from .plan import PlannedProjector
from .projectors import ProjectorStage, lit_stages, margins_of
from .requirements import Workspace
from .scene import Scene
from .zone_limits import half_spaces
from .zone_positions import is_zoned

_SWEEPS = 2
_STEPS = (1.0, 0.5, 0.25)
# A pixel of the image border stays free, so that rounding the pose loses nothing.
_PIXEL_MARGIN = 1.0
_MAX_MOVE_M = 0.3


def widen_margins(scene: Scene, stage: ProjectorStage) -> tuple[PlannedProjector, ...]:
    """Return the projectors at the poses where their served samples have most margin.

    Each projector in turn solves the pose program over the samples that it serves.
    Occlusion isn't part of that program, so rays decide after every move: the whole way
    is tried, then half, then a quarter, and a move that loses a sample isn't taken.

    Args:
        scene: Surface and requirements.
        stage: Projectors from the cover, and its rows.
    """
    rows = stage.rows
    projectors = list(stage.projectors)
    lit = lit_stages(scene, projectors, rows) == lighting.LIT
    for _ in range(_SWEEPS):
        moved = False
        for p, projector in enumerate(projectors):
            if projector.existing:
                continue
            served = lighting.served_by(lit, margins_of(scene, projectors, rows)) == p
            if not served.any():
                continue
            better = _improved(scene, projector, rows, served, lit, p)
            if better is not None:
                projectors[p], lit[:, p] = better
                moved = True
        if not moved:
            break
    return tuple(projectors)


def pose_program(
    scene: Scene, projector: PlannedProjector, served: Target
) -> PoseProgram:
    """State the pose program of one projector over the samples that it serves."""
    required, device = scene.requirements, projector.device
    workspace = scene.safe_workspace
    pinhole = isinstance(device, PinholeModel)
    up = np.array(workspace.up)
    centre = np.array(workspace.centre)
    return PoseProgram(
        points=served.samples.points,
        normals=served.samples.normals,
        steep=served.steep,
        light=projector.light,
        world_from_device=projector.world_from_device,
        max_incidence=required.projector.max_incidence,
        min_tangent_angle=required.projector.min_tangent_angle,
        range_m=device.range_m,
        shell_m=workspace.projector_radius_m,
        centre=centre,
        axis=np.array(workspace.axis),
        half_angle=workspace.half_angle,
        camera_matrix=device.camera_matrix if pinhole else None,
        resolution=device.resolution if pinhole else None,
        half_panel_m=None if pinhole else tuple(device.half_panel),
        pixel_margin=_PIXEL_MARGIN,
        beam_radius_m=np.inf if pinhole else device.beam_radius or np.inf,
        ring_radius=float(projector.ring_radii[-1]),
        ring_from_device=inverse(projector.world_from_ring)
        @ projector.world_from_device,
        up=up,
        floor=-np.inf
        if workspace.floor_m is None
        else workspace.floor_m + float(up @ centre),
        max_move_m=_MAX_MOVE_M,
        half_spaces=_held_in(workspace, projector.world_from_device[:3, 3]),
    )


def _held_in(
    workspace: Workspace, position: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Rows (n, d) of the convex part of the zones about a position, n.Q >= d."""
    if not is_zoned(workspace):
        return None
    centre = np.array(workspace.centre)
    normals, offsets = half_spaces(workspace, position - centre)
    return np.column_stack([normals, offsets + normals @ centre])


def _improved(
    scene: Scene,
    projector: PlannedProjector,
    rows: Target,
    served: NDArray[np.bool_],
    lit: NDArray[np.bool_],
    p: int,
) -> tuple[PlannedProjector, NDArray[np.bool_]] | None:
    """A pose with more margin that loses no sample, and what it lights; or None."""
    program = pose_program(scene, projector, rows.take(served))
    solution = solve_pose(program)
    if not solution.moved:
        return None
    before = float(pose_margins(program, projector.world_from_device).min())
    others = np.delete(lit, p, axis=1).any(axis=1)
    for step in _STEPS:
        pose = _part_of_the_way(
            projector.world_from_device, solution.world_from_device, step
        )
        # On a straight way between two poses the shell may be left in between.
        inside = float(pose_slack(program, pose).min()) >= 0.0
        if not (inside and float(pose_margins(program, pose).min()) > before):
            continue
        offered = moved_to(projector, pose)
        lights = lit_stages(scene, [offered], rows)[:, 0] == lighting.LIT
        if np.all((lights | others)[lit.any(axis=1)]):
            return offered, lights
    return None


def moved_to(
    projector: PlannedProjector, world_from_device: NDArray[np.float64]
) -> PlannedProjector:
    """Return a projector at another pose; its ring frame moves along."""
    device_from_ring = inverse(projector.world_from_device) @ projector.world_from_ring
    return replace(
        projector,
        world_from_device=world_from_device,
        world_from_ring=world_from_device @ device_from_ring,
    )


def _part_of_the_way(
    start: NDArray[np.float64], end: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    if share == 1.0:
        return end
    turns = Rotation.from_matrix(np.stack([start[:3, :3], end[:3, :3]]))
    pose = np.eye(4)
    pose[:3, :3] = Slerp([0.0, 1.0], turns)(share).as_matrix()
    pose[:3, 3] = (1.0 - share) * start[:3, 3] + share * end[:3, 3]
    return pose
