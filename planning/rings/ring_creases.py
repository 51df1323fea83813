"""Creases of the surface in a projector's light: a slope jump has no kappa."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.curvature.curvature import SHARPEST_FACET
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import face_pairs
from planning.model.devices.planned import PlannedProjector
from planning.scene.codes.patterns import RingPattern
from planning.scene.lighting import first_failure, light_on
from planning.scene.limits.projector_limits import LIT
from planning.scene.scene import Scene

from .beam_profile import on_faces


@dataclass(frozen=True, eq=False)
class Creases:
    """Points (n, 3) along creases, the faces (n, 2) that meet there, and lengths."""

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    length: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.points)


def find_creases(mesh: TriangleMesh, step: float) -> Creases:
    """Return points at most `step` [m] apart along edges that turn by over 40 deg."""
    pairs, edge = face_pairs(mesh.edges)
    one, other = mesh.face_normals[pairs[:, 0]], mesh.face_normals[pairs[:, 1]]
    sharp = np.einsum("ij,ij->i", one, other) < np.cos(SHARPEST_FACET)
    ends = mesh.vertices[mesh.edges.ends[edge[sharp]]]
    length = lengths(ends[:, 1] - ends[:, 0])
    n = np.maximum(1, np.ceil(length / step).astype(np.int64))
    which = np.repeat(np.arange(len(n)), n)
    place = np.arange(len(which)) - np.repeat(np.cumsum(n) - n, n)
    share = ((place + 0.5) / n[which])[:, None]
    points = (1.0 - share) * ends[which, 0] + share * ends[which, 1]
    return Creases(points, pairs[sharp][which], (length / n)[which])


def crease_errors(
    scene: Scene, projector: PlannedProjector, creases: Creases
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return which points are lit on both sides, and the error J h / 4 of a jump J.

    Along the beam, radially: a face of normal n rises by -(n.m)/(n.L) a metre across
    the rings; J is the difference of both faces', h the gap of the rings there [m].
    """
    mesh = scene.mesh
    rings = RingPattern(projector).surfaces(creases.points)
    lit = np.ones(len(creases), dtype=bool)
    slopes: list[NDArray[np.float64]] = []
    for side in (0, 1):
        faces = creases.faces[:, side]
        # Moved aside a little, a point lies on its own face and not on the edge.
        centroids = mesh.face_centroids[faces]
        points = creases.points + 0.02 * (centroids - creases.points)
        target = on_faces(scene, points, faces)
        stage = first_failure(
            projector,
            target,
            scene.requirements.projector,
            scene.occlusion,
            bodies=scene.bodies,
        )
        lit &= stage == LIT
        light = light_on(projector, target)
        across = np.einsum("ij,ij->i", target.samples.normals, rings.normals)
        slopes.append(across / np.maximum(light.incidence_cos, 1e-9))
    jump = np.abs(slopes[0] - slopes[1])
    return lit, 0.25 * jump * rings.spacing
