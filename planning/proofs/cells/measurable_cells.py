"""What may be measured from anywhere in a cell of camera positions: a superset.

Seen from sample P, the cell lies within psi of the direction u_c, at t_c -+ e. A limit
keeps a sample out only if it fails for every direction in that cone, at every distance,
and wherever in the image the sample may appear. With w = N x m, |v| = |r x w| and the
image's bounds on |g| / |v| and on z / t (`image_cone`)::

    incidence <= theta + psi
    |r.m|   <= cos(max(0, acos|u_c.m| - psi))               must reach min_conditioning
    |N.r|   <= cos(max(0, incidence_c - psi))
    |g|     >= |w| sin(max(0, angle(u_c, line of w) - psi)) least_turn
    sigma   >= s_px (t_c - e) |g| / |r.m|                   must not exceed the limit
    pitch   <= h |N.r| / ((t_c - e) |g|)                    must reach min_ring_pitch
    z       >= (t_c - e) cos(off axis),  z / (f |N.r|)      must not exceed the limit

A sample stays if that holds for some projector that lights it, and some model of the
cameras. Bodies of devices are left out. The symbols and limits are those of
`measurability`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.model.requirements import Requirements
from planning.scene.limits.calibration_terms import surface_deviation
from planning.scene.limits.camera_limits import CAMERA_LIMITS, CellView
from planning.scene.limits.limit import may_hold
from planning.scene.limits.pair_limits import PAIR_LIMITS, PairCell
from planning.scene.measured import LitSamples

from .image_cone import ImageCone, image_cone

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Lens:
    """A model of the cameras, and the least noise of edges in it, (n_p, n) [px]."""

    image: ImageCone
    focal_px: float
    noise_px: _Array


class MeasurableCells:
    """Says which samples a camera in a cell may measure; the `limits` of its tree."""

    def __init__(
        self,
        samples: LitSamples,
        required: Requirements,
        devices: Sequence[PinholeModel],
        *,
        check_cancelled: Callable[[], None] = lambda: None,
    ) -> None:
        self._check_cancelled = check_cancelled
        self._camera, self._pair = required.camera, required.triangulation
        normals = samples.target.samples.normals
        self._normals, self._lit = normals, samples.lit
        self._across = np.stack([ring.normals for ring in samples.surfaces])
        self._spacing = np.stack([ring.spacing for ring in samples.surfaces])
        cosines = np.stack([light.incidence_cos for light in samples.lights])
        errors = self._pair.limited_calibration
        edge = self._pair.noise_px / np.maximum(cosines, 1e-9)
        self._lenses: list[_Lens] = []
        for device in devices:
            image = image_cone(device)
            # So that times the least |g|, least_turn |v|, a turn moves a ray by |v|.
            turned = errors.about_axis / image.least_turn
            noise = np.sqrt(edge**2 + turned**2 + errors.along_line_px**2)
            self._lenses.append(_Lens(image, device.focal_px, noise))
        levers = np.stack([ring.levers for ring in samples.surfaces])
        placed = surface_deviation(errors, levers)
        squarely = np.cos(self._camera.max_incidence)
        self._placed = np.hypot(placed, self._pair.ring_sigma_m or 0.0) * squarely
        along = np.cross(normals, self._across)
        self._width = np.linalg.norm(along, axis=2)
        self._along = along / np.where(self._width > 0.0, self._width, 1.0)[..., None]

    def admits(
        self,
        samples: NDArray[np.int64],
        towards: _Array,
        nearest: _Array,
        psi: _Array,
    ) -> NDArray[np.bool_]:
        """Return which samples a camera in a cell may measure, each with its cell.

        Args:
            samples: Their numbers, shape (k,).
            towards: Unit directions from them to the cell's middle, shape (k, 3).
            nearest: No place of the cell is nearer to them, in [m], shape (k,).
            psi: Angle about `towards` that holds the cell [rad], shape (k,).
        """
        self._check_cancelled()
        cosine, sine = np.cos(psi), np.sin(psi)
        facing = _nearest(_dot(self._normals[samples], towards), cosine, sine)
        admitted = np.zeros(samples.size, dtype=bool)
        for lens in self._lenses:
            depth = nearest * np.cos(lens.image.off_axis)
            cell = CellView(facing, depth, lens.focal_px)
            seen = may_hold(CAMERA_LIMITS, cell, self._camera, len(samples))
            for p in range(self._lit.shape[1]):
                at = np.flatnonzero(self._lit[samples, p] & seen & ~admitted)
                k, u, c, s = samples[at], towards[at], cosine[at], sine[at]
                crossing = _nearest(np.abs(_dot(self._across[p, k], u)), c, s)
                turn = _least_sine(np.abs(_dot(self._along[p, k], u)), c, s)
                g = nearest[at] * lens.image.least_turn * self._width[p, k] * turn
                noise, spacing = lens.noise_px[p, k], self._spacing[p, k]
                placed = self._placed[p, k]
                pair = PairCell(crossing, facing[at], g, noise, spacing, placed)
                admitted[at] = may_hold(PAIR_LIMITS, pair, self._pair, len(k))
        return admitted


def _nearest(c: _Array, cosine: _Array, sine: _Array) -> _Array:
    """Return the largest cosine within psi of a direction whose cosine is c."""
    s = np.sqrt(np.maximum(1.0 - c * c, 0.0))
    return np.where(c >= cosine, 1.0, c * cosine + s * sine)


def _least_sine(c: _Array, cosine: _Array, sine: _Array) -> _Array:
    """Return the least sine to a line within psi of a direction of cosine c to it."""
    s = np.sqrt(np.maximum(1.0 - c * c, 0.0))
    return np.where(c >= cosine, 0.0, np.maximum(s * cosine - c * sine, 0.0))


def _dot(a: _Array, b: _Array) -> _Array:
    return np.einsum("ij,ij->i", a, b)
