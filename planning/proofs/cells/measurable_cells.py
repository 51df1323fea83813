"""What may be measured from anywhere in a cell of camera positions: a superset.

Seen from sample P, the cell lies within psi of the direction u_c, at t_c -+ e. A limit
keeps a sample out only if it fails for every direction in that cone, at every distance,
and wherever in the image the sample may appear. With w = N x m, |v| = |r x w| and the
image's bounds on |g| / |v| and on z / t (`image_cone`)::

    incidence <= theta + psi
    |r.m|   <= cos(max(0, acos|u_c.m| - psi))               must reach min_conditioning
    |N.r|   <= cos(max(0, incidence_c - psi))
            >= cos(min(theta, incidence_c + psi))
    |v|     >= |w| sin(max(0, angle(u_c, line of w) - psi)),   |g| >= |v| least_turn
    sigma^2 >= ((s_px t |g|)^2 + (s_v |v|)^2 + (s_m |N.r|)^2) / |r.m|^2
            for t >= t_c - e; s_v and s_m of errors     must not exceed the limit's
    pitch   <= h |N.r| / ((t_c - e) |g|)                    must reach min_ring_pitch
    z       >= (t_c - e) cos(off axis),  z / (f |N.r|)      must not exceed the limit

Of coded pixels m turns with r (`crossings`). A sample stays if that holds for some
projector that lights it, and some model of the cameras. Bodies of devices are left out.
The symbols and limits are those of `measurability`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import by_column, dot
from geometry.devices import PinholeModel
from planning.model.requirements import Requirements
from planning.scene.codes.surfaces import CodedPixels
from planning.scene.limits.camera_limits import CAMERA_LIMITS, CellView
from planning.scene.limits.limit import may_hold
from planning.scene.limits.pair_limits import PAIR_LIMITS
from planning.scene.measuring.measured import LitSamples

from .crossings import Cone, PixelCrossings, RingCrossings, farthest_cos, nearest_cos
from .image_cone import ImageCone, image_cone

_Array = NDArray[np.float64]

_TINY = 1e-12


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
        self._normals = np.asfortranarray(samples.target.samples.normals)
        self._lit = samples.lit.T
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
        self._crossings: list[RingCrossings | PixelCrossings] = [
            PixelCrossings(self._normals, coded, self._pair, cosine)
            if isinstance(coded, CodedPixels)
            else RingCrossings(self._normals, coded, self._pair)
            for coded, cosine in zip(samples.surfaces, cosines, strict=True)
        ]

    def admits(
        self,
        samples: NDArray[np.int64],
        towards: _Array,
        nearest: _Array,
        psi: _Array,
    ) -> NDArray[np.bool_]:
        """Return which samples a camera in a cell may measure, as `CellLimits`."""
        self._check_cancelled()
        cone = Cone.of(towards, psi)
        middle = dot(by_column(self._normals, samples), towards)
        most, least = nearest_cos(middle, cone), farthest_cos(np.abs(middle), cone)
        least = np.maximum(least, np.cos(self._camera.max_incidence))
        moved_m = self._pair.limited_calibration.along_axis_m
        admitted = np.zeros(samples.size, dtype=bool)
        for lens in self._lenses:
            depth = nearest * np.cos(lens.image.off_axis)
            cell = CellView(most, depth, lens.focal_px)
            seen = may_hold(CAMERA_LIMITS, cell, self._camera, len(samples))
            turn = nearest * lens.image.least_turn
            for p, crossing in enumerate(self._crossings):
                lit = self._lit[p].take(samples)
                at = np.flatnonzero(lit & seen & ~admitted)
                k = samples[at]
                facing = least[at], most[at]
                pair = crossing.best(k, cone.take(at), facing, turn[at])
                # As pixels, so that times t |g| they are at least what moves by |v|.
                moved = moved_m / np.maximum(turn[at], _TINY)
                noise = np.hypot(lens.noise_px[p].take(k), moved)
                pair = replace(pair, noise=noise)
                admitted[at] = may_hold(PAIR_LIMITS, pair, self._pair, len(k))
        return admitted
