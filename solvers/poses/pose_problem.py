"""Data of the pose program; `pose_program` solves it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .compiled import Light, check_program

# Hard limits are kept by this share of the size, well above IPOPT's tolerance.
INSET = 1e-6


@dataclass(frozen=True, eq=False)
class PoseProgram:
    """One projector and the samples that it must serve.

    Attributes:
        points: Samples P in [m], shape (n, 3).
        normals: Outward unit normals N, shape (n, 3).
        steep: Unit steep directions T, zero where there is none, shape (n, 3).
        light: Kind of light.
        world_from_device: Pose to start from, shape (4, 4).
        max_incidence: Largest angle of -L to N in [rad].
        min_tangent_angle: Least angle of L to the line of T in [rad].
        range_m: Limits of |P - Q| (diverging) or X_z (parallel) in [m].
        shell_m: Limits of |Q - centre| in [m].
        centre: Centre of the workspace in [m], shape (3,).
        axis: Axis of the workspace cone, unit, shape (3,).
        sides: Least and largest x and y of the field, as tangents x/z (diverging) or
            in [m] (parallel), shape (2, 2).
        half_angle: Opening of that cone in [rad]; pi doesn't bind.
        beam_radius_m: Largest distance from the optical axis; parallel light only.
        ring_radius: Largest ring, a tangent (diverging) or in [m] (parallel).
        ring_from_device: Ring frame, fixed to the device, shape (4, 4).
        up: Unit vector away from the floor, shape (3,).
        floor: Least up.Q in [m].
        max_move_m: Largest change of each coordinate of Q in [m].
        half_spaces: Rows (n, d), unit n and d in [m], of half-spaces n.Q >= d that hold
            Q, shape (k, 4).

    Raises:
        ValueError: If an array has the wrong shape, a number isn't finite, or a limit
            is empty.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    steep: NDArray[np.float64]
    light: Light
    world_from_device: NDArray[np.float64]
    max_incidence: float
    min_tangent_angle: float
    range_m: tuple[float, float]
    shell_m: tuple[float, float]
    centre: NDArray[np.float64]
    axis: NDArray[np.float64]
    sides: NDArray[np.float64]
    half_angle: float = np.pi
    beam_radius_m: float = np.inf
    ring_radius: float = np.inf
    ring_from_device: NDArray[np.float64] | None = None
    up: NDArray[np.float64] | None = None
    floor: float = -np.inf
    max_move_m: float = np.inf
    half_spaces: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4)))

    def __post_init__(self) -> None:
        n = len(self.points)
        if n == 0:
            raise ValueError("points is empty: a pose needs a sample to serve")
        shapes = {"points": (n, 3), "normals": (n, 3), "steep": (n, 3)}
        shapes |= {"world_from_device": (4, 4), "centre": (3,), "axis": (3,)}
        shapes |= {"sides": (2, 2)}
        check_program(self, self.light, shapes)
        for name in ("range_m", "shell_m"):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high < np.inf:
                raise ValueError(f"{name} is {low} to {high}: empty or not finite")
        for name in ("max_incidence", "min_tangent_angle"):
            if not 0.0 <= getattr(self, name) <= np.pi / 2:
                raise ValueError(f"{name} must lie within 0 and pi/2")
        planes = self.half_spaces
        if planes.ndim != 2 or planes.shape[1] != 4 or not np.all(np.isfinite(planes)):
            raise ValueError(f"half_spaces must be finite, (k, 4), is {planes.shape}")


def light_directions(
    program: PoseProgram, world_from_device: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return L at every sample, unit, shape (n, 3)."""
    if program.light == "parallel":
        return np.broadcast_to(world_from_device[:3, 2], program.points.shape)
    away = program.points - world_from_device[:3, 3]
    return away / np.linalg.norm(away, axis=1, keepdims=True)


def pose_margins(
    program: PoseProgram, world_from_device: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the margin of every sample in [rad], shape (n,).

    min(max_incidence - incidence, tangent angle - min_tangent_angle), the second only
    where there is a steep direction.
    """
    light = light_directions(program, world_from_device)
    facing = -np.sum(program.normals * light, axis=1)
    along = np.abs(np.sum(program.steep * light, axis=1))
    margin = program.max_incidence - np.arccos(np.clip(facing, -1.0, 1.0))
    tangent = np.arccos(np.clip(along, 0.0, 1.0)) - program.min_tangent_angle
    steep = np.any(program.steep != 0.0, axis=1)
    return np.where(steep, np.minimum(margin, tangent), margin)
