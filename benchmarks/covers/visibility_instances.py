"""Covers as sensors on the shared meshes see them, for the covers' benchmarks.

Samples lie all over the surface, each for the same area. Candidates stand on a sphere
of two half diagonals about the middle of the mesh. Wide fields look at the middle and
hold the whole object; narrow ones are cones that look at one random sample each, so
that where to aim matters too. A sample is seen within 60 degrees of incidence, inside
the cone, and unoccluded.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from support import shared_meshes

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.poses import fibonacci_cap
from geometry.rays.visibility import Visibility
from geometry.rays.visibility_matrix import visibility_matrix

MAX_INCIDENCE = np.deg2rad(60.0)
NARROW_HALF_ANGLE = np.deg2rad(14.0)
_STANDOFF = 2.0


@dataclass(frozen=True)
class Instance:
    """One cover.

    Attributes:
        mesh: File name under `../shared/data/meshes`.
        field: `wide` or `narrow`.
        samples: Rows.
        candidates: Columns.
    """

    mesh: str
    field: str
    samples: int
    candidates: int

    @property
    def name(self) -> str:
        """For tables and files."""
        stem = self.mesh.split(".")[0]
        return f"{stem} {self.field} {self.samples:,} x {self.candidates:,}"


@dataclass(frozen=True, eq=False)
class SeenSamples:
    """Samples and candidates of an instance, and which sees which.

    Attributes:
        seen: Whether a sample (row) is seen by a candidate (column); all rows are.
        points: The samples, shape (n, 3).
        origins: Where the candidates stand, shape (m, 3).
    """

    seen: NDArray[np.bool_]
    points: NDArray[np.float64]
    origins: NDArray[np.float64]


def covers(instance: Instance) -> NDArray[np.bool_]:
    """Return which sample (row) each candidate (column) sees; all rows are seen."""
    return seen_samples(instance).seen


def seen_samples(instance: Instance) -> SeenSamples:
    """Return the samples and candidates of an instance."""
    shared = shared_meshes.BY_NAME[instance.mesh]
    mesh = load_mesh(shared.path, **shared.options)
    # More than asked for: what no candidate sees is left out.
    samples = sample_surface(mesh, 2 * instance.samples, seed=1)
    origins, aims = _poses(mesh, samples.points, instance)
    towards = samples.points[None] - origins[:, None]
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    facing = np.einsum("jik,ik->ji", towards, samples.normals)
    candidates = -facing >= np.cos(MAX_INCIDENCE)
    if instance.field == "narrow":
        inside = np.einsum("jik,jk->ji", towards, aims)
        candidates &= inside >= np.cos(NARROW_HALF_ANGLE)
    seen = visibility_matrix(
        Visibility(mesh),
        origins,
        samples.points,
        samples.normals,
        candidates=candidates,
    )
    reached = np.flatnonzero(seen.any(axis=0))
    if reached.size < instance.samples:
        raise ValueError(f"{instance.name}: only {reached.size} samples are seen")
    kept = np.random.default_rng(2).permutation(reached)[: instance.samples]
    kept = np.sort(kept)
    rows = np.ascontiguousarray(seen[:, kept].T)
    return SeenSamples(rows, samples.points[kept], origins)


def _poses(
    mesh: TriangleMesh, points: NDArray[np.float64], instance: Instance
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return optical centres and unit axes, each of shape (m, 3)."""
    low, high = mesh.bounds
    middle = 0.5 * (low + high)
    radius = _STANDOFF * 0.5 * float(np.linalg.norm(high - low))
    outwards = fibonacci_cap(instance.candidates, np.array([0.0, 0.0, 1.0]), np.pi)
    origins = middle + radius * outwards
    if instance.field == "wide":
        return origins, -outwards
    at = np.random.default_rng(3).integers(len(points), size=instance.candidates)
    aims = points[at] - origins
    return origins, aims / np.linalg.norm(aims, axis=1, keepdims=True)
