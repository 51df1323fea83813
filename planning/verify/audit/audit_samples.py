"""Samples of the audit: independent random draws, never the planner's."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask, rows_of
from geometry.mesh.mesh import TriangleMesh
from planning.model.errors import PlanFileError
from planning.model.surface import Surface

# Keeps the audit's draws apart from all others that start from the same seed.
_STREAM = 20_141_203


@dataclass(frozen=True, eq=False)
class AuditSamples:
    """Random points of a surface with what the predicates need to know of them.

    Attributes:
        points: Positions in [m], shape (n, 3).
        normals: Unit normal of each sample's face, shape (n, 3).
        faces: Face of each sample, shape (n,).
        steep: T1 of each sample's face, zero where its limit doesn't bind, (n, 3).
        region: Dominant region of each sample's face, -1 for none, shape (n,).
        in_target: Whether each sample lies in the target, shape (n,).
        weights: Area that each sample stands for, in [m²], shape (n,).
    """

    points: Array
    normals: Array
    faces: Ints
    steep: Array
    region: Ints
    in_target: Mask
    weights: Array

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def joined(cls, parts: Sequence["AuditSamples"]) -> "AuditSamples":
        """Return several sets of samples as one."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*(np.concatenate(column) for column in columns))

    def take(self, chosen: Ints | Mask) -> "AuditSamples":
        """Return some of the samples, each still standing for the same area."""
        return AuditSamples(*[rows_of(c, chosen) for c in vars(self).values()])


def draw_samples(
    surface: Surface, target: str, n: int, seed: int, *, again: bool = False
) -> AuditSamples:
    """Draw n points: half of them in the target, half outside, each part uniformly.

    Within a part, faces are drawn with probability proportional to their area, and the
    barycentric coordinates are uniform on the simplex. Where the target, `dominant` or
    `surface`, is the whole surface all n fall in it. Those drawn `again` are others.

    Raises:
        PlanFileError: If the target has no area.
    """
    # Regions have the streams from 1.
    rng = _generator(surface, seed, *([0] if again else []))
    inside = surface.target_faces(target)
    areas = surface.mesh.face_areas
    if not areas[inside].sum() > 0.0:
        raise PlanFileError(
            "surface.npz: the target has no area (no face with region >= 0); plan again"
        )
    whole = not areas[~inside].sum() > 0.0
    parts = [(inside, n)] if whole else [(inside, (n + 1) // 2), (~inside, n // 2)]
    drawn = [_draw(surface, mask, mask is inside, count, rng) for mask, count in parts]
    return AuditSamples.joined(drawn)


def draw_region(surface: Surface, region: int, n: int, seed: int) -> AuditSamples:
    """Draw n points of a dominant region, as `draw_samples` does of a part."""
    rng = _generator(surface, seed, 1 + region)
    return _draw(surface, surface.region == region, True, n, rng)


def generator_of(arrays: Sequence[Array | Ints], *words: int) -> np.random.Generator:
    """Return the random stream of some words, another one for any other arrays.

    Whoever writes a plan knows its seed, and may put faces into an order in which draws
    from that alone fall where he likes.
    """
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(array.tobytes())
    return np.random.default_rng((*words, int.from_bytes(digest.digest())))


def draw_points(
    mesh: TriangleMesh, areas: Array, n: int, rng: np.random.Generator
) -> tuple[Array, Ints]:
    """Draw n points (n, 3), and their faces, by the areas of faces, 0 of some."""
    faces = rng.choice(len(areas), size=n, p=areas / areas.sum())
    return points_on(mesh, faces, rng), faces


def points_on(mesh: TriangleMesh, faces: Ints, rng: np.random.Generator) -> Array:
    """Draw a point on each of some faces, (n, 3)."""
    shares = rng.dirichlet((1.0, 1.0, 1.0), size=len(faces))
    return np.einsum("nk,nkd->nd", shares, mesh.corners[faces])


def samples_on(
    surface: Surface,
    points: Array,
    faces: Ints,
    in_target: Mask,
    weights: Array | None = None,
) -> AuditSamples:
    """Return samples at points (n, 3) of given faces; each of weight 1 by default."""
    return AuditSamples(
        points,
        surface.mesh.face_normals[faces],
        faces.astype(np.int64),
        np.asarray(surface.steep[faces], dtype=np.float64),
        np.asarray(surface.region[faces], dtype=np.int64),
        in_target,
        np.ones(len(faces)) if weights is None else weights,
    )


def samples_at_centroids(surface: Surface, within: Mask) -> AuditSamples:
    """Return one sample at the centroid of each chosen face, weighing its area."""
    areas = surface.mesh.face_areas
    faces = np.flatnonzero(within & (areas > 0.0))
    every = np.ones(len(faces), dtype=bool)
    centroids = surface.mesh.face_centroids[faces]
    return samples_on(surface, centroids, faces, every, areas[faces])


def _generator(surface: Surface, *words: int) -> np.random.Generator:
    region = np.asarray(surface.region, dtype=np.int64)
    arrays = surface.mesh.vertices, surface.mesh.faces, region
    return generator_of(arrays, _STREAM, *words)


def _draw(
    surface: Surface, within: Mask, in_target: bool, n: int, rng: np.random.Generator
) -> AuditSamples:
    areas = np.where(within, surface.mesh.face_areas, 0.0)
    points, faces = draw_points(surface.mesh, areas, n, rng)
    inside, weights = np.full(n, in_target), np.full(n, float(areas.sum()) / n)
    return samples_on(surface, points, faces, inside, weights)
