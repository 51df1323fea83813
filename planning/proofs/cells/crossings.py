"""The best that surfaces of equal code offer to rays from anywhere in a cone.

Of rings the normal m is fixed at a sample. Of coded pixels it is that part of the ray
across the light, so that all follows from the angle a at which ray and light meet, and
from the incidence b of the light on the sample::

    |r.m| = sin a,   a_c - psi <= a <= a_c + psi
    |v| / |r.m| = |N + m k|,   k = -(N.r) / (r.m) >= k_least,   |N.m| <= sin b
        >= cos b                             where k_least <= sin b, and else
        >= sqrt(1 - 2 k_least sin b + k_least^2)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import by_column, dot, lengths
from planning.model.requirements import TriangulationLimits
from planning.scene.codes.surfaces import CodedPixels, CodeSurfaces
from planning.scene.limits.calibration_terms import surface_deviation
from planning.scene.limits.code_noise import least_phase_px
from planning.scene.limits.pair_quality import PairCell

_Array = NDArray[np.float64]
_Index = NDArray[np.int64]

# What rounding of unit vectors and of their product takes from 1 - c^2, and more.
_SQUARE_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class Cone:
    """Unit directions u from k samples, (k, 3), and what is within psi, (k,)."""

    towards: _Array
    psi: _Array
    cosine: _Array
    sine: _Array

    @classmethod
    def of(cls, towards: _Array, psi: _Array) -> "Cone":
        """Return the cones of psi [rad] about directions."""
        return cls(towards, psi, np.cos(psi), np.sin(psi))

    def take(self, at: _Index) -> "Cone":
        """Return some of the cones."""
        towards = by_column(self.towards, at)
        return Cone(towards, self.psi[at], self.cosine[at], self.sine[at])


class RingCrossings:
    """What one projector's rings offer; m and h don't depend on the ray."""

    def __init__(
        self,
        normals: _Array,
        rings: CodeSurfaces,
        limits: TriangulationLimits,
    ) -> None:
        self._across = np.asfortranarray(rings.normals)
        self._spacing = rings.spacing
        placed = surface_deviation(limits.limited_calibration, rings.levers)
        self._placed = np.hypot(placed, limits.ring_sigma_m or 0.0)
        along = np.cross(normals, self._across)
        self._width = lengths(along)
        along /= np.where(self._width > 0.0, self._width, 1.0)[:, None]
        self._along = np.asfortranarray(along)

    def best(
        self, k: _Index, cone: Cone, facing: tuple[_Array, _Array], turn: _Array
    ) -> PairCell:
        """Return the best of samples k, seen at least and most squarely: |N.r|.

        `turn` is least t |g| / |v| [m].
        """
        u = cone.towards
        crossing = nearest_cos(np.abs(dot(by_column(self._across, k), u)), cone)
        sine = _least_sine(np.abs(dot(by_column(self._along, k), u)), cone)
        shift, no_noise = turn * self._width[k] * sine, np.zeros(len(k))
        placed, spacing = self._placed[k] * facing[0], self._spacing[k]
        return PairCell(crossing, facing[1], shift, no_noise, spacing, placed)


class PixelCrossings:
    """What one projector's coded pixels offer."""

    def __init__(
        self,
        normals: _Array,
        coded: CodedPixels,
        limits: TriangulationLimits,
        incidence_cos: _Array,
    ) -> None:
        self._normals, self._beams = normals, coded.beams
        self._cosine = np.clip(incidence_cos, 0.0, 1.0)
        self._sine = np.sqrt(1.0 - self._cosine**2)
        self._placed = _least_moved(coded, limits, self._cosine)

    def best(
        self, k: _Index, cone: Cone, facing: tuple[_Array, _Array], turn: _Array
    ) -> PairCell:
        """Return the best of samples k, as `RingCrossings` does."""
        u, psi = cone.towards, cone.psi
        beams, normals = by_column(self._beams, k), by_column(self._normals, k)
        angle = np.arccos(np.clip(-dot(beams, u), -1.0, 1.0))
        least, most = np.maximum(angle - psi, 0.0), np.minimum(angle + psi, np.pi)
        middle = np.clip(0.5 * np.pi, least, most)
        crossing = np.sin(middle)
        turned_off = np.arccos(np.clip(dot(normals, u), -1.0, 1.0))
        steepest = np.maximum(np.cos(np.minimum(turned_off + psi, 0.5 * np.pi)), 0.0)
        ratio = steepest / np.maximum(crossing, 1e-12)
        sine = self._sine[k]
        square = 1.0 - 2.0 * ratio * sine + ratio**2
        beyond = np.sqrt(np.maximum(square, 0.0))
        per = np.where(ratio <= sine, self._cosine[k], beyond)
        shift, endless = turn * per * crossing, np.full(len(k), np.inf)
        return PairCell(
            *(crossing, facing[1], shift, np.zeros(len(k)), endless),
            self._placed[k] * facing[0],
            angles=(least, most),
        )


def _least_moved(
    coded: CodedPixels, limits: TriangulationLimits, incidence_cos: _Array
) -> _Array:
    """Return what the surfaces of coded pixels are off along any m at least [m], (n,).

    A turn of a projector moves all light across itself by |P - Q| in light from a
    point; a pixel moves it by the least of the singular values of D.
    """
    errors = limits.limited_calibration
    singular = np.linalg.svd(coded.panel.per_px, compute_uv=False)
    pixel = singular[:, 1].astype(np.float64)
    offsets = coded.panel.offsets
    along = np.abs(dot(offsets, coded.beams))
    told = least_phase_px(coded.code, limits, incidence_cos) * pixel
    moved = surface_deviation(
        errors, np.column_stack([along, np.zeros(len(along)), pixel])
    )
    return np.hypot(moved, told)


def nearest_cos(c: _Array, cone: Cone) -> _Array:
    """Return the largest cosine within psi of a direction whose cosine is c."""
    s = np.sqrt(np.maximum(1.0 - c * c, 0.0))
    return np.where(c >= cone.cosine, 1.0, c * cone.cosine + s * cone.sine)


def farthest_cos(c: _Array, cone: Cone) -> _Array:
    """Return the least |cosine| within psi of a direction whose |cosine| is c.

    Of a vector of length 0 it is 0.
    """
    # A cosine near 1 tells its sine only to 1e-8, by which psi would be too small.
    s = np.sqrt(np.maximum(1.0 - c * c, 0.0) + _SQUARE_ROUNDING)
    # At a right angle and beyond, the line is crossed.
    crossed = (c <= cone.sine) | (cone.psi >= 0.5 * np.pi)
    least = np.maximum(c * cone.cosine - s * cone.sine, 0.0)
    return np.where(crossed, 0.0, least)


def _least_sine(c: _Array, cone: Cone) -> _Array:
    """Return the least sine to a line within psi of a direction of cosine c to it."""
    s = np.sqrt(np.maximum(1.0 - c * c, 0.0))
    off = np.maximum(s * cone.cosine - c * cone.sine, 0.0)
    return np.where(c >= cone.cosine, 0.0, off)
