"""Area-true samples of a surface: every sample stands for the same area."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask, rows_of

from .mesh import TriangleMesh

_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Points spread over faces in proportion to their area.

    Attributes:
        points: Positions in [m], shape (n, 3).
        normals: Unit normal of each sample's face, shape (n, 3).
        faces: Face of each sample, shape (n,).
        weight: Area that each sample stands for, in [m²].
    """

    points: Array
    normals: Array
    faces: Ints
    weight: float

    def __len__(self) -> int:
        return len(self.points)

    def take(self, chosen: Ints | Mask) -> "SurfaceSamples":
        """Return some of the samples, each still standing for the same area."""
        return SurfaceSamples(
            rows_of(self.points, chosen),
            rows_of(self.normals, chosen),
            rows_of(self.faces, chosen),
            self.weight,
        )


def sample_surface(
    mesh: TriangleMesh, n: int, *, seed: int, within: Mask | None = None
) -> SurfaceSamples:
    """Return n samples by stratified sampling along the cumulated area.

    One place in each of n equal parts of the area, faces in their order; it moves on
    from part to part by the golden ratio, from a random start. Inside a face,
    barycentric coordinates are uniform. That spreads the samples more evenly than
    independent draws, and each face's expected number of samples is proportional to
    its area. (Equal steps would fall on few columns of a mesh that comes in rows.)
    The same seed gives the same samples; only faces ``within`` (n_f,) get any.

    Raises:
        ValueError: If n < 1 or the faces have no area.
    """
    areas = (
        mesh.face_areas if within is None else np.where(within, mesh.face_areas, 0.0)
    )
    cumulated = np.cumsum(areas)
    total = float(cumulated[-1])
    if n < 1:
        raise ValueError(f"n must be at least 1, got {n}")
    if not total > 0.0:
        raise ValueError("the faces to sample have no area")
    rng = np.random.default_rng(seed)
    steps = np.arange(n)
    ticks = (steps + (rng.random() + steps * _GOLDEN) % 1.0) * (total / n)
    faces = np.searchsorted(cumulated, ticks, side="right")
    faces = np.minimum(faces, int(np.flatnonzero(areas)[-1]))
    u, v = rng.random(n), rng.random(n)
    root = np.sqrt(u)
    a, b, c = np.moveaxis(mesh.corners[faces], 1, 0)
    points = (
        (1.0 - root)[:, None] * a
        + (root * (1.0 - v))[:, None] * b
        + (root * v)[:, None] * c
    )
    return SurfaceSamples(points, mesh.face_normals[faces], faces, total / n)
