"""Where devices stand side by side, over an object that is wider than their field.

Seen along a direction, what faces a device fills a rectangle, the smallest at any turn
about the line of sight; the device is rolled to that. It is cut into as few
tiles as the field holds, and once more into one more either way, so that neighbours
overlap. A device looks at the middle of each tile, from the standoff over what stands
out farthest in it; diverging light also from as far as shell and range allow, where a
field is wider. Tiles in which nothing faces the device are left out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import DeviceModel, turned_to
from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import fibonacci_cap, look_at
from planning.model.requirements import Workspace

from .admissible import admissible, is_zoned

_Array = NDArray[np.float64]

# The farther set of tiles is only worth its poses where it stands so much farther.
_FARTHER = 1.05
# Depths tried along a line of sight that zones cut.
_DEPTHS = 9
_LEVEL = 1e-12
# Turns of a rectangle that are tried; how much smaller than upright one must be.
_TURNS = 45
_SMALLER = 0.9


@dataclass(frozen=True, eq=False)
class Site:
    """What one kind of device stands over, and how far from it.

    Least and largest distance are from the workspace's centre, the standoff from the
    surface [m]; up to `max_incidence` [rad] a sample is of use.
    """

    device: DeviceModel
    workspace: Workspace
    radius_m: tuple[float, float]
    standoff_m: float
    samples: SurfaceSamples
    max_incidence: float


def tiled_poses(
    site: Site, directions: _Array, rolls: Sequence[float]
) -> tuple[_Array, NDArray[np.int64]]:
    """Return admissible ``world_from_device`` over tiles, and the direction of each.

    Directions are unit vectors from the object to the device, (n, 3); rolls count from
    the upright or, if that is clearly smaller, the smallest rectangle [rad].
    """
    frames, anchors, depths, owner = [], [], [], []
    upright = look_at(directions, np.zeros(3), np.array(site.workspace.up))
    for k, level in enumerate(upright):
        seen = _facing(site, directions[k])
        if not len(seen):
            continue
        along = _smallest_rectangle(seen @ level[:3, :2])
        for roll in rolls:
            frame = level @ _rolled(roll + along)
            for anchor, depth in _tiles(site, seen, frame[:3, :3]):
                frames.append(frame)
                anchors.append(anchor)
                depths.append(depth)
                owner.append(k)
    if not frames:
        return np.empty((0, 4, 4)), np.empty(0, dtype=np.int64)
    poses = np.array(frames)
    offsets, kept = _placed(site, np.array(anchors), -poses[:, :3, 2], np.array(depths))
    poses[:, :3, :3] = poses[:, :3, :3] @ turned_to(site.device.middle_ray)
    poses[:, :3, 3] = np.array(site.workspace.centre) + offsets
    return poses[kept], np.array(owner)[kept]


def poses_beside(site: Site, poses: _Array, n: int, *, reach: float) -> _Array:
    """Return poses around others: n each turned about their aim, and moved with it.

    They are turned by `reach` [rad] at most, and moved by as great a share of half the
    field as this is of a radian's third.
    """
    near = site.standoff_m
    aside = min(1.0, 3.0 * reach) * float(site.device.half_rectangle(near).min())
    centre = np.array(site.workspace.centre)
    turned_poses: list[_Array] = [np.empty((0, 4, 4))]
    for pose in poses:
        outwards = -pose[:3, :3] @ site.device.middle_ray
        aim = pose[:3, 3] - centre - near * outwards
        turned = fibonacci_cap(n, outwards, reach, start=pose[:3, 0])
        across = aside * _disc(n, pose[:3, 0], outwards)
        # Nearer and farther, too: diverging light is wider there.
        depth = near + aside * (np.arange(n) % 3 - 1.0)
        anchors = np.concatenate([np.broadcast_to(aim, (n, 3)), aim + across])
        sights = np.concatenate([turned, np.broadcast_to(outwards, (n, 3))])
        depths = np.concatenate([np.full(n, near), depth])
        offsets, kept = _placed(site, anchors, sights, depths)
        moved = np.repeat(pose[None], 2 * n, axis=0)
        moved[:, :3, :3] = turned_to(outwards, sights) @ pose[:3, :3]
        moved[:, :3, 3] = centre + offsets
        turned_poses.append(moved[kept])
    return np.concatenate(turned_poses)


def _facing(site: Site, outwards: _Array) -> _Array:
    """Points that can be of use from a direction, from the centre, shape (n, 3)."""
    facing = site.samples.normals @ outwards >= np.cos(site.max_incidence)
    return site.samples.points[facing] - np.array(site.workspace.centre)


def _smallest_rectangle(flat: _Array) -> float:
    """Turn from +x towards +y of the smallest rectangle about points (n, 2), or 0."""
    turns = np.arange(_TURNS) * (0.5 * np.pi / _TURNS)
    axes = np.stack([np.cos(turns), np.sin(turns)])
    x, y = flat @ axes, flat @ np.stack([-axes[1], axes[0]])
    areas = np.ptp(x, axis=0) * np.ptp(y, axis=0)
    best = int(np.argmin(areas))
    return float(turns[best]) if areas[best] < _SMALLER * areas[0] else 0.0


def _rolled(angle: float) -> _Array:
    pose = np.eye(4)
    c, s = np.cos(angle), np.sin(angle)
    pose[:2, :2] = [[c, -s], [s, c]]
    return pose


def _tiles(site: Site, points: _Array, frame: _Array) -> Iterator[tuple[_Array, float]]:
    """Anchor on a line of sight, from the centre, and the distance of the device."""
    x, y, outwards = frame[:, 0], frame[:, 1], -frame[:, 2]
    flat, height = points @ np.column_stack([x, y]), points @ outwards
    low, high = flat.min(axis=0), flat.max(axis=0)
    for distance, more in _distances(site):
        half = site.device.half_rectangle(distance)
        count = np.maximum(np.ceil((high - low) / (2.0 * half) - 1e-9), 1.0)
        count += more * (count > 1)
        if more and count.max() == 1:
            continue
        step = (high - low) / count
        for i in range(int(count[0])):
            for j in range(int(count[1])):
                middle = low + step * (np.array([i, j]) + 0.5)
                inside = np.all(np.abs(flat - middle) <= half, axis=1)
                if inside.any():
                    top = float(height[inside].max())
                    anchor = middle[0] * x + middle[1] * y + top * outwards
                    yield anchor, distance


def _distances(site: Site) -> Iterator[tuple[float, int]]:
    """Distances from the surface, and how many tiles more than are needed."""
    yield site.standoff_m, 0
    yield site.standoff_m, 1
    slant = float(np.hypot(1.0, np.hypot(*site.device.half_rectangle(1.0))))
    far = min(
        site.standoff_m + site.workspace.object_radius_m,
        site.device.range_m[1] / slant,
    )
    near_half, far_half = map(site.device.half_rectangle, (site.standoff_m, far))
    # Parallel light is no wider farther off.
    if far > _FARTHER * site.standoff_m and np.all(far_half > near_half):
        yield far, 0


def _placed(
    site: Site, anchors: _Array, outwards: _Array, depths: _Array
) -> tuple[_Array, NDArray[np.bool_]]:
    """Offsets from the centre on the lines through anchors, and which are allowed.

    As far out as asked or as the shell allows; where zones cut the line, as near to
    that as they let it.
    """
    along = np.einsum("ij,ij->i", anchors, outwards)
    across = anchors - along[:, None] * outwards
    off = np.einsum("ij,ij->i", across, across)
    low, high = site.standoff_m, site.standoff_m + site.workspace.object_radius_m
    top = np.sqrt(np.maximum(high**2 - off, 0.0))
    out = np.minimum(along + depths, top)
    out = np.where(off + out**2 < low**2, np.sqrt(np.maximum(low**2 - off, 0.0)), out)
    trials = out[:, None]
    if is_zoned(site.workspace):
        trials = np.column_stack([out, *_depths(site.workspace, across, outwards, top)])
    offsets = across[:, None] + trials[..., None] * outwards[:, None]
    good = admissible(site.workspace, site.radius_m, offsets.reshape(-1, 3))
    good = good.reshape(trials.shape)
    best = np.argmin(np.where(good, np.abs(trials - out[:, None]), np.inf), axis=1)
    return offsets[np.arange(len(best)), best], np.asarray(np.any(good, axis=1))


def _depths(
    workspace: Workspace, across: _Array, outwards: _Array, top: _Array
) -> Iterator[_Array]:
    """Places on lines of sight: evenly spread to the shell, and on each plane."""
    for share in np.linspace(0.0, 1.0, _DEPTHS):
        yield share * top
    for plane in workspace.mounting:
        normal, middle = np.array(plane.axes[2]), np.array(plane.centre_m)
        rise = outwards @ normal
        rise = np.where(np.abs(rise) < _LEVEL, _LEVEL, rise)
        yield np.clip((middle - across) @ normal / rise, -top, top)


def _disc(n: int, start: _Array, normal: _Array) -> _Array:
    """Places spread evenly over a disc of radius 1, shape (n, 3)."""
    x = start - (start @ normal) * normal
    x /= np.linalg.norm(x)
    i = np.arange(n)
    around = i * (np.pi * (3.0 - np.sqrt(5.0)))
    radius = np.sqrt((i + 0.5) / n)
    plane = np.column_stack([radius * np.cos(around), radius * np.sin(around)])
    return plane @ np.stack([x, np.cross(normal, x)])
