"""Creases of the surface, and what a projector's rings cut off them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from planning.verify.audit.estimates import POINT
from planning.verify.audit.ledger import Ledger
from planning.verify.audit.predicates.audit_optics import (
    in_frame,
    in_world,
    ring_gradient,
)
from planning.verify.audit.predicates.predicates import AuditProjector, light_of

from .extremes import audit_extreme
from .ring_light import RingLight, ring_spacing

_SHARPEST_FACET = np.radians(40.0)
# Moved so far towards its face's centroid, a point is off the edge.
_ASIDE = 0.02
_DEVIATIONS = 4.0
_POINTS = 20_000


@dataclass(frozen=True, eq=False)
class Creases:
    """Random points of the edges at which two faces turn by more than 40 degrees.

    Attributes:
        points: In the world [m], shape (n, 3).
        faces: The faces on both sides, shape (n, 2).
        lengths: Of crease that each stands for [m], shape (n,).
        edge: Number of the edge that each lies on, shape (n,).
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    lengths: NDArray[np.float64]
    edge: NDArray[np.int64]


def find_creases(mesh: TriangleMesh, rng: np.random.Generator) -> Creases:
    """Return points of all creases: two or more on each edge, drawn in equal strata."""
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    ends, edge, count = np.unique(
        sides, axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(edge.ravel(), kind="stable")
    first = np.cumsum(count) - count
    paired = np.flatnonzero(count == 2)
    faces = np.column_stack([order[first[paired]] // 3, order[first[paired] + 1] // 3])
    one, other = (mesh.face_normals[faces[:, side]] for side in (0, 1))
    sharp = np.einsum("ij,ij->i", one, other) < np.cos(_SHARPEST_FACET)
    ends, faces = mesh.vertices[ends[paired[sharp]]], faces[sharp]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    step = max(float(length.sum()) / _POINTS, np.finfo(np.float64).tiny)
    n = np.maximum(2, np.ceil(length / step).astype(np.int64))
    which = np.repeat(np.arange(len(n)), n)
    stratum = np.arange(len(which)) - np.repeat(np.cumsum(n) - n, n)
    share = ((stratum + rng.uniform(size=len(which))) / n[which])[:, None]
    points = (1.0 - share) * ends[which, 0] + share * ends[which, 1]
    return Creases(points, faces[which], (length / n)[which], which)


def audit_creases(
    key: str,
    claims: object,
    lamp: AuditProjector,
    light: RingLight,
    mesh: TriangleMesh,
    creases: Creases,
    ledger: Ledger,
) -> None:
    """Check the lit length of creases, their largest slope jump J and error J h / 4.

    Args:
        key: Of the claims.
        claims: `length_m`, `max_slope_jump`, `max_error_m`.
        lamp: The projector, with its rings.
        light: Tells what is lit.
        mesh: The surface.
        creases: Of the surface.
        ledger: Takes the false claims.
    """
    if not ledger.holds(isinstance(claims, dict), key, "is missing"):
        return
    assert isinstance(claims, Mapping)
    lit, jump = _jumps(lamp, light, mesh, creases)
    lengths = creases.lengths[lit]
    found = float(lengths.sum())
    ledger.number(
        f"{key}.length_m",
        claims.get("length_m"),
        found,
        POINT * found + _length_noise(mesh, creases, lit),
        "m",
    )
    if len(lengths) == 0:
        return
    error = 0.25 * jump * ring_spacing(lamp, creases.points[lit])
    for name, values, unit in (
        ("max_slope_jump", jump, ""),
        ("max_error_m", error, "m"),
    ):
        audit_extreme(
            f"{key}.{name}",
            claims.get(name),
            values,
            lengths,
            ledger,
            largest=True,
            unit=unit,
        )


def _jumps(
    lamp: AuditProjector, light: RingLight, mesh: TriangleMesh, creases: Creases
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which points are lit on both sides (n,), and J of those that are (k,).

    Along the beam a face of normal n rises by (n.m) / (n.L) across the rings.
    """
    lit = np.ones(len(creases.points), dtype=bool)
    for faces in creases.faces.T:
        aside = _ASIDE * (mesh.corners[faces].mean(axis=1) - creases.points)
        lit &= light.lit_beside(lamp, creases.points + aside, faces)
    points = creases.points[lit]
    along, _ = light_of(lamp, points)
    ring = in_frame(lamp.world_from_ring, points)
    m = in_world(lamp.world_from_ring, ring_gradient(ring, lamp.diverging))
    m /= np.linalg.norm(m, axis=1)[:, None]
    one, other = (mesh.face_normals[faces] for faces in creases.faces[lit].T)
    slopes = [
        np.einsum("ij,ij->i", n, m) / np.einsum("ij,ij->i", n, along)
        for n in (one, other)
    ]
    return lit, np.abs(slopes[0] - slopes[1])


def _length_noise(
    mesh: TriangleMesh, creases: Creases, lit: NDArray[np.bool_]
) -> float:
    """How far two honest lengths may lie apart [m]: edges lit in part are uncertain."""
    n = int(creases.edge.max(initial=-1)) + 1
    share = np.bincount(creases.edge, lit, n) / np.bincount(creases.edge, None, n)
    length = np.bincount(creases.edge, creases.lengths, n)
    length = np.minimum(length, mesh.mean_edge)[(share > 0.0) & (share < 1.0)]
    return mesh.mean_edge + _DEVIATIONS * float(np.linalg.norm(length))
