"""Data of the program that maximises baselines; `baseline_program` solves it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PositionShell:
    """Where camera centres may stand: a shell, a cone cut from it, a floor.

    Attributes:
        centre: Centre of the shell in [m], shape (3,).
        radius: Least and largest distance from the centre in [m].
        axis: Unit axis of the cone, shape (3,).
        half_angle: Half opening of the cone in [rad]; pi is the whole shell.
        up: Unit vector, shape (3,).
        floor: Least height above the centre along `up` in [m]; None: no floor.
    """

    centre: _Array
    radius: tuple[float, float]
    axis: _Array
    half_angle: float
    up: _Array
    floor: float | None = None


@dataclass(frozen=True, eq=False)
class HalfSpaces:
    """Half-spaces n.(O_c - centre) >= d that hold camera centres; one row each.

    Attributes:
        camera: Index of the camera, shape (h,).
        normals: Unit normals n, shape (h, 3).
        offsets: d in [m], shape (h,).
    """

    camera: NDArray[np.int64]
    normals: _Array
    offsets: _Array


@dataclass(frozen=True, eq=False)
class SeamPoints:
    """Points E where the parts of two cameras meet; every array has one row a point.

    Attributes:
        cameras: Indices of camera 1 and camera 2, shape (s, 2).
        points: E in [m], shape (s, 3).
        outward: Unit normal in the plane O1, E, O2 at the start, shape (s, 3).
        onward: Unit direction in it towards camera 2's stretch, shape (s, 3).
        turn: delta, turn of the surface at E, convex positive [rad], shape (s,).
        half_fields: b_1 and b_2 in [rad], shape (s, 2).
    """

    cameras: NDArray[np.int64]
    points: _Array
    outward: _Array
    onward: _Array
    turn: _Array
    half_fields: _Array


@dataclass(frozen=True, eq=False)
class KeptPoints:
    """Points that one camera must go on to measure; one row a point.

    Attributes:
        camera: Index of the camera, shape (m,).
        points: P in [m], shape (m, 3).
        normals: Unit normals, shape (m, 3).
        ring_normals: Ring normals m, signed so that m.r > 0 at the start, shape (m, 3);
            zero rows don't bind.
        sigma: q in [1/m], shape (m,): s_N <= its limit; 0 doesn't bind; None: none.
        pitch: p in [1/m], shape (m,): ring pitch >= its limit; likewise.
    """

    camera: NDArray[np.int64]
    points: _Array
    normals: _Array
    ring_normals: _Array
    sigma: _Array | None = None
    pitch: _Array | None = None


@dataclass(frozen=True, eq=False)
class BaselineProblem:
    """Data of the program that `baseline_program` states.

    Attributes:
        centres: O_c to start from in [m], shape (k, 3).
        aims: Point that each camera looks at in [m], shape (k, 3).
        pairs: Indices of neighbouring cameras, shape (p, 2), p >= 1.
        shell: Where centres may stand.
        seams: Where parts meet.
        kept: What each camera must keep.
        rolls: Turns of the cameras about their axes against `look_at` [rad], (k,).
        ups: Up of each camera in that, shape (k, 3); None: that of the shell.
        sides: Least and largest x/z and y/z in the image, shape (2, 2).
        max_incidence: theta in [rad].
        range_m: Least and largest |O - P| of kept points in [m].
        min_conditioning: e, least |r.m| of kept points.
        max_step: Farthest that a centre may move in [m].
        half_spaces: What else holds the centres.
        fixed: Cameras that stay where they are, wherever that is, shape (f,).
        weights: None: baselines are maximised and no limit gives way. Else what a limit
            that gives way costs: at each kept point but the last 2 e, then at each of e
            ends of parts, shape (m - e,).
        reserves: What the tightest limit of camera 1 leaves at the start where its part
            ends at E, shape (e,). The last 2 e kept points are first these E for camera
            1, then what lies beyond each for camera 2.
    """

    centres: _Array
    aims: _Array
    pairs: NDArray[np.int64]
    shell: PositionShell
    seams: SeamPoints
    kept: KeptPoints
    rolls: _Array
    sides: _Array
    max_incidence: float
    range_m: tuple[float, float]
    min_conditioning: float
    max_step: float
    half_spaces: HalfSpaces = field(
        default_factory=lambda: HalfSpaces(
            np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(0)
        )
    )
    fixed: tuple[int, ...] = ()
    weights: _Array | None = None
    ups: _Array | None = None
    reserves: _Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        k = len(self.centres)
        if self.centres.shape != (k, 3) or self.aims.shape != (k, 3):
            raise ValueError(f"centres and aims must be ({k}, 3)")
        least = 0 if self.elastic else 1
        if self.pairs.shape[1:] != (2,) or len(self.pairs) < least:
            raise ValueError(
                f"pairs must be (p, 2) with p >= {least}, got {self.pairs.shape}"
            )
        indices = [self.pairs, self.seams.cameras, self.kept.camera]
        indices += [self.half_spaces.camera, np.array(self.fixed, dtype=np.int64)]
        if not all(np.all((i >= 0) & (i < k)) for i in indices):
            raise ValueError(f"camera indices must lie in 0 to {k - 1}")
        if not 0.0 < self.max_step < np.inf:
            raise ValueError(f"max_step is {self.max_step} m, must be positive")
        if not np.all(np.linalg.norm(self.aims - self.centres, axis=1) > 0.0):
            raise ValueError("an aim coincides with its camera's centre")

    @property
    def elastic(self) -> bool:
        """Whether limits give way."""
        return self.weights is not None

    @property
    def smallest_baseline(self) -> float:
        """Smallest baseline of neighbours at the start in [m]; 0 without any."""
        if not len(self.pairs):
            return 0.0
        return smallest_baseline(self.centres, self.pairs)


def smallest_baseline(centres: _Array, pairs: NDArray[np.int64]) -> float:
    """Return the smallest distance over pairs of centres in [m]."""
    apart = centres[pairs[:, 0]] - centres[pairs[:, 1]]
    return float(np.linalg.norm(apart, axis=1).min())
