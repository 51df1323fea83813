"""Measured points against the mesh, judged by the limits that the plan states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from geometry.rays.proximity import closest_points
from geometry.rays.rays import RayCaster
from planning.model.requirements import CheckLimits
from planning.verify.reconstruction.arrays import Array, Columns, Indices, Mask, tree_of
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

_MM = 1e3


@dataclass(frozen=True, eq=False)
class Accuracy(Columns):
    """Signed distances of points from the mesh along its normals, outside positive.

    Attributes:
        distances: In [m], shape (n,).
        faces: Nearest face of each point, shape (n,).
    """

    distances: Array
    faces: Indices

    @property
    def rms_m(self) -> float:
        """Root mean square in [m]."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def p95_m(self) -> float:
        """95th percentile of the absolute distance in [m]."""
        return float(np.percentile(np.abs(self.distances), 95.0))

    @property
    def bias_m(self) -> float:
        """Mean in [m]."""
        return float(np.mean(self.distances))

    def beyond(self, distance_m: float) -> float:
        """Return the share of points farther from the mesh."""
        return share_of(np.abs(self.distances) > distance_m)

    @property
    def max_m(self) -> float:
        """Largest absolute distance in [m]."""
        return float(np.abs(self.distances).max())


@dataclass(frozen=True, eq=False)
class Expected:
    """What should be measured.

    Attributes:
        samples: Of the surface.
        measured: Which of them some pair measures, shape (n,); None: nobody says.
        by_pair: Share of them that each pair measures, shape (n_p, n_c); None likewise.

    Raises:
        ValueError: If `measured` speaks of another number of samples.
    """

    samples: SurfaceSamples
    measured: Mask | None = None
    by_pair: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.samples)
        if self.measured is not None and self.measured.shape != (n,):
            raise ValueError(
                f"measured has shape {self.measured.shape} for {n} samples"
            )

    def within(self, target: Mask) -> "Expected":
        """Return what lies on faces of the target, shape (n_f,)."""
        inside = target[self.samples.faces]
        measured = None if self.measured is None else self.measured[inside]
        return Expected(self.samples.take(inside), measured, self.by_pair)


@dataclass(frozen=True, eq=False)
class Completeness:
    """Shares of surface samples with a measured point nearby.

    Attributes:
        thresholds_m: Half, one and two tau [m].
        fractions: Of the target predicted measured, after redundancy was removed.
        predicted_missing: Share of it with no point within tau in the whole cloud;
            None without a prediction.
        missing: Samples predicted measured that have no such point, shape (n,).
    """

    thresholds_m: tuple[float, float, float]
    fractions: tuple[float, float, float]
    predicted_missing: float | None
    missing: Mask


def measure_accuracy(cloud: Cloud, mesh: TriangleMesh) -> Accuracy:
    """Return the distances of a cloud from the full mesh."""
    nearest = closest_points(mesh, cloud.points)
    return Accuracy(nearest.distances, nearest.faces)


def shown_inside(cloud: Cloud, cameras: Sequence[Array], mesh: TriangleMesh) -> Mask:
    """Return which points' pixels show the inside of an open mesh, shape (n,).

    Where a viewing ray first meets the mesh from behind, through an opening: told by
    the pixel alone, wherever the point was put. Optical centres (3,) in [m].
    """
    inside, caster = np.zeros(len(cloud), dtype=bool), RayCaster(mesh)
    for c, centre in enumerate(cameras):
        rows = np.flatnonzero(cloud.camera == c)
        faces, _ = caster.first_hits(centre, cloud.rays[rows])
        along = np.einsum("ij,ij->i", cloud.rays[rows], mesh.face_normals[faces])
        inside[rows] = (faces >= 0) & (along > 0.0)
    return inside


def nearest_distance(cloud: Cloud, samples: SurfaceSamples, reach_m: float) -> Array:
    """Return the distance from each sample to a point measured from its own side.

    A point counts if its viewing ray r meets the sample's normal with r.N < 0: on a
    thin shell points of the other side are near, too. Each camera's nearest point is
    tried. In [m], inf where there is no such point within reach, shape (n_samples,).
    """
    best = np.full(len(samples), np.inf)
    for camera in np.unique(cloud.camera):
        seen = cloud.camera == camera
        tree = tree_of(cloud.points[seen])
        distance, nearest = tree.query(samples.points, distance_upper_bound=reach_m)
        # Where nothing is in reach the index is one past the last point.
        rays = np.concatenate([cloud.rays[seen], np.zeros((1, 3))])[nearest]
        facing = np.einsum("ij,ij->i", rays, samples.normals) < 0.0
        best = np.where(facing, np.minimum(best, distance), best)
    return best


def measure_completeness(
    everything: Cloud, merged: Cloud, expected: Expected, tau_m: float
) -> Completeness:
    """Return how much of the samples was measured, and what should have been.

    Of samples of the target; without a claim, all are asked for.
    """
    samples, predicted = expected.samples, expected.measured
    claimed = np.ones(len(samples), dtype=bool) if predicted is None else predicted
    thresholds = (0.5 * tau_m, tau_m, 2.0 * tau_m)
    reach = 2.01 * tau_m
    near = nearest_distance(merged, samples.take(claimed), reach)
    half, whole, twice = (share_of(near <= threshold) for threshold in thresholds)
    missing = claimed & ~(nearest_distance(everything, samples, reach) <= tau_m)
    return Completeness(
        thresholds,
        (half, whole, twice),
        None if predicted is None else share_of(missing[claimed]),
        missing,
    )


def judge(
    accuracy: Accuracy, completeness: Completeness, limits: CheckLimits
) -> tuple[str, ...]:
    """Return a clause for each limit that isn't kept: what, value, limit."""
    lengths = (
        ("rms distance of the points from the mesh", accuracy.rms_m, limits.max_rms_m),
        ("95th percentile of the distance", accuracy.p95_m, limits.max_p95_m),
        ("mean signed distance", accuracy.bias_m, limits.max_bias_m),
    )
    failures = [
        f"{name} is {_MM * value:.3f} mm, limit {_MM * limit:.3f} mm"
        for name, value, limit in lengths
        if not abs(value) <= limit
    ]
    missing = completeness.predicted_missing
    if missing is None:
        return tuple(failures)
    share, tau = completeness.fractions[1], _MM * completeness.thresholds_m[1]
    if not share >= limits.min_completeness:
        failures.append(
            f"completeness is {share:.3f} of the target predicted measured at "
            f"{tau:.2f} mm, limit {limits.min_completeness:.3f}"
        )
    if not missing <= limits.max_predicted_missing:
        failures.append(
            f"{100 * missing:.2f} % of the samples predicted measured have no point "
            f"within {tau:.2f} mm, limit {100 * limits.max_predicted_missing:.2f} %"
        )
    return tuple(failures)


def share_of(values: Mask) -> float:
    """Return the share that is true; 0 of none."""
    return float(np.mean(values)) if len(values) else 0.0


def held_against(
    cloud: Cloud,
    plan: Scanner,
    completeness: Completeness,
    nothing: str,
) -> tuple[Accuracy | None, tuple[str, ...], Mask]:
    """Hold merged points against the object and the limits.

    Returns the accuracy of those outside of it, None without any; failures, which are
    `nothing` of no point at all; and which points lie inside, shape (n,).
    """
    inside = np.zeros(0, dtype=bool)
    failures: tuple[str, ...] = (nothing,)
    if len(cloud):
        places = [camera.centre for camera in plan.cameras]
        inside = shown_inside(cloud, places, plan.mesh)
        failures = ("no point was measured of the outside of the open mesh",)
    if inside.all():
        return None, failures, inside
    accuracy = measure_accuracy(cloud.take(~inside), plan.mesh)
    return accuracy, judge(accuracy, completeness, plan.limits.check), inside
