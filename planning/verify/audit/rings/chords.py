"""How far the surface strays from a straight line between two rings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from planning.verify.audit.predicates.audit_optics import in_frame, ring_coordinate
from planning.verify.audit.predicates.predicates import AuditProjector

from .ring_light import RingLight, Strikes

_RAYS = 30_000
# Of the polar grid that tells where rays are worth casting.
_CELLS = 30, 72
_QUARTERS = np.array([[1.0, 1.0], [1.0, 3.0], [3.0, 1.0], [3.0, 3.0]]) / 4.0
# Chords with a crease so near are left out: in even gaps, and about the axis.
_CREASE_GAPS, _CREASE_RAD = 0.75, np.radians(1.5)


@dataclass(frozen=True, eq=False)
class Beam:
    """Random rays of a projector, and what they strike.

    Attributes:
        lamp: The projector.
        coordinates: Ring coordinates of the rays, shape (n,).
        azimuths: About the ring axis in [rad], shape (n,).
        strikes: Where they meet the surface.
    """

    lamp: AuditProjector
    coordinates: NDArray[np.float64]
    azimuths: NDArray[np.float64]
    strikes: Strikes


@dataclass(frozen=True, eq=False)
class Chords:
    """Straight lines between two points of the surface, one gap of rings apart.

    Attributes:
        middles: Ring coordinates of their middles, shape (n,).
        errors: Of each against the surface, along the beam at its middle [m], (n,).
    """

    middles: NDArray[np.float64]
    errors: NDArray[np.float64]


def random_beam(
    light: RingLight, lamp: AuditProjector, margin: float, rng: np.random.Generator
) -> Beam:
    """Cast rays, uniform in ring coordinate and azimuth where anything is lit.

    Four rays a cell of a polar grid find the cells that are lit, or lie beside one.

    Args:
        light: Casts them.
        lamp: The projector.
        margin: Least distance from the axis and from the last ring, in the coordinate.
        rng: Draws the rays.
    """
    size = np.array(
        [(lamp.radii[-1] - 2.0 * margin) / _CELLS[0], 2 * np.pi / _CELLS[1]]
    )
    corner = np.array([margin, 0.0])
    cells = np.indices(_CELLS).reshape(2, -1).T
    probes = np.repeat(cells, 4, axis=0) + np.tile(_QUARTERS, (len(cells), 1))
    coordinates, azimuths = (corner + size * probes).T
    met = light.strike(lamp, coordinates, azimuths)
    lit = np.zeros(_CELLS, dtype=bool)
    lit.ravel()[met.rays[met.lit] // 4] = True
    around = np.pad(np.pad(lit, ((1, 1), (0, 0))), ((0, 0), (1, 1)), mode="wrap")
    beside = np.lib.stride_tricks.sliding_window_view(around, (3, 3)).any(axis=(2, 3))
    used = cells[beside.ravel()]
    drawn = used[rng.integers(len(used), size=_RAYS if len(used) else 0)]
    coordinates, azimuths = (corner + size * (drawn + rng.uniform(size=drawn.shape))).T
    return Beam(lamp, coordinates, azimuths, light.strike(lamp, coordinates, azimuths))


def counted_chords(
    light: RingLight,
    beam: Beam,
    gap: float,
    creases: NDArray[np.float64],
    max_incidence: float,
) -> Chords:
    """Return the chords over one gap that count, about the rays of a beam.

    Lit at both ends and in the middle, neither half rising faster than tan(theta_max),
    no crease near; on the target, or anywhere if none of them is on it.

    Args:
        light: Casts the rays to the ends.
        beam: Rays to the middles.
        gap: Length of the chords in the ring coordinate.
        creases: Points close together along all creases, shape (n, 3).
        max_incidence: theta_max [rad].
    """
    strikes, lamp = beam.strikes, beam.lamp
    rays = strikes.rays[strikes.lit]
    c, azimuths = beam.coordinates[rays], beam.azimuths[rays]
    middle = strikes.height[strikes.lit]
    before, after = (
        _lit_heights(light, lamp, c + side * gap, azimuths) for side in (-0.5, 0.5)
    )
    steepest = np.tan(max_incidence)
    with np.errstate(invalid="ignore"):
        kept = (_rise(lamp, c - 0.5 * gap, before, c, middle) <= steepest) & (
            _rise(lamp, c, middle, c + 0.5 * gap, after) <= steepest
        )
    kept &= ~_near_crease(lamp, c, azimuths, creases, gap)
    on_target = kept & strikes.samples.in_target[strikes.lit]
    kept = on_target if np.any(on_target) else kept
    a = _meridian(lamp, c - 0.5 * gap, before)[kept]
    b = _meridian(lamp, c + 0.5 * gap, after)[kept]
    m = _meridian(lamp, c, middle)[kept]
    if lamp.diverging:
        along = m / np.linalg.norm(m, axis=1)[:, None]
    else:
        along = np.tile([0.0, 1.0], (len(m), 1))
    # The beam through m meets the line through a and b at m + s along.
    errors = np.abs(_cross(a - m, b - a) / _cross(along, b - a))
    return Chords(c[kept], errors)


def _lit_heights(
    light: RingLight,
    lamp: AuditProjector,
    coordinates: NDArray[np.float64],
    azimuths: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Heights in the ring frame where rays light the surface, NaN elsewhere, (n,)."""
    strikes = light.strike(lamp, coordinates, azimuths)
    heights = np.full(len(coordinates), np.nan)
    heights[strikes.rays[strikes.lit]] = strikes.height[strikes.lit]
    return heights


def _meridian(
    lamp: AuditProjector, coordinates: NDArray[np.float64], heights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (distance from the ring axis, height) in [m], shape (n, 2)."""
    radii = coordinates * heights if lamp.diverging else coordinates
    return np.column_stack([radii, heights])


def _rise(
    lamp: AuditProjector,
    c_0: NDArray[np.float64],
    z_0: NDArray[np.float64],
    c_1: NDArray[np.float64],
    z_1: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Mean tangent of the incidence between two points of a meridian, (n,).

    |dz / dc| in parallel light; |d ln t / d gamma| in diverging light, t the length of
    the ray and gamma its angle to the axis.
    """
    if not lamp.diverging:
        return np.abs(z_1 - z_0) / (c_1 - c_0)
    stretch = 0.5 * np.log((1.0 + c_1 * c_1) / (1.0 + c_0 * c_0))
    return np.abs(np.log(z_1 / z_0) + stretch) / (np.arctan(c_1) - np.arctan(c_0))


def _near_crease(
    lamp: AuditProjector,
    coordinates: NDArray[np.float64],
    azimuths: NDArray[np.float64],
    creases: NDArray[np.float64],
    gap: float,
) -> NDArray[np.bool_]:
    """Whether a crease lies about each ray, on whatever side of the object, (n,)."""
    ring = in_frame(lamp.world_from_ring, creases)
    if lamp.diverging:
        ring = ring[ring[:, 2] > 0.0]
    if len(ring) == 0:
        return np.zeros(len(coordinates), dtype=bool)
    turn = 2.0 * np.pi
    across = ring_coordinate(ring, lamp.diverging) / (_CREASE_GAPS * gap)
    about = _azimuth(ring)
    tree = KDTree(
        np.column_stack(
            [
                np.tile(across, 3),
                np.hstack([about - turn, about, about + turn]) / _CREASE_RAD,
            ]
        )
    )
    asked = np.column_stack(
        [coordinates / (_CREASE_GAPS * gap), azimuths / _CREASE_RAD]
    )
    distance, _ = tree.query(asked, p=np.inf, distance_upper_bound=1.0)
    return np.isfinite(distance)


def _azimuth(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.arctan2(ring[:, 1], ring[:, 0]) % (2.0 * np.pi)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
