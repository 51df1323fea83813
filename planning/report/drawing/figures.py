"""Devices and zones as polylines in the world, ready to be drawn."""

from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import transform
from planning.model.bodies import Box
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.scene.patterns.ring_pattern import RingPattern

from .picture_view import Colour, facing

# Kinds of zones as the legend names them, in the order in which they are drawn.
ZONES: dict[str, Colour] = {
    "room": (128, 128, 136),
    "mounting plane": (46, 132, 74),
    "keep out": (178, 34, 52),
}
# Zones may reach far beyond the devices; the picture follows them no farther.
_REACH = 1.03
# Seen along a device's axis, that many points make a beam's circle.
_CIRCLE = 48
# Turns of a three-quarter view in degrees: none runs along a world axis.
_TURNS = (30, 45, 60, 120, 135, 150, 210, 225, 240, 300, 315, 330)


@dataclass(frozen=True, eq=False)
class DeviceFigure:
    """What is drawn of one device; polylines are points in the world [m], (n, 3).

    Attributes:
        id: Its name in the plan.
        kind: What it is.
        position: Its origin in the world [m], shape (3,).
        body: Outline of a small frustum, or of a parallel projector's panel; and the
            edges of its housing, where the plan has one.
        beam: Edges of the light or the field of view as far as the object.
        axis: From the origin along the optical axis to the object's depth, (2, 3).
        distance_m: From the origin to the centre of the object [m].
        existing: Name of the device that stands already; empty: it is planned.
    """

    id: str
    kind: Literal["projector", "camera"]
    position: NDArray[np.float64]
    body: tuple[NDArray[np.float64], ...]
    beam: tuple[NDArray[np.float64], ...]
    axis: NDArray[np.float64]
    distance_m: float
    existing: str


def device_figures(plan: RigPlan, *, body_m: float) -> list[DeviceFigure]:
    """Return the figures of a plan's projectors, then of its cameras.

    Args:
        plan: The plan.
        body_m: Length of the frusta that stand for device bodies [m].
    """
    centre = plan.surface.mesh.centre
    return [
        _figure(device, centre, body_m) for device in (*plan.projectors, *plan.cameras)
    ]


def _figure(
    device: PlannedProjector | PlannedCamera, centre: NDArray[np.float64], body_m: float
) -> DeviceFigure:
    pose = device.world_from_device
    position = pose[:3, 3]
    depth = max(float((centre - position) @ pose[:3, 2]), body_m)
    model = device.device
    if isinstance(model, ParallelModel):
        radius = _beam_radius(device, model)
        local_body, local_beam = _parallel(model, radius, depth)
    else:
        local_body, local_beam = _pinhole(model, body_m, depth)
    if device.body is not None:
        corners = _corners(np.array(device.body.centre_m), device.body.half_m)
        local_body = [*local_body, *_edges(corners)]
    return DeviceFigure(
        device.id,
        "projector" if isinstance(device, PlannedProjector) else "camera",
        position,
        tuple(transform(pose, line) for line in local_body),
        tuple(transform(pose, line) for line in local_beam),
        transform(pose, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, depth]])),
        float(np.linalg.norm(position - centre)),
        device.existing,
    )


def _beam_radius(
    device: PlannedProjector | PlannedCamera, model: ParallelModel
) -> float:
    """Radius that a parallel projector lights, inf where only its panel limits it."""
    projects = isinstance(device, PlannedProjector)
    return min(model.beam_reach, RingPattern(device).outermost if projects else np.inf)


def _pinhole(
    model: PinholeModel, body_m: float, depth: float
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    width, height = model.resolution
    pixels = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    rays = model.rays(pixels)
    # Depth one, so that the four corners lie in a plane across the axis.
    rays = rays / rays[:, 2:]
    near, far, apex = rays * body_m, rays * depth, np.zeros(3)
    body = [_closed(near), *(np.array([apex, corner]) for corner in near)]
    # A tick on the image's upper side shows which way up the device is.
    top = 0.5 * (near[0] + near[1])
    tick = top + np.array([0.0, -0.35 * (near[2, 1] - near[1, 1]), 0.0])
    body += [np.array([near[0] * 0.6 + near[1] * 0.4, tick])]
    body += [np.array([tick, near[0] * 0.4 + near[1] * 0.6])]
    return body, [np.array([a, b]) for a, b in zip(near, far, strict=True)] + [
        _closed(far)
    ]


def _parallel(
    model: ParallelModel, radius: float, depth: float
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    x, y = model.half_panel
    panel = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    tick = np.array([[-0.2 * x, -y, 0.0], [0.0, -1.25 * y, 0.0], [0.2 * x, -y, 0.0]])
    outline = panel
    if radius < float(np.hypot(x, y)):
        turn = np.linspace(0.0, 2.0 * np.pi, _CIRCLE, endpoint=False)
        outline = radius * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        outline[:, 0] = np.clip(outline[:, 0], -x, x)
        outline[:, 1] = np.clip(outline[:, 1], -y, y)
    end = outline + np.array([0.0, 0.0, depth])
    edges = range(0, len(outline), max(len(outline) // 4, 1))
    beam = [np.array([outline[k], end[k]]) for k in edges]
    return [_closed(panel), tick], [*beam, _closed(outline), _closed(end)]


def _closed(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([points, points[:1]])


@dataclass(frozen=True, eq=False)
class ZoneFigure:
    """What is drawn of one zone.

    Attributes:
        kind: A key of `ZONES`.
        name: As in the rig file.
        corners: In the world [m], shape (8, 3).
        edges: Pairs of corners, shape (12, 2, 3).
        near: Corners drawn in to where devices may stand [m], shape (8, 3).
    """

    kind: str
    name: str
    corners: NDArray[np.float64]
    edges: NDArray[np.float64]
    near: NDArray[np.float64]


def zone_figures(plan: RigPlan) -> list[ZoneFigure]:
    """Return the zones of a plan's workspace, room first."""
    space = plan.requirements.workspace
    room = () if space.box is None else (space.box,)
    zones = zip(ZONES, (room, space.mounting, space.keep_out), strict=True)
    centre = np.array(space.centre)
    reach = zone_reach(plan)
    return [_zone(kind, box, centre, reach) for kind, boxes in zones for box in boxes]


def zone_reach(plan: RigPlan) -> float:
    """Return how far from the workspace's centre zones and obstacles are shown [m]."""
    space = plan.requirements.workspace
    return _REACH * max(*space.projector_radius_m, *space.camera_radius_m)


def _zone(kind: str, box: Box, centre: NDArray[np.float64], reach: float) -> ZoneFigure:
    offsets = box.centre_m + _corners(np.zeros(3), box.half_m) @ np.array(box.axes)
    corners = centre + offsets
    near = centre + np.clip(offsets, -reach, reach)
    return ZoneFigure(kind, box.name, corners, _edges(corners), near)


def _corners(
    centre: NDArray[np.float64], half: tuple[float, float, float]
) -> NDArray[np.float64]:
    """The eight corners of a box, (8, 3), the last axis changing first."""
    return centre + np.array(list(product((-1.0, 1.0), repeat=3))) * half


def _edges(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """The twelve edges of a box: pairs of `_corners` that differ in one sign."""
    pairs = [(a, b) for a, b in combinations(range(8), 2) if a ^ b in (1, 2, 4)]
    return corners[np.array(pairs)]


def best_direction(
    positions: NDArray[np.float64], centre: NDArray[np.float64], up: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the three-quarter direction from which devices overlap least.

    Tried are 12 turns about `up`, none along a world axis, at heights of 20 to 40
    degrees; the score is the least distance in the picture between two devices or a
    device and the object, relative to the picture, plus a preference for the side that
    the devices stand on.

    Args:
        positions: Of the devices [m], shape (n, 3).
        centre: Of the object [m], shape (3,).
        up: World direction that is up, unit, shape (3,).

    Returns:
        Unit vector from the object to the viewer.
    """
    right, ahead = facing(up, up)
    spots = np.concatenate([positions, centre[None]]) - centre
    side = spots.mean(axis=0)
    side = side / max(float(np.linalg.norm(side)), 1e-12)
    best, best_score = ahead, -np.inf
    for height in np.deg2rad((20.0, 30.0, 40.0)):
        for turn in np.deg2rad(_TURNS):
            back = np.sin(height) * up + np.cos(height) * (
                np.cos(turn) * right + np.sin(turn) * ahead
            )
            flat = spots - (spots @ back)[:, None] * back
            gaps = np.linalg.norm(flat[:, None] - flat[None], axis=2)
            size = max(float(gaps.max()), 1e-12)
            least = float(np.min(gaps + np.eye(len(gaps)) * size)) / size
            # Rounded, so that the last bit doesn't choose between mirror images.
            score = round(min(least, 0.12) + 0.10 * float(back @ side), 9)
            if score > best_score:
                best, best_score = back, score
    return best


def close_directions(
    positions: NDArray[np.float64], centre: NDArray[np.float64], up: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return two views from the side that the devices stand on, to its left and right.

    Args:
        positions: Of the devices [m], shape (n, 3).
        centre: Of the object [m], shape (3,).
        up: World direction that is up, unit, shape (3,).

    Returns:
        Vectors from the object to the viewer.
    """
    away = positions - centre
    side = away.sum(axis=0)
    side -= (side @ up) * up
    # Devices all round, or all overhead, stand on no side.
    if not np.linalg.norm(side) > 1e-6 * np.linalg.norm(away):
        side = -facing(up, up)[1]
    side = side / np.linalg.norm(side)
    across = np.cross(up, side)
    return [0.8 * side + turn * across + 0.15 * up for turn in (-0.6, 0.6)]
