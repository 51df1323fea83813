"""Distances of measured points from the object: what the authors couldn't give."""

from dataclasses import asdict, dataclass

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.check.accuracy import (
    measure_accuracy,
    nearest_distance,
)
from planning.verify.reconstruction.cloud import Cloud

# Farther than this a point is an outlier: a false edge at a step of depth [m].
OUTLIER_M = 1.0e-3


@dataclass(frozen=True)
class Errors:
    """Signed distances of points from the object along its normals, summarised.

    Attributes:
        n: Points.
        rms_m: Root mean square [m]; None without points, as the others.
        p95_m: 95th percentile of the absolute distance [m].
        bias_m: Mean, outside positive [m].
        outliers: Share of points farther than 1 mm.
        rest_m: Root mean square of the others [m]; 0 without any.
    """

    n: int
    rms_m: float | None = None
    p95_m: float | None = None
    bias_m: float | None = None
    outliers: float | None = None
    rest_m: float | None = None

    @classmethod
    def of(cls, distances: Array) -> "Errors":
        """Summarise signed distances [m], shape (n,)."""
        if len(distances) == 0:
            return cls(0)
        apart = np.abs(distances)
        rest = apart[apart <= OUTLIER_M]
        return cls(
            len(distances),
            float(np.sqrt(np.mean(distances**2))),
            float(np.percentile(apart, 95.0)),
            float(np.mean(distances)),
            float(np.mean(apart > OUTLIER_M)),
            float(np.sqrt(np.mean(rest**2))) if len(rest) else 0.0,
        )

    def to_document(self) -> dict[str, float | int | None]:
        """Return plain values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class MeasuredErrors:
    """A cloud held to the truth.

    Attributes:
        name: Which viewpoints it is of.
        cloud: The points.
        distances: Signed, from the object [m], shape (n,).
        complete: Share of the samples with a point within half a ring gap, and one.
    """

    name: str
    cloud: Cloud
    distances: Array
    complete: tuple[float, float]

    @property
    def errors(self) -> Errors:
        """Of all points."""
        return Errors.of(self.distances)


def measured(
    name: str, cloud: Cloud, mesh: TriangleMesh, samples: SurfaceSamples, gap_m: float
) -> MeasuredErrors:
    """Hold a cloud to the truth.

    Args:
        name: Which viewpoints it is of.
        cloud: The points.
        mesh: The object.
        samples: What could be measured.
        gap_m: Ring gap that completeness is counted by [m].
    """
    if len(cloud) == 0:
        return MeasuredErrors(name, cloud, np.zeros(0), (0.0, 0.0))
    apart = nearest_distance(cloud, samples, 1.01 * gap_m)
    distances = measure_accuracy(cloud, mesh).distances
    half, whole = (float(np.mean(apart <= part * gap_m)) for part in (0.5, 1.0))
    return MeasuredErrors(name, cloud, distances, (half, whole))
