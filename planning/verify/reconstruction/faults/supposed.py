"""Ring edges against the mesh, were the devices and the object placed otherwise.

A decoded edge says: at this pixel of this camera lies ring k of this projector.
Wherever the devices are supposed to stand, the pixel's ray meets the mesh in a point,
and the projector draws something there: how far that is from ring k is the mismatch. It
needs no root of a cone and no nearest point, and so stays smooth far from the truth.
"""

from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Columns, Indices
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.decode.code_map import CodeMap
from planning.verify.reconstruction.decode.decode import PairIndex, Pairs
from planning.verify.reconstruction.scanner import Scanner

Role = Literal["cameras", "projectors", "objects"]
# Points in the world [m] and unit normals there, shape (n, 3), NaN where rays miss.
Places = tuple[Array, Array]
# Edges of each pair of devices that are looked at, and of all pairs.
_EDGES_A_PAIR, _EDGES = 400, 20_000
# Incidence of light beyond which edges smear, `docs/use/faults.md` [rad].
GRAZING = np.deg2rad(70.0)
# Pairs with fewer edges say nothing.
_LEAST_EDGES = 60
# Codes of neighbours that differ by less aren't of a surface [px of the projector].
_LEAST_SLOPE = 1e-3


@dataclass(frozen=True, eq=False)
class Object:
    """The mesh, and where and how large the object is supposed to be against it.

    Its pose, (4, 4), is named as a device's; the origin is the centre of the mesh.
    """

    mesh: TriangleMesh
    caster: RayCaster
    world_from_device: Array
    scale: float = 1.0

    @property
    def centre(self) -> Array:
        """In the world in [m], shape (3,)."""
        return self.world_from_device[:3, 3]

    def met(self, origin: Array, rays: Array) -> Places:
        """Return where rays (n, 3) from a point meet it."""
        turn = self.world_from_device[:3, :3]
        start = self.mesh.centre + (origin - self.centre) @ turn / self.scale
        faces, distances = self.caster.first_hits(start, rays @ turn)
        reach = np.where(faces >= 0, self.scale * distances, np.nan)
        return origin + reach[:, None] * rays, self.mesh.face_normals[faces] @ turn.T


@dataclass(frozen=True, eq=False)
class Supposed:
    """How everything is supposed to stand; devices in the order of the plan."""

    plan: Scanner
    cameras: tuple[CameraCalibration, ...]
    projectors: tuple[ProjectorCalibration, ...]
    objects: tuple[Object]

    @classmethod
    def of(cls, plan: Scanner) -> Self:
        """Return what the plan says."""
        pose = np.eye(4)
        pose[:3, 3] = plan.mesh.centre
        body = Object(plan.mesh, RayCaster(plan.mesh, threads=1), pose)
        return cls(plan, plan.cameras, plan.projectors, (body,))

    def seen(self, camera: int, pixels: Array) -> Places:
        """Return what pixels (n, 2) of a camera show of the object."""
        points, normals = np.full((2, len(pixels), 3), np.nan)
        rays = self.cameras[camera].rays(pixels)
        whole = np.isfinite(rays[:, 0])
        points[whole], normals[whole] = self.objects[0].met(
            self.cameras[camera].centre, rays[whole]
        )
        return points, normals


@dataclass(frozen=True, eq=False)
class Evidence(Columns):
    """Some labelled edges of every pair of devices, or coded pixels.

    A coded pixel lies on the ring about the projector's axis that its code is on.

    Attributes:
        pixels: Sub-pixel positions (u, v), shape (n, 2).
        radii: Ring that each edge is said to lie on, as in the plan, shape (n,).
        camera: Index of the camera, shape (n,).
        projector: Index of the projector, shape (n,).
        noise_px: Standard deviation of the edge's position across itself [px], (n,).
    """

    pixels: Array
    radii: Array
    camera: Indices
    projector: Indices
    noise_px: Array

    def index(self, role: Role) -> Indices:
        """Return which device of a role each edge is of, shape (n,)."""
        if role == "objects":
            return np.zeros(len(self), dtype=np.int64)
        return self.camera if role == "cameras" else self.projector

    @classmethod
    def at(cls, pixels: Array, p: int, c: int) -> Self:
        """Return pixels (n, 2) of one pair that are on no ring in particular."""
        n = len(pixels)
        return cls(pixels, np.zeros(n), np.full(n, c), np.full(n, p), np.zeros(n))

    @classmethod
    def of(cls, plan: Scanner, decoded: Pairs) -> Self:
        """Take edges of each pair, evenly; none with disordered labels."""
        most = min(_EDGES_A_PAIR, _EDGES // max(1, len(decoded)))
        parts = [cls.at(np.zeros((0, 2)), 0, 0)]
        for (p, c), pair in decoded:
            edges = pair.edges
            if pair.codes is not None:
                parts.append(cls.coded(plan, pair.codes, (p, c), most))
            if len(edges) < _LEAST_EDGES or pair.rejected.get("labels", 0):
                continue
            some = np.linspace(0, len(edges) - 1, min(most, len(edges)))
            some = some.astype(np.int64)
            radii = plan.projectors[p].pattern.radii[edges.rings[some]]
            at = cls.at(edges.pixels[some], p, c)
            parts.append(replace(at, radii=radii, noise_px=edges.noise_px[some]))
        return cls.join(parts)

    @classmethod
    def coded(cls, plan: Scanner, codes: CodeMap, pair: PairIndex, most: int) -> Self:
        """Take coded pixels of a pair, evenly; none where hardly any is."""
        (p, c), told = pair, codes.told
        if len(told) < _LEAST_EDGES:
            return cls.at(np.zeros((0, 2)), p, c)
        told = told[np.linspace(0, len(told) - 1, min(most, len(told))).astype(int)]
        shown = codes.codes.reshape(-1, 2)[told].astype(np.float64)
        sigma_px = codes.sigma.reshape(-1, 2)[told].max(axis=1).astype(np.float64)
        on_plane = plan.projectors[p].ring_plane(shown)
        return replace(
            cls.at(codes.pixels(told), p, c),
            radii=np.linalg.norm(on_plane, axis=1),
            noise_px=sigma_px / max(codes.per_pixel, _LEAST_SLOPE),
        )


def places(evidence: Evidence, supposed: Supposed) -> Places:
    """Return where edges lie on the object; the projectors don't matter."""
    points, normals = np.full((2, len(evidence), 3), np.nan)
    for c in np.unique(evidence.camera):
        of_camera = evidence.camera == c
        points[of_camera], normals[of_camera] = supposed.seen(
            c, evidence.pixels[of_camera]
        )
    return points, normals


def mismatches(
    evidence: Evidence, supposed: Supposed, at: Places
) -> tuple[Array, Array]:
    """Return how far edges at places are off their rings: rho - R, and [m], (n,) each.

    NaN where the object is missed or faces away from the light.

    With X where the edge lies, z its depth before the projector, and rho the ring
    coordinate of the projector's pixel that lights X (as the patterns were drawn), the
    mismatch is ``(rho - R) z / sqrt(1 + R^2)``, in parallel light ``rho - R``.
    """
    offset, across = np.full((2, len(evidence)), np.nan)
    for p in np.unique(evidence.projector):
        lit_by, radii = evidence.projector == p, evidence.radii[evidence.projector == p]
        projector, design = supposed.projectors[p], supposed.plan.projectors[p]
        points, normals = (one[lit_by] for one in at)
        with np.errstate(invalid="ignore", divide="ignore"):
            pixels, depth = projector.panel(points)
            rho = np.hypot(*design.ring_plane(pixels).T)
            lit = projector.incidence_cosine(points, normals) > 0.0
            offset[lit_by] = np.where(lit, rho - radii, np.nan)
            across[lit_by] = design.light.across_m(offset[lit_by], radii, depth)
    return offset, across
