"""What two cameras measure by each other's images, and how well.

A point found at (u, v) with noise s_0 along either image axis leaves two equations
across its viewing ray r: with t = |P - O| and J_r = dr/d(u, v) the point lies off the
ray by t J_r of the noise, so that camera i weighs with::

    W_i = J_i (J_i^T J_i)^-2 J_i^T / t_i^2,    W_i r_i = 0

The least-squares intersection P of two rays minimises the sum of (P - O_i)^T W_i
(P - O_i). With A = W_1 + W_2, w_i = W_i A^-1 N and g_i = J_i^T w_i its deviations along
the normal are::

    s_N^2 = s_0^2 N^T A^-1 N,    s_C^2 = sum of the variances of w_i.dX_i

where errors of a calibration move ray i at P by dX_i (`calibration_terms`). In two
cameras side by side, b apart and z before a plane, s_N = sqrt(2) s_0 z^2 / (f b) for
b << z.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import rows_of
from planning.model.requirements import TriangulationLimits
from planning.scene.limits.calibration_terms import ray_deviation
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.limits.limit import Array, first_violated
from planning.scene.limits.view_pair_limits import VIEW_PAIR_LIMITS
from planning.scene.measuring.camera_views import CameraView

ViewTerm = Literal["matches", "camera"]
# Rays that meet at less are parallel: their intersection is anywhere.
_PARALLEL = 1e-12


@dataclass(frozen=True, eq=False)
class ViewPairQuality:
    """How well two cameras triangulate n samples.

    Attributes:
        cosine: Of the angle at which their rays meet, shape (n,).
        sigma: What `max_sigma_m` limits: s_N, or sqrt(s_N^2 + s_C^2) [m], shape (n,).
        terms: Independent parts of the deviation along the normal [m], (n,) each:
            `matches`, noise of the images, and `camera`, of the calibration, if stated.
    """

    cosine: Array
    sigma: Array
    terms: dict[ViewTerm, Array]

    @property
    def total(self) -> Array:
        """Root of the sum of the squares of all terms, in [m], shape (n,)."""
        return np.sqrt(sum(np.square(term) for term in self.terms.values()))


@dataclass(frozen=True, eq=False)
class Sightings:
    """Which camera sees which sample, and how: one row each, cameras in order.

    Attributes:
        camera: Which camera, shape (k,).
        sample: Which sample, shape (k,).
        view: How it sees it.
        precision: W of unit noise in [1/m^2], shape (k, 3, 3).
        normals: Of all n samples, shape (n, 3).
    """

    camera: NDArray[np.int64]
    sample: NDArray[np.int64]
    view: ViewedSamples
    precision: Array
    normals: Array

    @classmethod
    def of(cls, views: Sequence[CameraView], normals: Array) -> "Sightings":
        """Return the sightings of cameras that see some of n samples."""
        joined = CameraView.joined(views)
        counts = [len(view.samples) for view in views]
        camera = np.repeat(np.arange(len(views)), counts)
        return cls(
            camera, joined.samples, joined.view, ray_precision(joined.view), normals
        )

    def rows_of(self, camera: int) -> slice:
        """Return the rows of a camera."""
        low, high = np.searchsorted(self.camera, [camera, camera + 1])
        return slice(int(low), int(high))

    def counts(self) -> NDArray[np.int64]:
        """Return how many cameras see each sample, shape (n,)."""
        return np.bincount(self.sample, minlength=len(self.normals))

    def partners(
        self, rows: slice, others: slice
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows of one camera and those of others of the same samples."""
        place = np.full(len(self.normals), -1)
        place[self.sample[rows]] = np.arange(rows.start, rows.stop)
        first = place[self.sample[others]]
        there = np.flatnonzero(first >= 0)
        return first[there], there + others.start

    def quality(
        self,
        first: NDArray[np.int64],
        second: NDArray[np.int64],
        limits: TriangulationLimits,
    ) -> ViewPairQuality:
        """Return how well pairs of rows that see the same samples triangulate them."""
        a, b = self.view.take(first), self.view.take(second)
        precisions = rows_of(self.precision, first), rows_of(self.precision, second)
        normals = rows_of(self.normals, self.sample[first])
        x = _solved(precisions[0] + precisions[1], normals)
        # Rays along one line meet anywhere, and the product of infinities says nothing.
        met: NDArray[np.bool_] = np.asarray(np.all(np.isfinite(x), axis=1))
        along = np.einsum("ij,ij->i", normals, np.where(met[:, None], x, 0.0))
        noise = np.where(met, along, np.inf)
        terms: dict[ViewTerm, Array] = {"matches": limits.noise_px * np.sqrt(noise)}
        cosine = np.einsum("ij,ij->i", a.rays, b.rays)
        quality = ViewPairQuality(cosine, terms["matches"], terms)
        errors = limits.calibration
        if errors is None:
            return quality
        each: list[Array] = []
        for view, precision in zip((a, b), precisions, strict=True):
            w = np.einsum("ijk,ik->ij", precision, x)
            g = np.einsum("ijk,ij->ik", view.jacobian, w)
            each.append(ray_deviation(errors, view, w, g))
        # Where rays are parallel the product of infinities says nothing.
        terms["camera"] = np.where(np.isfinite(noise), np.hypot(*each), np.inf)
        if limits.accuracy_of == "noise":
            return quality
        return ViewPairQuality(cosine, quality.total, terms)

    def good(
        self,
        first: NDArray[np.int64],
        second: NDArray[np.int64],
        limits: TriangulationLimits,
    ) -> NDArray[np.bool_]:
        """Return which pairs of rows keep every limit of pairs, shape (k,)."""
        cosine = np.einsum(
            "ij,ij->i", rows_of(self.view.rays, first), rows_of(self.view.rays, second)
        )
        low, high = limits.angles
        fit = np.flatnonzero((cosine <= np.cos(low)) & (cosine >= np.cos(high)))
        quality = self.quality(first[fit], second[fit], limits)
        held = first_violated(VIEW_PAIR_LIMITS, quality, limits, len(fit))
        good = np.zeros(len(first), dtype=bool)
        good[fit] = held == len(VIEW_PAIR_LIMITS)
        return good


def ray_precision(view: ViewedSamples) -> Array:
    """Return W of unit noise in [1/m^2], shape (k, 3, 3); 0 where J_r is."""
    j, t = view.jacobian, view.distances
    a = np.einsum("ijk,ijk->ik", j, j)
    across = np.einsum("ij,ij->i", j[:, :, 0], j[:, :, 1])
    det = a[:, 0] * a[:, 1] - across * across
    inverse = np.empty((len(t), 2, 2))
    inverse[:, 0, 0], inverse[:, 1, 1] = a[:, 1], a[:, 0]
    inverse[:, 0, 1] = inverse[:, 1, 0] = -across
    inverse /= np.where(det > 0.0, det, np.inf)[:, None, None]
    half = j @ inverse
    return half @ half.transpose(0, 2, 1) / np.square(t)[:, None, None]


def _solved(a: Array, b: Array) -> Array:
    """Return a^-1 b of symmetric 3 x 3 matrices, (n, 3); inf where a is singular."""
    columns = np.cross(a[:, [1, 2, 0]], a[:, [2, 0, 1]])
    det = np.einsum("ij,ij->i", a[:, 0], columns[:, 0])
    scale = np.einsum("ijj->i", a) ** 3
    good = det > _PARALLEL * scale
    x = np.einsum("ijk,ij->ik", columns, b) / np.where(good, det, 1.0)[:, None]
    return np.where(good[:, None], x, np.inf * np.where(b == 0.0, 1.0, np.sign(b)))
