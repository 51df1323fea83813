"""Devices and zones as polylines in the world, ready to be drawn."""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import transform
from geometry.shapes.boxes import OrientedBox
from planning.model.devices.bodies import Box
from planning.model.devices.planned import PlannedProjector
from planning.model.plan import RigPlan
from planning.scene.codes.patterns import pattern_of
from planning.scene.placed_bodies import Device, placed_box

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
# Three-quarter views in degrees: none runs along a world axis.
_HEIGHTS = (20, 30, 40)
_TURNS = (30, 45, 60, 120, 135, 150, 210, 225, 240, 300, 315, 330)

_Lines = list[NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class DeviceFigure:
    """What is drawn of one device; polylines are points in the world [m], (n, 3).

    Attributes:
        device: As it stands.
        body: Outline of a small frustum, or of a parallel projector's panel; and the
            edges of its housing, where the plan has one.
        beam: The optical axis as far as the object, and the edges of a projector's
            light.
    """

    device: Device
    body: _Lines
    beam: _Lines


def device_figures(plan: RigPlan, *, body_m: float) -> list[DeviceFigure]:
    """Return the figures of projectors, then of cameras, as frusta of a length [m]."""
    centre = plan.surface.mesh.centre
    return [
        _figure(device, centre, body_m) for device in (*plan.projectors, *plan.cameras)
    ]


def _figure(device: Device, centre: NDArray[np.float64], body_m: float) -> DeviceFigure:
    pose, model = device.world_from_device, device.device
    depth = max(float((centre - pose[:3, 3]) @ pose[:3, 2]), body_m)
    if isinstance(model, PinholeModel):
        body, beam = _pinhole(model, body_m, depth)
    else:
        radius = model.beam_reach
        if isinstance(device, PlannedProjector):
            radius = min(radius, pattern_of(device).outermost)
        body, beam = _parallel(model, radius, depth)
    if not isinstance(device, PlannedProjector):
        beam = []
    axis = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, depth]])
    placed = [transform(pose, line) for line in body]
    if device.body is not None:
        placed.extend(box_edges(placed_box(device.body, pose)))
    return DeviceFigure(
        device, placed, [transform(pose, line) for line in (axis, *beam)]
    )


def _pinhole(model: PinholeModel, body_m: float, depth: float) -> tuple[_Lines, _Lines]:
    """A frustum with a tick on the image's upper side; and the light from it on."""
    width, height = model.resolution
    pixels = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    rays = model.rays(pixels)
    # Depth one, so that the four corners lie in a plane across the axis.
    near = body_m * rays / rays[:, 2:]
    left, right, below = near[:3]
    rise = np.array([0.0, 0.35 * (right[1] - below[1]), 0.0])
    thirds = [0.6 * left + 0.4 * right, 0.4 * left + 0.6 * right]
    tick = np.array([thirds[0], 0.5 * (left + right) + rise, thirds[1]])
    edges = [np.array([np.zeros(3), corner]) for corner in near]
    return [_closed(near), *edges, tick], _tube(near, near * depth / body_m)


def _parallel(
    model: ParallelModel, radius: float, depth: float
) -> tuple[_Lines, _Lines]:
    """The panel with a tick on its upper side; and the light that leaves it."""
    x, y = model.half_panel
    panel = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    tick = np.array([[-0.2 * x, -y, 0.0], [0.0, -1.25 * y, 0.0], [0.2 * x, -y, 0.0]])
    outline = panel
    if radius < float(np.hypot(x, y)):
        turn = np.linspace(0.0, 2.0 * np.pi, _CIRCLE, endpoint=False)
        circle = radius * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        outline = np.clip(circle, [-x, -y, 0.0], [x, y, 0.0])
    beam = _tube(outline, outline + np.array([0.0, 0.0, depth]))
    return [_closed(panel), tick], [*beam, _closed(outline)]


def _tube(near: NDArray[np.float64], far: NDArray[np.float64]) -> _Lines:
    """Four edges from one outline to another, and the other."""
    step = len(near) // 4
    edges = zip(near[::step], far[::step], strict=True)
    return [*(np.stack(edge) for edge in edges), _closed(far)]


def _closed(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([points, points[:1]])


@dataclass(frozen=True, eq=False)
class ZoneFigure:
    """Edges (12, 2, 3) of a zone, and its corners drawn in to the devices (8, 3) [m].

    Its kind is a key of `ZONES`.
    """

    kind: str
    edges: NDArray[np.float64]
    near: NDArray[np.float64]


def zone_figures(plan: RigPlan) -> list[ZoneFigure]:
    """Return the zones of a plan's workspace, room first."""
    space = plan.requirements.workspace
    room = () if space.box is None else (space.box,)
    zones = zip(ZONES, (room, space.mounting, space.keep_out), strict=True)
    centre, reach = np.array(space.centre), zone_reach(plan)
    return [_zone(kind, box, centre, reach) for kind, boxes in zones for box in boxes]


def zone_reach(plan: RigPlan) -> float:
    """Return how far from the workspace's centre zones and obstacles are shown [m]."""
    space = plan.requirements.workspace
    return _REACH * max(*space.projector_radius_m, *space.camera_radius_m)


def _zone(kind: str, box: Box, centre: NDArray[np.float64], reach: float) -> ZoneFigure:
    middle, axes, half = (np.array(v) for v in (box.centre_m, box.axes, box.half_m))
    placed = OrientedBox(centre + middle, axes, half)
    near = centre + np.clip(placed.corners - centre, -reach, reach)
    return ZoneFigure(kind, box_edges(placed), near)


def box_edges(box: OrientedBox) -> NDArray[np.float64]:
    """Return the twelve edges of a box, (12, 2, 3): corners that differ in one sign."""
    pairs = [(a, b) for a, b in combinations(range(8), 2) if a ^ b in (1, 2, 4)]
    return box.corners[np.array(pairs)]


def best_direction(
    positions: NDArray[np.float64], centre: NDArray[np.float64], up: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the three-quarter direction from which devices overlap least, unit.

    Tried are 12 turns about `up` at heights of 20 to 40 degrees; the score is the least
    distance in the picture between two devices or a device and the object, relative to
    the picture, plus a preference for the side that the devices stand on.
    """
    right, ahead = facing(up, up)
    spots = np.concatenate([positions, centre[None]]) - centre
    side = spots.mean(axis=0)
    side = side / max(float(np.linalg.norm(side)), 1e-12)
    height, turn = np.deg2rad(list(product(_HEIGHTS, _TURNS))).T[:, :, None]
    level = np.cos(turn) * right + np.sin(turn) * ahead
    backs = np.sin(height) * up + np.cos(height) * level
    ways = np.array([one - other for one, other in combinations(spots, 2)])
    along = backs @ ways.T
    gaps = np.sqrt(np.maximum(np.sum(ways**2, axis=1) - along**2, 0.0))
    least = gaps.min(axis=1) / np.maximum(gaps.max(axis=1), 1e-12)
    # Rounded, so that the last bits don't choose between mirror images.
    score = np.round(np.minimum(least, 0.12) + 0.10 * backs @ side, 6)
    return backs[np.argmax(score)]


def close_directions(
    positions: NDArray[np.float64], centre: NDArray[np.float64], up: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return two views from the side that devices stand on, to its left and right.

    A little from above.
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
