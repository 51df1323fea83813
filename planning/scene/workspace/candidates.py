"""Poses offered to the cover programs, spread evenly over the workspace.

They look at its centre; over an object that is wider than the field also beside it, as
far as a `Site` says so (`view_tiles`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel, turned_to
from geometry.poses import fibonacci_cap, look_at
from planning.model.errors import InfeasibleLimitsError
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Workspace
from planning.model.ring_frame import ring_frame

from .view_tiles import Site, poses_beside, tiled_poses
from .zone_conflicts import no_position
from .zone_positions import admissible, along_rays, filled, is_zoned

_QUARTER = float(np.pi / 2)
# A floor may leave a sliver of the cone; finer lattices than this aren't tried for it.
_MOST_OFFERED = 1000
# Positions offered around a chosen one.
_AROUND = 60
# Side by side: poses for each that looks at the centre, and directions at least and
# for an estimate.
_BESIDE = 3
_LEAST_DIRECTIONS = 24
_PROBED = 48
# Sine of the angle to the vertical below which a direction has no level across it.
_LEVEL = 1e-6


def shell_positions(
    workspace: Workspace, radius_m: tuple[float, float], n: int
) -> NDArray[np.float64]:
    """Return at least n admissible positions in the middle of the shell, (m, 3).

    Where a floor cuts the cone, the lattice is refined until n positions are left, so
    that a small workspace is searched as densely as a large one is. Where zones cut it,
    positions are as near to the middle as they may, or on the mounting planes.

    Args:
        workspace: The shell or cone.
        radius_m: Least and largest distance of this kind of device.
        n: Positions wanted.
    """
    radius = 0.5 * (radius_m[0] + radius_m[1])
    centre = np.array(workspace.centre)
    start = None if workspace.bearing is None else np.array(workspace.bearing)

    def lattice(k: int) -> NDArray[np.float64]:
        axis = np.array(workspace.axis)
        return fibonacci_cap(k, axis, workspace.half_angle, start=start)

    if is_zoned(workspace):
        return centre + filled(workspace, radius_m, n, lattice)
    offered = n
    while True:
        offsets = radius * lattice(offered)
        kept = offsets[admissible(workspace, (radius, radius), offsets)]
        if len(kept) >= n or not len(kept) or offered > _MOST_OFFERED * n:
            return centre + kept
        offered = int(np.ceil(1.1 * offered * n / len(kept)))


def aimed_poses(
    positions: NDArray[np.float64],
    aim: NDArray[np.float64],
    up: NDArray[np.float64],
    device: PinholeModel | ParallelModel,
    *,
    roll: float = 0.0,
) -> NDArray[np.float64]:
    """Return ``world_from_device`` with the middle of the image on the aim, (n, 4, 4).

    With lens shift the middle of the image is off the optical axis, so the device is
    turned against its line of sight by that angle.
    """
    world_from_aim = look_at(positions, aim, up, roll=roll)
    aim_from_device = np.eye(4)
    aim_from_device[:3, :3] = turned_to(device.middle_ray)
    return world_from_aim @ aim_from_device


def rolls_for(
    device: PinholeModel | ParallelModel, object_radius: float, distance: float
) -> tuple[float, ...]:
    """Return the rolls worth offering: upright, and on its side if that helps.

    A device lies on its side where the object overflows its shorter field.

    Args:
        device: Optics.
        object_radius: Radius of the sphere that holds the object [m].
        distance: From the device to the centre of that sphere [m].
    """
    if isinstance(device, ParallelModel):
        half = float(device.half_panel.min())
        return (0.0,) if object_radius <= half else (0.0, _QUARTER)
    fits = device.holds_ball(object_radius, distance)
    return (0.0,) if fits else (0.0, _QUARTER)


def projector_candidates(
    template: PlannedProjector,
    workspace: Workspace,
    n: int,
    *,
    ring_offset: tuple[float, float],
    site: Site | None = None,
) -> tuple[PlannedProjector, ...]:
    """Return projector candidates over the whole workspace.

    Args:
        template: Optics, light and rings; its poses are replaced.
        workspace: Where devices may stand.
        n: Candidates wanted, at least.
        ring_offset: Tilt and azimuth of the ring axis, as `ring_frame` takes them.
        site: What they stand over side by side; None: all look at the centre.

    Raises:
        InfeasibleLimitsError: If the workspace holds no position.
    """
    poses = _poses(template.device, workspace, workspace.projector_radius_m, n, site)
    return _projectors(template, poses, ring_offset)


def projectors_towards(
    template: PlannedProjector,
    workspace: Workspace,
    directions: NDArray[np.float64],
    *,
    ring_offset: tuple[float, float],
    site: Site | None = None,
) -> tuple[PlannedProjector, ...]:
    """Return candidates in given directions from the centre, those that are admissible.

    Args:
        template: Optics, light and rings; its poses are replaced.
        workspace: Where devices may stand.
        directions: Unit vectors, shape (n, 3).
        ring_offset: As for `projector_candidates`.
        site: As for `projector_candidates`.
    """
    poses = _towards(
        template.device, workspace, workspace.projector_radius_m, directions, site
    )
    return _projectors(template, poses, ring_offset)


def projectors_around(
    chosen: Sequence[PlannedProjector],
    workspace: Workspace,
    n_lattice: int,
    *,
    ring_offset: tuple[float, float],
    scale: float = 1.0,
    site: Site | None = None,
) -> tuple[PlannedProjector, ...]:
    """Return candidates between those of a lattice, close around chosen ones.

    Each chosen pose gets positions out to the lattice's spacing, as seen from the
    centre of the workspace, as far as they are admissible; laid out from the vertical
    through it, so that they turn with the workspace. Side by side, they are turned
    about what they look at and moved along with it.

    Args:
        chosen: Projectors of the lattice.
        workspace: Where devices may stand.
        n_lattice: Poses of the lattice.
        ring_offset: As for `projector_candidates`.
        scale: How far out, as a share of the lattice's spacing.
        site: As for `projector_candidates`.
    """
    if not chosen:
        return ()
    if site is not None:
        own = np.stack([projector.world_from_device for projector in chosen])
        reach = scale * _spacing(workspace, n_lattice // (1 + _BESIDE))
        beside = poses_beside(site, own, _AROUND, reach=reach)
        return _projectors(chosen[0], beside, ring_offset)
    device, centre = chosen[0].device, np.array(workspace.centre)
    near, far = workspace.projector_radius_m
    radius = 0.5 * (near + far)
    rolls = rolls_for(device, workspace.object_radius_m, radius)
    reach = scale * _spacing(workspace, n_lattice // len(rolls))
    found: list[NDArray[np.float64]] = []
    for projector in chosen:
        outwards = projector.world_from_device[:3, 3] - centre
        outwards = outwards / np.linalg.norm(outwards)
        level = np.cross(np.array(workspace.up), outwards)
        start = level if np.linalg.norm(level) > _LEVEL else None
        cap = fibonacci_cap(_AROUND, outwards, reach, start=start)
        found.append(centre + _offsets(cap, workspace, workspace.projector_radius_m))
    positions = np.concatenate(found)
    poses = _aimed(positions, device, workspace, rolls)
    return _projectors(chosen[0], poses, ring_offset)


def _offsets(
    directions: NDArray[np.float64],
    workspace: Workspace,
    shell_m: tuple[float, float],
) -> NDArray[np.float64]:
    """Admissible positions of devices in given directions, from the centre."""
    if is_zoned(workspace):
        return along_rays(workspace, shell_m, directions)
    near, far = shell_m
    radius = 0.5 * (near + far)
    offsets = radius * directions
    return offsets[admissible(workspace, (radius, radius), offsets)]


def _about_ball(
    radius_m: tuple[float, float], site: Site | None
) -> tuple[float, float]:
    """The part of the shell a standoff away from the ball about the object."""
    if site is None:
        return radius_m
    middle = site.standoff_m + site.workspace.object_radius_m
    return 2.0 * middle - radius_m[1], radius_m[1]


def _spacing(workspace: Workspace, n_positions: int) -> float:
    """Angle between neighbours of a lattice of so many positions [rad]."""
    # Each position of the lattice has this much of the solid angle.
    solid_angle = 2 * np.pi * (1 - np.cos(workspace.half_angle))
    return float(np.sqrt(solid_angle / max(1, n_positions)))


def _projectors(
    template: PlannedProjector,
    poses: NDArray[np.float64],
    ring_offset: tuple[float, float],
) -> tuple[PlannedProjector, ...]:
    device_from_ring = ring_frame(np.eye(4), template.device, *ring_offset)
    return tuple(
        replace(
            template,
            world_from_device=pose,
            world_from_ring=pose @ device_from_ring,
            existing="",
        )
        for pose in poses
    )


def camera_candidates(
    template: PlannedCamera, workspace: Workspace, n: int, site: Site | None = None
) -> tuple[PlannedCamera, ...]:
    """Return camera candidates over the whole workspace, at least n.

    The arguments are those of `projector_candidates`.
    """
    poses = _poses(template.device, workspace, workspace.camera_radius_m, n, site)
    return tuple(replace(template, world_from_device=pose) for pose in poses)


def cameras_towards(
    template: PlannedCamera,
    workspace: Workspace,
    directions: NDArray[np.float64],
    site: Site | None = None,
) -> tuple[PlannedCamera, ...]:
    """Return cameras in given directions from the centre, those that are admissible.

    The arguments are those of `projectors_towards`.
    """
    poses = _towards(
        template.device, workspace, workspace.camera_radius_m, directions, site
    )
    return tuple(
        replace(template, world_from_device=pose, existing="") for pose in poses
    )


def middle_radius_m(radius_m: tuple[float, float], site: Site | None) -> float:
    """Return how far from the centre offered devices stand where nothing is in the way.

    Args:
        radius_m: Least and largest distance of this kind of device.
        site: What they stand over side by side; None: all look at the centre.
    """
    near, far = _about_ball(radius_m, site)
    return 0.5 * (near + far)


def _towards(
    device: PinholeModel | ParallelModel,
    workspace: Workspace,
    radius_m: tuple[float, float],
    directions: NDArray[np.float64],
    site: Site | None,
) -> NDArray[np.float64]:
    """Poses in given directions, those that are admissible, shape (m, 4, 4)."""
    shell = _about_ball(radius_m, site)
    rolls = rolls_for(device, workspace.object_radius_m, 0.5 * (shell[0] + shell[1]))
    offsets = _offsets(directions, workspace, shell)
    poses = _aimed(np.array(workspace.centre) + offsets, device, workspace, rolls)
    if site is not None:
        poses = np.concatenate([poses, tiled_poses(site, directions, rolls)[0]])
    return poses


def _poses(
    device: PinholeModel | ParallelModel,
    workspace: Workspace,
    radius_m: tuple[float, float],
    n: int,
    site: Site | None,
) -> NDArray[np.float64]:
    shell = _about_ball(radius_m, site)
    distance = 0.5 * (shell[0] + shell[1])
    rolls = rolls_for(device, workspace.object_radius_m, distance)
    positions = shell_positions(workspace, shell, -(-n // len(rolls)))
    poses = _aimed(positions, device, workspace, rolls)
    if site is not None:
        poses = np.concatenate([poses, _side_by_side(site, n, rolls)])
    if not len(poses):
        raise InfeasibleLimitsError(no_position(workspace, radius_m))
    return poses


def _side_by_side(site: Site, n: int, rolls: Sequence[float]) -> NDArray[np.float64]:
    """About three times n poses over tiles: the more tiles, the fewer directions."""
    lattice = _directions(site, _PROBED)
    if not len(lattice):
        return np.empty((0, 4, 4))
    each = len(tiled_poses(site, lattice, rolls)[0]) / len(lattice)
    wanted = max(_LEAST_DIRECTIONS, int(min(n, _BESIDE * n / max(each, 1.0))))
    return tiled_poses(site, _directions(site, wanted), rolls)[0]


def _directions(site: Site, n: int) -> NDArray[np.float64]:
    """Directions from the centre of n positions or more, if there are as many."""
    offsets = shell_positions(site.workspace, site.radius_m, n)
    offsets = offsets - np.array(site.workspace.centre)
    return offsets / np.linalg.norm(offsets, axis=1, keepdims=True)


def _aimed(
    positions: NDArray[np.float64],
    device: PinholeModel | ParallelModel,
    workspace: Workspace,
    rolls: Sequence[float],
) -> NDArray[np.float64]:
    centre, up = np.array(workspace.centre), np.array(workspace.up)
    return np.concatenate(
        [aimed_poses(positions, centre, up, device, roll=roll) for roll in rolls]
    )
