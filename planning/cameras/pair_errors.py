"""What errors of a calibration do to the points of the best pairs, device by device.

To first order the error of a point is a sum over the errors of its two devices (the
vectors behind `calibration_terms`), so that the mean square over the points of one rig
is a quadratic form x^T M x of normal deviates x, M = mean of a a^T over the points.
Its distribution is nearly that of g times a chi-square variable of h degrees of
freedom with the same mean and variance, g = tr M^2 / tr M and h = (tr M)^2 / tr M^2
(Satterthwaite 1946, "An approximate distribution of estimates of variance components"):
errors that many points share through few devices make a rig's error vary more.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from planning.model.devices.calibration_errors import PERFECT
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import TriangulationLimits
from planning.scene.limits.pair_quality import NOISE_TERMS
from planning.scene.measuring.camera_views import CameraView
from planning.scene.measuring.measured import LitSamples, Pair, pairs_of

_Array = NDArray[np.float64]
_Index = NDArray[np.int64]

# Turn and displacement about and along three axes, focal length, principal point; of a
# projector along the line that counts most.
_BY_CAMERA, _BY_PROJECTOR = 9, 8


@dataclass(frozen=True, eq=False)
class PairErrors:
    """The best pair of each of n samples with each of m cameras.

    Attributes:
        sigma: Deviation of the pair, of noise and of what a calibration leaves [m], inf
            where none measures, shape (n, m).
        place: Of that pair in what follows, -1 where none measures, shape (n, m).
        noise: Its deviation of noise alone [m], shape (k,).
        projector: Its projector, shape (k,).
        by_projector: What each error of the projector moves the point by along the
            normal, one standard deviation of it [m], shape (k, 8).
        by_camera: The same of the camera, shape (k, 9).
    """

    sigma: _Array
    place: _Index
    noise: _Array
    projector: _Index
    by_projector: _Array
    by_camera: _Array

    @classmethod
    def of(
        cls,
        limits: TriangulationLimits,
        projectors: Sequence[PlannedProjector],
        samples: LitSamples,
        views: Sequence[CameraView],
    ) -> Self:
        """Look at lit samples with the views of m cameras."""
        n, m = len(samples.target), len(views)
        sigma, place = np.full((n, m), np.inf), np.full((n, m), -1)
        lists: list[_Array] = []
        count = 0
        for c, seen in enumerate(views):
            total = np.full(len(seen.samples), np.inf)
            errors = np.zeros((len(total), 2 + _BY_PROJECTOR + _BY_CAMERA))
            for pair in pairs_of(limits, samples, seen.view, samples=seen.samples):
                found = np.where(pair.measured, pair.quality.total, np.inf)
                better = np.flatnonzero(found < total[pair.places])
                at = pair.places[better]
                total[at] = found[better]
                source = projectors[pair.projector]
                errors[at] = _errors(limits, samples, pair, better, source)
            some = np.flatnonzero(np.isfinite(total))
            rows = seen.samples[some]
            sigma[rows, c] = total[some]
            place[rows, c] = count + np.arange(len(some))
            lists.append(errors[some])
            count += len(some)
        every = np.concatenate(lists)
        middle = 2 + _BY_PROJECTOR
        return cls(
            sigma,
            place,
            every[:, 1],
            every[:, 0].astype(np.int64),
            every[:, 2:middle],
            every[:, middle:],
        )

    def measured(self, cameras: Sequence[int]) -> NDArray[np.bool_]:
        """Return which samples cameras measure, shape (n,)."""
        return np.any(np.isfinite(self.sigma[:, cameras]), axis=1)

    def of_rigs(self, cameras: Sequence[int], quantile: float) -> float:
        """Return that quantile of rigs' rms errors over what cameras measure [m]."""
        chosen = np.array(cameras, dtype=np.int64)
        best = self.sigma[:, chosen].argmin(axis=1)
        at = self.place[np.arange(len(best)), chosen[best]]
        best, at = best[at >= 0], at[at >= 0]
        if not len(at):
            return np.inf
        mine = (at[best == k] for k in np.unique(best).tolist())
        own = [self._spread(each) / len(at) for each in mine]
        # Errors of a projector hang together over the pairs of all cameras.
        shared = _BY_PROJECTOR * (int(self.projector.max()) + 1)
        light = sum(form[:shared, :shared] for form in own)
        trace, square = float(np.trace(light)), float(np.sum(np.square(light)))
        for form in own:
            view = form[shared:]
            trace += float(np.trace(view[:, shared:]))
            square += float(np.sum(np.square(view[:, shared:])))
            square += 2.0 * float(np.sum(np.square(view[:, :shared])))
        noise = float(np.mean(np.square(self.noise[at])))
        return float(np.sqrt(noise + _quantile(trace, square, quantile)))

    def _spread(self, at: _Index) -> _Array:
        """Sum of a a^T over pairs of one camera: all projectors' errors, then its own.

        Shape (8 n_projectors + 9, 8 n_projectors + 9).
        """
        n = int(self.projector.max()) + 1
        rows = np.zeros((len(at), _BY_PROJECTOR * n + _BY_CAMERA))
        first = _BY_PROJECTOR * self.projector[at]
        columns = first[:, None] + np.arange(_BY_PROJECTOR)
        np.put_along_axis(rows, columns, self.by_projector[at], axis=1)
        rows[:, -_BY_CAMERA:] = self.by_camera[at]
        return rows.T @ rows


def _quantile(trace: float, square: float, quantile: float) -> float:
    """Of x^T M x with tr M and tr M^2."""
    if not trace:
        return 0.0
    # Of a chi-square variable; all of scipy's distributions take a second to load.
    chi_square = 2.0 * gammaincinv(0.5 * (trace * trace / square), quantile)
    return square / trace * float(chi_square)


def _errors(
    limits: TriangulationLimits,
    samples: LitSamples,
    pair: Pair,
    some: _Index,
    projector: PlannedProjector,
) -> _Array:
    """Projector, s_N, then errors by the projector's and the camera's, (k, 19)."""
    errors, view = limits.calibration or PERFECT, pair.quality.view.take(some)
    rows, seen = pair.samples[some], samples.target.samples
    coded, points = samples.surfaces[pair.projector].take(rows), seen.points[rows]
    surfaces = coded.towards(view.rays)
    r, m, t = view.rays, surfaces.normals, view.distances[:, None]
    along = np.einsum("ij,ij->i", r, m)[:, None]
    facing = view.facing[:, None]
    v = (seen.normals[rows] * along + m * facing) / along
    g = np.einsum("ijk,ij->ik", view.jacobian, v)
    offsets = points - projector.world_from_device[:3, 3]
    placed = np.column_stack(
        [
            errors.about_axis * np.cross(offsets, m),
            errors.along_axis_m * m,
            errors.focal * surfaces.levers[:, 1],
            errors.along_line_px * surfaces.levers[:, 2],
        ]
    )
    terms = pair.quality.terms
    noise = sum(np.square(terms[name][some]) for name in NOISE_TERMS if name in terms)
    return np.column_stack(
        [
            np.full(len(rows), pair.projector),
            np.sqrt(noise),
            -facing / along * placed,
            errors.about_axis * t * np.cross(r, v),
            errors.along_axis_m * v,
            errors.focal * t * np.einsum("ij,ij->i", g, view.off_centre)[:, None],
            errors.along_line_px * t * g,
        ]
    )
