"""Every pose and optics at once, the object's too: edges off their rings, and slopes.

Of a camera with optical centre c, its ray r meets the mesh, whose normal there is N, in
X. If the ray moves by d at X, X moves by d - r (N.d) / (N.r) on the plane of the face;
if the surface moves by v, by r (N.v) / (N.r). With g the gradient of the ring
coordinate that a projector draws, an edge is therefore off its ring by another ::

    h.d,  h = g - N (g.r) / (N.r)        camera        ((g.r) / (N.r)) N.v      object

and by -g.v if the projector moves. Where facets meet, slopes jump with N.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from scipy.sparse import csc_array
from scipy.spatial.transform import Rotation

from geometry.arrays import cross
from planning.verify.reconstruction.arrays import Array, Indices
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)

from .supposed import Evidence, Places, Role, Supposed, mismatches, places

# Of each body in its own axes: turn [rad], displacement [m]; then of a device the focal
# length's change as a share and the principal point's [px], of the object its size's.
TURN, SHIFT, ZOOM, CENTRE = slice(0, 3), slice(3, 6), slice(6, 7), slice(7, 9)
# Squares of the panel and uneven brightness move edges about so far [px].
BIASED_PX = 0.015
_OF_DEVICE, _OF_OBJECT = 9, 7
# An edge that runs along its viewing ray isn't surer than this share of the median.
_LEAST_SLOPE = 0.2
# A patch of surface is so many ring gaps wide.
_PATCH_TAU = 2.0
_Device = TypeVar("_Device", CameraCalibration, ProjectorCalibration)


@dataclass(frozen=True, eq=False)
class Bundle:
    """Edges, and all that may be changed of how things are supposed to stand.

    Attributes:
        evidence: The edges.
        supposed: How everything is supposed to stand.
        relief_m: Standard deviation of how far each patch lies off the mesh [m]. What
            edges of a patch say of that together is taken out of them, so that with a
            large one only edges of different pairs tell against each other.
    """

    evidence: Evidence
    supposed: Supposed
    relief_m: float = 0.0
    _last: dict[bytes, tuple[Supposed, Places]] = field(
        default_factory=dict, init=False, repr=False
    )

    @property
    def n_unknowns(self) -> int:
        """Nine of each camera, then of each projector, then seven of the object."""
        rig = self.supposed
        return _OF_DEVICE * len(rig.cameras + rig.projectors) + _OF_OBJECT

    def columns(self, role: Role, index: int, part: slice = slice(None)) -> Indices:
        """Return the places of a body's unknowns."""
        cameras, projectors = self.supposed.cameras, self.supposed.projectors
        before = {"cameras": 0, "projectors": len(cameras)}
        first = index + before.get(role, len(cameras + projectors))
        size = _OF_OBJECT if role == "objects" else _OF_DEVICE
        return _OF_DEVICE * first + np.arange(size)[part]

    def moved(self, x: Array) -> Supposed:
        """Return how everything stands after changes, shape (n_unknowns,)."""
        rig, changes = self.supposed, iter(by_body(x))
        cameras = tuple(_moved(one, next(changes)) for one in rig.cameras)
        projectors = tuple(_moved(one, next(changes)) for one in rig.projectors)
        change, (body,) = next(changes), rig.objects
        scale = body.scale * float(np.exp(change[ZOOM][0]))
        pose = _moved_pose(body.world_from_device, change)
        body = replace(body, world_from_device=pose, scale=scale)
        return replace(rig, cameras=cameras, projectors=projectors, objects=(body,))

    @cached_property
    def sigma(self) -> Array:
        """Standard deviation of rho - R by the edges' own noise, (n,).

        As things are supposed to stand; where an edge misses the object, the median.
        """
        per_px = self._first[1]
        typical = np.nanmedian(per_px) if np.isfinite(per_px).any() else 1.0
        per_px = np.where(np.isfinite(per_px), per_px, typical)
        return np.fmax(per_px, _LEAST_SLOPE * typical) * np.hypot(
            self.evidence.noise_px, BIASED_PX
        )

    def offsets(self, x: Array) -> Array:
        """Return rho - R in units of sigma after changes, NaN as `mismatches`."""
        return mismatches(self.evidence, *self._standing(x))[0] / self.sigma

    def slopes(self, x: Array) -> Array:
        """Return their derivatives by the changes, (n, n_unknowns)."""
        slopes = self._slopes(*self._standing(x))[0] / self.sigma[:, None]
        first = 0
        for change in by_body(x):
            turned = slice(first, first := first + len(change))
            # A body that stands where it stood has nothing to turn back.
            if np.any(change[TURN]):
                slopes[:, turned] = slopes[:, turned] @ _inner(change)
        return slopes

    def _standing(self, x: Array) -> tuple[Supposed, Places]:
        """How all stands after changes, and where edges lie; the last is kept."""
        if (key := x.tobytes()) not in self._last:
            rig = self.moved(x)
            self._last.clear()
            self._last[key] = rig, places(self.evidence, rig)
        return self._last[key]

    @cached_property
    def _patches(self) -> tuple[csc_array, Array]:
        """What an offset of a patch does to edges: (n, k) of norm 1, the norms (k,).

        A patch is a cube of space; edges that miss the mesh are in one of their own.
        """
        points, _ = places(self.evidence, self.supposed)
        size = _PATCH_TAU * self.supposed.plan.limits.check.tau_m
        cube = np.nan_to_num(np.floor(points / size), nan=np.inf)
        _, patch = np.unique(cube, axis=0, return_inverse=True)
        rising = np.nan_to_num(self._first[2] / self.sigma)
        norm = np.sqrt(np.bincount(patch, rising**2))
        unit = rising / np.where(norm > 0.0, norm, 1.0)[patch]
        return csc_array((unit, (np.arange(len(unit)), patch))), norm

    def apart_from_relief(self, values: Array) -> Array:
        """Return offsets or slopes (n, ...) less what offsets of patches explain.

        With l the slopes by a patch's offset h, h of deviation s, and u = l / |l|, the
        sum of the squares of ``r - u (u.r) (1 - 1 / sqrt(1 + s^2 l.l))`` is the least
        of ``|r - l h|^2 + h^2 / s^2``.
        """
        if not self.relief_m > 0.0:
            return values
        unit, norm = self._patches
        share = 1.0 - 1.0 / np.hypot(1.0, self.relief_m * norm)
        return values - unit.multiply(share[None]) @ (unit.T @ values)

    def relief(self, off: Array) -> float:
        """Return the deviation of patches [m] that offsets of edges (n,) ask for.

        By the median over patches of two edges or more, which a dent doesn't move.
        """
        unit, norm = self._patches
        measured = (np.diff(unit.indptr) > 1) & (norm > 0.0)
        heights = (unit.T @ np.nan_to_num(off))[measured] / norm[measured]
        return 1.4826 * float(np.median(np.abs(heights))) if len(heights) else 0.0

    @cached_property
    def _first(self) -> tuple[Array, Array, Array]:
        return self._slopes(*self._standing(np.zeros(self.n_unknowns)))

    def _slopes(self, rig: Supposed, at: Places) -> tuple[Array, Array, Array]:
        """Derivatives of rho - R by a rig's changes, by a pixel, by surface raised."""
        evidence = self.evidence
        slopes = np.zeros((len(evidence), self.n_unknowns))
        per_px, rising = np.zeros((2, len(evidence)))
        pairs = np.column_stack([evidence.projector, evidence.camera])
        for p, c in np.unique(pairs, axis=0).tolist():
            rows = np.flatnonzero((pairs == (p, c)).all(axis=1))
            there = at[0][rows], at[1][rows]
            with np.errstate(invalid="ignore", divide="ignore"):
                gradient, of_projector = _projector_slopes(rig, p, there[0])
                of_camera, of_object, per_px[rows], rising[rows] = _camera_slopes(
                    rig, c, evidence.pixels[rows], there, gradient
                )
            slopes[np.ix_(rows, self.columns("projectors", p))] = of_projector
            slopes[np.ix_(rows, self.columns("cameras", c))] = of_camera
            slopes[np.ix_(rows, self.columns("objects", 0))] = of_object
        return slopes, per_px, rising


def _projector_slopes(rig: Supposed, p: int, points: Array) -> tuple[Array, Array]:
    """Gradient of the ring coordinate by the point (n, 3), and by the projector."""
    projector, design = rig.projectors[p], rig.plan.projectors[p]
    law, pose = projector.light, projector.world_from_device
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    pixels, _ = projector.panel(points)
    turn = design.ring_from_device
    drawn = design.drawn_matrix
    q = (pixels - drawn[:2, 2]) / np.diag(drawn)[:2]
    plane = law.turned(q, turn)
    across = plane / np.linalg.norm(plane, axis=1, keepdims=True)
    by_pixel = law.turned_slopes(q, across, turn) / np.diag(drawn)[:2]
    focal, centre = np.diag(projector.matrix)[:2], projector.matrix[:2, 2]
    by_place = law.plane_slopes(local, by_pixel * focal)
    zoom = _dot(by_pixel, pixels - centre)
    columns = [-cross(local, by_place), -by_place, zoom, by_pixel]
    return by_place @ pose[:3, :3].T, np.column_stack(columns)


def _camera_slopes(
    rig: Supposed, c: int, pixels: Array, at: Places, gradient: Array
) -> tuple[Array, Array, Array, Array]:
    """Derivatives by camera and object, by a pixel across its ring, by the surface."""
    camera, (body,), (points, normals) = rig.cameras[c], rig.objects, at
    rays = points - camera.centre
    reach = np.linalg.norm(rays, axis=1, keepdims=True)
    rays /= reach
    rising = _dot(gradient, rays) / _dot(normals, rays)
    lever = rising * normals
    turn = camera.world_from_device[:3, :3]
    local, across = (points - camera.centre) @ turn, (gradient - lever) @ turn
    step = 0.5 * np.eye(2)
    by_pixel = np.hstack(
        [
            _dot(
                reach * (camera.rays(pixels + one) - camera.rays(pixels - one)),
                gradient - lever,
            )
            for one in step
        ]
    )
    zoom = -_dot(by_pixel, pixels - camera.matrix[:2, 2])
    of_camera = [cross(local, across), across, zoom, -by_pixel]
    turn = body.world_from_device[:3, :3]
    local, along = (points - body.centre) @ turn, lever @ turn
    of_object = [cross(local, along), along, _dot(along, local)]
    per_px = np.linalg.norm(by_pixel, axis=1)
    return np.column_stack(of_camera), np.column_stack(of_object), per_px, rising[:, 0]


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)[:, None]


def by_body(x: Array) -> list[Array]:
    """Return what belongs to each camera, each projector and the object."""
    return np.split(x, range(_OF_DEVICE, len(x), _OF_DEVICE))


def _inner(change: Array) -> Array:
    """Derivative, by a body's change, of changes from where it stands after it.

    A turn w = t k changes by J dw, J the integral of exp(-s [w]) over s from 0 to 1::

        J = (sin t / t) 1 + (1 - sin t / t) k k^T - ((1 - cos t) / t) [k]

    and a displacement shows in the turned axes.
    """
    turn, block = change[TURN], np.eye(len(change))
    angle = float(np.linalg.norm(turn))
    k = turn / angle
    sine, half = np.sinc(angle / np.pi), np.sinc(0.5 * angle / np.pi)
    block[TURN, TURN] = (
        sine * np.eye(3)
        + (1.0 - sine) * np.outer(k, k)
        # (1 - cos t) / t, of a small t too.
        + (0.5 * angle * half * half) * np.cross(k, np.eye(3))
    )
    block[SHIFT, SHIFT] = Rotation.from_rotvec(turn).as_matrix().T
    return block


def _moved_pose(pose: Array, change: Array) -> Array:
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(change[TURN]).as_matrix()
    turn[:3, 3] = change[SHIFT]
    return pose @ turn


def _moved(device: _Device, change: Array) -> _Device:
    matrix = device.matrix.copy()
    matrix[[0, 1], [0, 1]] *= np.exp(change[ZOOM])
    matrix[:2, 2] += change[CENTRE]
    pose = _moved_pose(device.world_from_device, change)
    return replace(device, world_from_device=pose, matrix=matrix)
