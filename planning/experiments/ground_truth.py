"""Points and labels held to the truth: what the authors couldn't give."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Indices
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.check.accuracy import (
    measure_accuracy,
    nearest_distance,
)
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.reconstruction.single_shot.single_shot import Shot

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
    """Hold a cloud to the object, and to the samples of it that could be measured."""
    if len(cloud) == 0:
        return MeasuredErrors(name, cloud, np.zeros(0), (0.0, 0.0))
    apart = nearest_distance(cloud, samples, 1.01 * gap_m)
    distances = measure_accuracy(cloud, mesh).distances
    half, whole = (float(np.mean(apart <= gaps * gap_m)) for gaps in (0.5, 1.0))
    return MeasuredErrors(name, cloud, distances, (half, whole))


@dataclass(frozen=True)
class LabelCount:
    """How labels by a prior mesh compare with the truth; numbers of line points.

    Attributes:
        n: Found in all images.
        right: Labelled with the ring and root that they are of.
        wrong: Labelled otherwise.
        stray: Labelled, though the surface there is on no ring.
        off_prior: Left out: no ring meets the ray near the prior.
        ambiguous: Left out: several do.
    """

    n: int = 0
    right: int = 0
    wrong: int = 0
    stray: int = 0
    off_prior: int = 0
    ambiguous: int = 0


def prior_mesh(mesh: TriangleMesh, tolerance_m: float) -> TriangleMesh:
    """Return a mesh that is moved back, along +y, by 5/6 of a tolerance."""
    move = np.array([0.0, tolerance_m / 1.2, 0.0])
    return TriangleMesh(mesh.vertices + move, mesh.faces)


def judged_labels(scanner: Scanner, shots: Sequence[Shot]) -> LabelCount:
    """Hold the labels of single images of a scanner's object to the truth."""
    caster = RayCaster(scanner.mesh, threads=1)
    total: Counter[str] = Counter()
    for shot in shots:
        rings, roots = shot.lines.rings, shot.lines.roots
        ring, root = true_labels(shot.lines.pixels, shot.pair, caster, shot.width)
        labelled = rings >= 0
        right = labelled & (rings == ring) & (roots == root)
        total.update(
            n=len(rings),
            right=int(right.sum()),
            wrong=int(np.sum(labelled & ~right & (ring >= 0))),
            stray=int(np.sum(labelled & (ring < 0))),
            off_prior=shot.decoded.rejected["off_prior"],
            ambiguous=shot.decoded.rejected["ambiguous"],
        )
    return LabelCount(**total)


def true_labels(
    pixels: Array, pair: PairCalibration, caster: RayCaster, width: float
) -> tuple[Indices, NDArray[np.int8]]:
    """Return the ring and root that really are at pixels (n, 2); ring -1: none is.

    What lies farther from a ring than the width of a line isn't on it.
    """
    camera, projector = pair.camera, pair.projector
    rays = camera.rays(pixels)
    faces, away = caster.first_hits(camera.centre, rays)
    points = camera.centre + np.where(faces >= 0, away, 0.0)[:, None] * rays
    local, radii = projector.to_ring(points), projector.pattern.radii
    rho = projector.ring_coordinate(points)
    ring = np.argmin(np.abs(rho[:, None] - radii), axis=1)
    on_ring = (faces >= 0) & (np.abs(rho - radii[ring]) <= width)
    flat = local[:, :2] / np.hypot(local[:, 0], local[:, 1])[:, None]
    normals = projector.light.ring_normals(flat, rho)
    outward = normals @ projector.world_from_ring[:3, :3].T
    root = np.where(np.einsum("ij,ij->i", outward, rays) > 0.0, 1, -1)
    return np.where(on_ring, ring, -1), root.astype(np.int8)
