"""Claims about the workspace: its shell, its values, and the poses offered in it."""

import math

import numpy as np

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from planning.model.plan import RigPlan
from planning.model.requirements import Workspace
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_devices import (
    DivergingRays,
    ParallelRays,
    light_from,
)

from .zone_claims import zone_excess

_ROUNDING = 1e-6
_KEY = "requirements.workspace"
# Positions are written to 0.01 mm, so one on the border may lie outside by as much.
POSITION_M = 2e-5
# A pose that is that of an existing device.
SAME_POSE = 1e-9


def audit_ball(space: Workspace, mesh: TriangleMesh, findings: AuditFindings) -> None:
    """Check that the workspace is about the smallest ball that holds a surface."""
    slack = _ROUNDING * max(1.0, float(np.abs(mesh.bounds).max()))
    whose = "the centre of the smallest ball that holds the surface"
    findings.same("centre", list(space.centre), mesh.centre, whose, slack)
    findings.numbers(space, {"object_radius_m": mesh.radius}, slack, "m")


def _audit_held(space: Workspace, mesh: TriangleMesh, findings: AuditFindings) -> None:
    """Check that the ball of all members holds the main bodies of this one."""
    held = mesh.vertices[np.unique(mesh.faces[mesh.main])]
    reach = float(np.linalg.norm(held - np.array(space.centre), axis=1).max())
    findings.holds(
        reach <= space.object_radius_m + POSITION_M,
        "object_radius_m",
        f"{space.object_radius_m:.6g} m, but the surface reaches out to {reach:.6g} m",
    )


def audit_workspace(case: AuditCase, findings: AuditFindings) -> None:
    """Check the workspace against the surface, and the reference poses against it."""
    space, surface = case.plan.requirements.workspace, case.plan.surface
    below = findings.at(_KEY)
    if case.plan.of_member:
        _audit_held(space, surface.mesh, below)
    else:
        audit_ball(space, surface.mesh, below)
    _audit_values(space, below)
    for kind in case.kinds:
        low, high = kind.shell
        below.holds(
            0.0 < low <= high,
            f"{kind.name}_radius_m",
            f"{list(kind.shell)} m must be positive and rise",
        )
        below.holds(
            len(kind.poses) == kind.n_poses,
            f"n_reference_{kind.name}s",
            f"{kind.n_poses} reference poses are claimed, surface.npz holds "
            f"{len(kind.poses)}",
        )
        key = f"surface.npz reference_{kind.name}s"
        movable = movable_references(kind, case.plan)
        audit_poses(key, movable, findings)
        # What stands still is in the room of a turntable, which turns about the part.
        about = space.whole_shell if turns(case.plan) else space
        excess = outside_by(movable[:, :3, 3], kind.shell, about)
        count = int((~(excess <= POSITION_M)).sum())
        findings.holds(
            count == 0,
            key,
            f"{count} of {len(movable)} poses lie outside {_KEY}, by up to "
            f"{1e3 * float(excess.max(initial=0.0)):.3g} mm",
        )
    key = "surface.npz reference_rings"
    audit_poses(key, surface.reference_rings, findings)
    if case.plan.projectors:
        device = case.plan.projectors[0].device
        light = light_from(device, surface.reference_projectors)
        audit_ring_frames(key, light, surface.reference_rings, findings)


def turns(plan: RigPlan) -> bool:
    """Return whether the part is on a turntable."""
    stations = plan.document.stations
    return stations is not None and stations.kind == "turntable"


def in_room(plan: RigPlan, station: str, positions: Array) -> Array:
    """Return where what the part sees at a station is in the room, (n, 3) [m].

    Before a turntable it is seen as turned back.
    """
    back = room_from_world(plan, station)
    return positions @ back[:3, :3].T + back[:3, 3]


def room_from_world(plan: RigPlan, station: str) -> Array:
    """Return the pose that takes what the part sees at a station to the room, (4, 4).

    The identity where the part doesn't turn.
    """
    told = plan.document.stations
    if told is None or told.axis is None or told.point_m is None or not turns(plan):
        return np.eye(4)
    angles = {one.id: one.angle or 0.0 for one in told.stations}
    axis, point = np.array(told.axis), np.array(told.point_m)
    return turned_back(axis, point, -angles.get(station, 0.0))


def turned_back(axis: Array, point: Array, angle: float) -> Array:
    """What takes the room to the part's frame when the table has turned by an angle.

    By quaternion: q = (cos(a / 2), -sin(a / 2) axis).
    """
    w, (x, y, z) = np.cos(0.5 * angle), -np.sin(0.5 * angle) * axis
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    pose = np.eye(4)
    pose[:3, :3] = turn
    pose[:3, 3] = point - turn @ point
    return pose


def outside_by(positions: Array, shell: tuple[float, float], space: Workspace) -> Array:
    """Return how far positions (n, 3) lie outside the workspace, <= 0 inside, (n,) [m].

    The largest of the amounts by which |Q - c| misses its range, Q stands behind the
    cone (times |Q - c|), below the floor, and where its zones don't let it.
    """
    offset = positions - np.array(space.centre)
    distance = np.linalg.norm(offset, axis=1)
    axis = np.array(space.axis) / np.linalg.norm(space.axis)
    along = offset @ axis
    across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    beyond = (np.arctan2(across, along) - space.half_angle) * distance
    excess = [shell[0] - distance, distance - shell[1], beyond]
    if space.floor_m is not None:
        excess.append(space.floor_m - offset @ np.array(space.up))
    excess += zone_excess(offset, space)
    return np.max(excess, axis=0)


def audit_poses(key: str, poses: Array, findings: AuditFindings) -> None:
    """Check that (n, 4, 4) are rigid: R R^T = 1, det R > 0 and 0 0 0 1 below."""
    turn = poses[:, :3, :3]
    error = np.abs(turn @ np.swapaxes(turn, 1, 2) - np.eye(3)).max(initial=0.0)
    findings.holds(
        error <= _ROUNDING and np.all(np.linalg.det(turn) > 0.0),
        key,
        f"isn't a rotation: R R^T differs from the identity by {error:.2g} "
        f"(tolerance {_ROUNDING:g}), or det R < 0",
    )
    rigid = np.all(poses[:, 3] == np.array([0.0, 0.0, 0.0, 1.0]))
    findings.holds(rigid, key, "lacks a rigid last row, 0 0 0 1")


def audit_ring_frames(
    key: str,
    light: DivergingRays | ParallelRays,
    frames: Array,
    findings: AuditFindings,
) -> None:
    """Check that cones of rings share the optical centre, or cylinders the axis."""
    off = float(np.abs(light.ring_frame_fault(frames)).max(initial=0.0))
    findings.holds(
        off <= _ROUNDING,
        key,
        f"ring frames leave the optical centre, the panel plane or the axis of the "
        f"light by up to {off:.3g}",
    )


def _audit_values(space: Workspace, findings: AuditFindings) -> None:
    for name, vector in (("up", space.up), ("axis", space.axis)):
        length = float(np.linalg.norm(vector))
        findings.holds(
            abs(length - 1.0) <= _ROUNDING,
            name,
            f"{list(vector)} must be a unit vector, its length is {length:.6g}",
        )
    findings.holds(
        0.0 < space.half_angle <= math.pi + 1e-9,
        "half_angle",
        f"{space.half_angle:.6g} rad must lie in (0, pi]",
    )


def movable_references(kind: DeviceKind, plan: RigPlan) -> Array:
    """Return the reference poses (n, 4, 4) that aren't those of existing devices."""
    movable = np.ones(len(kind.poses), dtype=bool)
    for device in plan.requirements.existing_of(kind.name):
        off = np.abs(kind.poses - np.array(device.world_from_device)).max(axis=(1, 2))
        movable &= off > SAME_POSE
    return kind.poses[movable]
