"""Ring edges against the mesh, were the devices and the object placed otherwise.

A decoded edge says: at this pixel of this camera lies ring k of this projector.
Wherever the devices are supposed to stand, the pixel's ray meets the mesh in a point,
and the projector draws something there: how far that is from ring k is the mismatch. It
needs no root of a cone and no nearest point, and so stays smooth far from the truth.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Columns, Indices
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.scanner import Scanner

Role = Literal["cameras", "projectors"]
# Edges of each pair of devices that are looked at.
EDGES_A_PAIR = 240
# Incidence of light beyond which edges smear: formulation.md section 2 [rad].
GRAZING = np.deg2rad(70.0)
# Pairs with fewer edges say nothing.
_LEAST_EDGES = 60


@dataclass(frozen=True, eq=False)
class Object:
    """The mesh, and where and how large the object is supposed to be against it.

    A vertex v of the mesh is at ``centre + scale turn (v - centre) + shift``.

    Attributes:
        mesh: Of the plan.
        caster: Casts rays against it.
        centre: Fixed point of turn and scale in the world [m], shape (3,).
        turn: Rotation, shape (3, 3).
        scale: Size over that of the mesh.
        shift: In [m], shape (3,).
    """

    mesh: TriangleMesh
    caster: RayCaster
    centre: Array
    turn: Array
    scale: float
    shift: Array

    def hits(self, origin: Array, rays: Array) -> tuple[Array, Indices]:
        """Return where rays (n, 3) meet it, NaN where they don't, and the faces."""
        back = self.turn / self.scale
        start = self.centre + (origin - self.centre - self.shift) @ back
        faces, distances = self.caster.first_hits(start, rays @ self.turn)
        reach = np.where(faces >= 0, self.scale * distances, np.nan)
        return origin + reach[:, None] * rays, faces

    def normals(self, faces: Indices) -> Array:
        """Return unit normals of faces in the world, shape (n, 3)."""
        return self.mesh.face_normals[faces] @ self.turn.T


@dataclass(frozen=True, eq=False)
class Supposed:
    """How everything is supposed to stand; devices in the order of the plan."""

    cameras: tuple[CameraCalibration, ...]
    projectors: tuple[ProjectorCalibration, ...]
    body: Object

    @classmethod
    def of(cls, plan: Scanner) -> "Supposed":
        """Return what the plan says."""
        mesh = plan.mesh
        caster = RayCaster(mesh, threads=1)
        body = Object(mesh, caster, mesh.centre, np.eye(3), 1.0, np.zeros(3))
        return cls(plan.cameras, plan.projectors, body)


@dataclass(frozen=True, eq=False)
class Evidence(Columns):
    """Some labelled edges of every pair of devices.

    Attributes:
        pixels: Sub-pixel positions (u, v), shape (n, 2).
        radii: Ring that each edge is said to lie on, as in the plan, shape (n,).
        camera: Index of the camera, shape (n,).
        projector: Index of the projector, shape (n,).
        noise_px: Standard deviation of the edge's position across itself [px], (n,).
        designs: Projectors as the patterns were drawn for them.
    """

    pixels: Array
    radii: Array
    camera: Indices
    projector: Indices
    noise_px: Array
    designs: tuple[ProjectorCalibration, ...]

    def __len__(self) -> int:
        return len(self.radii)

    def index(self, role: Role) -> Indices:
        """Return which device of a role each edge is of, shape (n,)."""
        return self.camera if role == "cameras" else self.projector

    def pairs(self) -> list[tuple[int, int]]:
        """Return the pairs of projector and camera that there are edges of."""
        both = zip(self.projector.tolist(), self.camera.tolist(), strict=True)
        return sorted(set(both))

    @classmethod
    def at(cls, plan: Scanner, pixels: Array, p: int, c: int) -> "Evidence":
        """Return pixels (n, 2) of one pair that are on no ring in particular."""
        n = len(pixels)
        index = np.full(n, c), np.full(n, p)
        return cls(pixels, np.zeros(n), *index, np.zeros(n), plan.projectors)

    @classmethod
    def of(cls, plan: Scanner, decoded: Pairs) -> "Evidence":
        """Take as many edges of each pair, evenly; none with disordered labels."""
        parts = [cls.at(plan, np.zeros((0, 2)), 0, 0)]
        for (p, c), pair in decoded:
            edges = pair.edges
            if len(edges) < _LEAST_EDGES or pair.rejected.get("labels", 0):
                continue
            rows = np.linspace(0, len(edges) - 1, min(EDGES_A_PAIR, len(edges)))
            rows = rows.astype(np.int64)
            radii = plan.projectors[p].pattern.radii[edges.rings[rows]]
            some_edges = cls.at(plan, edges.pixels[rows], p, c)
            noise = edges.noise_px[rows]
            parts.append(replace(some_edges, radii=radii, noise_px=noise))
        return Evidence.join(parts)


# Points in the world [m] and unit normals there, shape (n, 3), NaN where rays miss.
Places = tuple[Array, Array]


def places(evidence: Evidence, supposed: Supposed) -> Places:
    """Return where edges lie on the object; the projectors don't matter."""
    n = len(evidence)
    points, normals = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    for c in np.unique(evidence.camera):
        chosen = np.flatnonzero(evidence.camera == c)
        camera = supposed.cameras[c]
        rays = camera.rays(evidence.pixels[chosen])
        whole = np.isfinite(rays[:, 0])
        hits, faces = supposed.body.hits(camera.centre, rays[whole])
        points[chosen[whole]] = hits
        normals[chosen[whole]] = supposed.body.normals(faces)
    return points, normals


def mismatches(evidence: Evidence, supposed: Supposed, at: Places) -> Array:
    """Return how far edges are off their rings [m], shape (n,).

    NaN where the object is missed or faces away from the light.

    With X where the edge lies, z its depth before the projector, and rho the ring
    coordinate of the projector's pixel that lights X (as the patterns were drawn), the
    mismatch is ``(rho - R) z / sqrt(1 + R^2)``, in parallel light ``rho - R``.

    Args:
        evidence: The edges.
        supposed: How everything is supposed to stand.
        at: Where the edges lie.
    """
    mismatch = np.full(len(evidence), np.nan)
    for p in np.unique(evidence.projector):
        chosen = np.flatnonzero(evidence.projector == p)
        projector, design = supposed.projectors[p], evidence.designs[p]
        points, normals = (one[chosen] for one in at)
        radii = evidence.radii[chosen]
        with np.errstate(invalid="ignore", divide="ignore"):
            pixels, depth = projector.panel(points)
            plane = design.ring_plane(pixels)
            off = np.hypot(plane[:, 0], plane[:, 1]) - radii
            lit = projector.incidence_cosine(points, normals) > 0.0
            off = np.where(lit, design.light.across_m(off, radii, depth), np.nan)
        mismatch[chosen] = off
    return mismatch
