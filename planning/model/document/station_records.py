"""`stations` of a plan: poses of a sensor head, or steps of a turntable."""

from dataclasses import dataclass
from typing import Literal

from geometry.arrays import Array

from .part import Part, Pose


class StationRecord(Part):
    """Devices that measure together, and where they stand.

    Attributes:
        id: H1 and so on of heads, S1 of one head's stations, T1 of a turntable's steps.
        world_from_station: Of a head its pose; of a step what takes the devices, as
            they stand about the turntable, to where they are as the part sees them.
        angle: How far the turntable has turned the part [rad]; None: no turntable.
        projectors: Ids, `cameras` likewise.
    """

    id: str
    world_from_station: Pose
    angle: float | None = None
    projectors: tuple[str, ...]
    cameras: tuple[str, ...]


class StationCount(Part):
    """How many stations it takes, and what is proved of that.

    Attributes:
        count: Stations of the plan.
        needed: So many are enough for the candidates' samples, allowed or not; fresh
            samples may ask for more. None: no heads were found that are enough and
            whose housings keep off each other.
        lower_bound: Proven least number over the candidates.
        n_candidates: Of which they are chosen.
        n_samples: Frozen samples behind both.
        lit: Of these must be lit, at least.
        measured: Must be measured, at least: the more is lit, the more must be.
        proof: What proves the bound.
        everywhere: Least number over every pose of the workspace; None: not looked for.
        greedy: As many a greedy choice of the same candidates takes.
    """

    count: int
    needed: int | None
    lower_bound: int
    n_candidates: int
    n_samples: int
    lit: int
    measured: int
    proof: str
    everywhere: int | None = None
    greedy: int | None = None


class TradeRow(Part):
    """The fewest steps of a turntable for a number of devices; None: none are enough.

    Attributes:
        lower_bound: Proven least number of steps over the candidates.
    """

    projectors: int
    cameras: int
    steps: int | None
    lower_bound: int


class StationsRecord(Part):
    """Where the same devices measure one after the other, or heads side by side.

    A projector and a camera make a pair where their stations are the same.

    Attributes:
        kind: Several `heads`, `stations` of one, or steps of a `turntable`.
        head: Name of the head.
        cross: Whether pairs across heads count too; then no device names a station.
        stations: In the order in which they measure.
        n_reference: Heads of the reference set, each one's devices after another's; 0:
            its devices measure with any of the plan.
        point_m: On the axis of the turntable; `axis` is its direction.
        way_m: Way of a head from the first of its stations to the last [m].
        move_s: What moves between the stations, or steps, take of what the rig states
            of them [s]; None: it states nothing.
        steps: The fewest for other numbers of devices.
    """

    kind: Literal["heads", "stations", "turntable"]
    head: str = ""
    cross: bool = False
    stations: tuple[StationRecord, ...]
    n_reference: int = 0
    count: StationCount | None = None
    point_m: tuple[float, float, float] | None = None
    axis: tuple[float, float, float] | None = None
    way_m: float | None = None
    move_s: float | None = None
    steps: tuple[TradeRow, ...] = ()


@dataclass(frozen=True, eq=False)
class Placement:
    """A station: where it is, and how many of the devices in order are there."""

    id: str
    world_from_station: Array
    n_projectors: int
    n_cameras: int
    angle: float | None = None


@dataclass(frozen=True, eq=False)
class Stationed:
    """Stations of a plan in the making.

    Attributes:
        placements: In the order of the devices.
        record: All but the stations.
    """

    placements: tuple[Placement, ...]
    record: StationsRecord
