"""Sensor heads, turntables and stations: what carries devices or the part.

Only values, as plans hold them; where they come to stand the planner and the checkers
each work out alone.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from geometry.arrays import Array

from .bodies import Body, Triple

Kind = Literal["projector", "camera"]
Size = tuple[float, float]


@dataclass(frozen=True, eq=False)
class HeadDevice:
    """A projector or camera of a head.

    Attributes:
        kind: `projector` or `camera`.
        name: As in the rig file.
        head_from_device: Its pose, 4 x 4 [m].
        model: Which of the rig's models it is; empty: the first.

    Raises:
        ValueError: If the pose isn't 4 x 4.
    """

    kind: Kind
    name: str
    head_from_device: Array
    model: str = ""

    def __post_init__(self) -> None:
        if self.head_from_device.shape != (4, 4):
            raise ValueError("head: poses must be 4 x 4")


@dataclass(frozen=True)
class MeasuringVolume:
    """The frustum about the head's z in which it measures, as its maker states it.

    At depth z, between near and far, it is a rectangle about the z axis::

        size(z) = near_size + (z - near) / (far - near) (far_size - near_size)

    Attributes:
        near_m: Its nearest depth z [m]; `far_m` its farthest.
        near_size_m: Extent along the head's x and y at the nearest depth [m].
        far_size_m: The same at the farthest.

    Raises:
        ValueError: If it holds nothing.
    """

    near_m: float
    far_m: float
    near_size_m: Size
    far_size_m: Size

    def __post_init__(self) -> None:
        if not 0.0 < self.near_m < self.far_m:
            raise ValueError(
                f"head: depths {self.near_m} to {self.far_m} m of the measuring "
                f"volume must rise from above 0"
            )
        if not all(side > 0.0 for side in (*self.near_size_m, *self.far_size_m)):
            raise ValueError("head: sizes of the measuring volume must be positive")

    def size_at(self, depth: Array) -> Array:
        """Return the extent along x and y at depths (...), shape (..., 2) [m]."""
        share = (np.asarray(depth) - self.near_m) / (self.far_m - self.near_m)
        near, far = np.array(self.near_size_m), np.array(self.far_size_m)
        return near + share[..., None] * (far - near)

    def plane(self, depth: float, n: int = 9) -> Array:
        """Return the middles of n x n equal parts of the rectangle at a depth [m]."""
        steps = (np.arange(n) + 0.5) / n - 0.5
        across = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        across = across * self.size_at(np.array(depth))
        return np.concatenate([across, np.full((len(across), 1), depth)], axis=1)

    def samples(self, n: int = 9) -> Array:
        """Return n planes of n x n points, nearest to farthest, (n n n, 3) [m]."""
        depths = np.linspace(self.near_m, self.far_m, n)
        return np.concatenate([self.plane(float(depth), n) for depth in depths])


@dataclass(frozen=True)
class HeadFigures:
    """What a maker states of a head; None: it doesn't.

    Attributes:
        at_m: The distance at which point distance and noise are stated [m].
        point_distance_m: Distance of neighbouring points there [m].
        noise_m: Standard deviation of a point along the view there [m].
        accuracy_m: What is stated as accuracy, whatever its maker means by it [m].
        baseline_m: From the projector to the farthest camera [m].
        sources: Of each figure of the rig file's table, by its dotted key.
    """

    at_m: float | None = None
    point_distance_m: float | None = None
    noise_m: float | None = None
    accuracy_m: float | None = None
    baseline_m: float | None = None
    sources: dict[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True, eq=False)
class Head:
    """One rigid body with its projectors and cameras.

    Its frame is a device's: x right, y down, z forward into the measuring volume.

    Attributes:
        name: As in the rig file.
        devices: Projectors first, then cameras, each as in the rig file.
        volume: Where it measures.
        working_m: Depth z of the surface at which it is meant to stand [m].
        body: Its housing in its frame; None: it takes no room.
        cross: Whether pairs of one head's projector and another's camera count too.
        figures: What its maker states.

    Raises:
        ValueError: If it lacks a projector or a camera.
    """

    name: str
    devices: tuple[HeadDevice, ...]
    volume: MeasuringVolume
    working_m: float
    body: Body | None = None
    cross: bool = False
    figures: HeadFigures = HeadFigures()

    def __post_init__(self) -> None:
        if not (self.projectors and self.cameras):
            raise ValueError("head: it needs a projector and a camera")

    @property
    def projectors(self) -> tuple[HeadDevice, ...]:
        """Its projectors."""
        return self.of("projector")

    @property
    def cameras(self) -> tuple[HeadDevice, ...]:
        """Its cameras."""
        return self.of("camera")

    def of(self, kind: str) -> tuple[HeadDevice, ...]:
        """Return the devices that are a `projector` or a `camera`."""
        return tuple(device for device in self.devices if device.kind == kind)

    @property
    def pairs(self) -> tuple[tuple[HeadDevice, HeadDevice], ...]:
        """Every projector with every camera."""
        return tuple((p, c) for p in self.projectors for c in self.cameras)

    @property
    def baseline_m(self) -> float:
        """From a projector to a camera, the farthest apart [m]."""
        return max(
            float(np.linalg.norm((p.head_from_device - c.head_from_device)[:3, 3]))
            for p, c in self.pairs
        )


@dataclass(frozen=True)
class Turntable:
    """A table that turns the part about an axis, while the devices stand.

    Attributes:
        point_m: A point of the axis, counted as places of the rig file are [m].
        axis: Its unit direction; the table turns about it by the right hand.
        steps: Angles are whole multiples of a turn over it; None: any angle.
        max_steps: How many angles may be used; None: as many as there are.
        still: Obstacles that stand still, by name; the others turn with the part.
        seconds_per_step: From one angle to the next [s]; None: it isn't said.

    Raises:
        ValueError: If the axis isn't of length 1.
    """

    point_m: Triple
    axis: Triple
    steps: int | None = None
    max_steps: int | None = None
    still: tuple[str, ...] = ()
    seconds_per_step: float | None = None

    def __post_init__(self) -> None:
        if not abs(math.hypot(*self.axis) - 1.0) < 1e-9:
            raise ValueError(f"turntable: axis = {self.axis} must be of length 1")

    def moved(self, by_m: Triple) -> "Turntable":
        """Return the turntable displaced: by `Workspace.origin_m` into the world."""
        x, y, z = (np.array(self.point_m) + np.array(by_m)).tolist()
        return replace(self, point_m=(x, y, z))

    def turn(self, angle: float) -> Array:
        """Return what the table does to the part when it turns by an angle, (4, 4).

        With unit axis a through p and K the matrix of ``a x`` (Rodrigues)::

            R = I + sin(angle) K + (1 - cos(angle)) K K,   P -> p + R (P - p)

        The rig as the part sees it has turned by minus the angle.

        Args:
            angle: In [rad].
        """
        x, y, z = self.axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        pose = np.eye(4)
        pose[:3, :3] += math.sin(angle) * cross
        pose[:3, :3] += (1.0 - math.cos(angle)) * cross @ cross
        point = np.array(self.point_m)
        pose[:3, 3] = point - pose[:3, :3] @ point
        return pose

    def move_s(self, n_steps: int) -> float | None:
        """Return what turning through so many steps takes [s]: (n - 1) t of one.

        None: it isn't said.
        """
        each = self.seconds_per_step
        return None if each is None else (n_steps - 1) * each

    @property
    def angles(self) -> tuple[float, ...]:
        """Angles of the steps [rad], from 0 up; none where any angle may be set."""
        steps = self.steps or 0
        return tuple(2.0 * math.pi * k / steps for k in range(steps))


@dataclass(frozen=True)
class Stations:
    """Poses of one head that is carried from one to the next.

    Attributes:
        max: How many there may be; None: as many as it takes.
        carrier: `robot` or `tripod`.
        seconds_per_metre: Of travel between them [s/m]; None: it isn't said.
        seconds_per_station: To come to rest at one [s]; None: it isn't said.
    """

    max: int | None
    carrier: Literal["robot", "tripod"]
    seconds_per_metre: float | None = None
    seconds_per_station: float | None = None

    def move_s(self, way_m: float, n_stations: int) -> float | None:
        """Return what being carried takes [s]: t of a metre times way, and t_rest n.

        What isn't said of the two is left out; None: nothing is.
        """
        each, rest = self.seconds_per_metre, self.seconds_per_station
        if each is None and rest is None:
            return None
        return way_m * (each or 0.0) + n_stations * (rest or 0.0)
