"""States the baseline program of `solvers` for cameras as they stand.

Seams and kept samples are drawn from what is measured now; samples that a proposal lost
come back as kept ones, so that the next one knows of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedCamera
from planning.model.requirements import Workspace
from planning.scene.workspace.admissible import half_spaces
from solvers.poses.baseline_problem import (
    BaselineProblem,
    HalfSpaces,
    KeptPoints,
    PositionShell,
    SeamPoints,
)

from .baseline_limits import BaselineLimits, RingsOnSurface, best_rings
from .baseline_rows import check_seam, half_field
from .camera_moves import poses_of
from .seams import SampledSurface, both_orders, find_seams

_Array = NDArray[np.float64]

# Few, since each costs time in every step of the program, and what they don't hold is
# demanded when a proposal loses it: 16 and 24 end no higher, in three times the time.
_SEAM_POINTS = 6
_LOST = 24
_KEPT_POINTS = 8
# Proposals stay this far inside the limits, since the samples between the kept ones
# are held only by them.
_SPARE_INCIDENCE = np.radians(0.3)
_SPARE_FIELD = np.radians(0.1)
_SPARE_CONDITIONING = 0.002
_COMFORT = np.radians(5.0)
_EASE = 0.03


@dataclass(frozen=True, eq=False)
class BaselineTerms:
    """Cameras as they stand, which measures which sample (n, k), and what binds."""

    cameras: Sequence[PlannedCamera]
    measured_by: NDArray[np.bool_]
    surface: SampledSurface
    limits: BaselineLimits
    rings: RingsOnSurface | None = None

    def problem(
        self,
        aims: _Array,
        pairs: Sequence[tuple[int, int]],
        demanded: NDArray[np.int64],
        max_step: float,
    ) -> BaselineProblem:
        """Return the program for neighbours that look at `aims` in [m], (k, 3).

        `demanded` are (camera, sample) pairs that must be kept besides the drawn ones,
        (q, 2). No centre moves farther than `max_step` [m].
        """
        limits, cameras = self.limits, self.cameras
        space = limits.workspace
        kept = np.unique(np.concatenate([self._sole_samples(), demanded]), axis=0)
        return BaselineProblem(
            centres=poses_of(cameras)[:, :3, 3],
            aims=aims,
            pairs=np.array(pairs, dtype=np.int64),
            shell=PositionShell(
                np.array(space.centre),
                space.camera_radius_m,
                np.array(space.axis),
                space.half_angle,
                np.array(space.up),
                space.floor_m,
            ),
            seams=self._seam_points(pairs),
            kept=self._kept_points(kept),
            max_incidence=limits.max_incidence - _SPARE_INCIDENCE,
            range_m=cameras[0].device.range_m,
            min_conditioning=limits.min_conditioning + _SPARE_CONDITIONING,
            max_step=max_step,
            half_spaces=_held_in(space, cameras),
            fixed=tuple(c for c, camera in enumerate(cameras) if camera.existing),
        )

    def holders(self, lost: NDArray[np.int64], centres: _Array) -> NDArray[np.int64]:
        """Return (camera, sample) pairs that would hold some of what a proposal lost.

        Each sample with the camera that it faces most at centres (k, 3), shape (q, 2).
        """
        if len(lost) > _LOST:
            lost = lost[np.linspace(0, len(lost) - 1, _LOST).astype(np.int64)]
        ray = self.surface.points[lost][:, None] - centres[None]
        facing = -np.einsum("ikj,ij->ik", ray, self.surface.normals[lost])
        facing = facing / np.linalg.norm(ray, axis=2)
        holder = np.argmax(np.where(self.measured_by[lost], facing, -2.0), axis=1)
        return np.column_stack([holder, lost]).astype(np.int64)

    def _seam_points(self, pairs: Sequence[tuple[int, int]]) -> SeamPoints:
        spare, none = max(_SPARE_FIELD, self.limits.spare_field), np.zeros((0, 3))
        fields = np.zeros((0, 2))
        seams = [(fields.astype(np.int64), none, none, none, np.zeros(0), fields)]
        for seam in find_seams(both_orders(pairs), self.surface, self.measured_by):
            if not seam.shares_border:
                continue
            pair = [self.cameras[index] for index in seam.cameras]
            test = check_seam(pair, self.surface, seam, self.limits.max_incidence)
            some = _tight_and_apart(test.slack, test.points, _SEAM_POINTS)
            fields = np.column_stack([test.half_field1, test.half_field2])
            seams.append(
                (
                    np.tile(np.array(seam.cameras), (len(some), 1)),
                    test.points[some],
                    test.angles.outward[some],
                    test.angles.onward[some],
                    test.angles.delta_surface[some],
                    fields[some] - spare,
                )
            )
        return SeamPoints(*(np.concatenate(x) for x in zip(*seams, strict=True)))

    def _sole_samples(self) -> NDArray[np.int64]:
        """Some of what each camera alone measures, the most oblique and well apart.

        Samples right at the limit are left out: on a noisy surface they lie everywhere
        and would hold the cameras where they are. What a move really loses is demanded
        later.
        """
        surface, measured_by = self.surface, self.measured_by
        sole = measured_by.sum(axis=1) == 1
        least = np.cos(self.limits.max_incidence - _COMFORT)
        pairs = [np.zeros((0, 2), dtype=np.int64)]
        for c, camera in enumerate(self.cameras):
            alone = np.flatnonzero(sole & measured_by[:, c])
            ray = surface.points[alone] - camera.world_from_device[:3, 3]
            facing = -np.einsum("ij,ij->i", ray, surface.normals[alone])
            facing /= np.linalg.norm(ray, axis=1)
            eased = facing >= least
            if self.rings is not None and len(alone):
                best = best_rings(camera, alone, surface, self.rings, self.limits)
                eased &= best[3] >= _EASE
            alone, facing = alone[eased], facing[eased]
            some = alone[_tight_and_apart(facing, surface.points[alone], _KEPT_POINTS)]
            pairs.append(np.column_stack([np.full(len(some), c), some]))
        return np.concatenate(pairs)

    def _kept_points(self, kept: NDArray[np.int64]) -> KeptPoints:
        index, samples = kept[:, 0], kept[:, 1]
        points, normals = self.surface.points[samples], self.surface.normals[samples]
        cosine, sigma, pitch = (np.zeros(len(kept)) for _ in range(3))
        across = np.zeros((len(kept), 3))
        for c in np.unique(index):
            mine, camera = np.flatnonzero(index == c), self.cameras[c]
            cosine[mine] = _field_cosines(camera, points[mine])
            if self.rings is not None:
                across[mine], sigma[mine], pitch[mine], _ = best_rings(
                    camera, samples[mine], self.surface, self.rings, self.limits
                )
        return KeptPoints(index, points, normals, cosine, across, sigma, pitch)


def _held_in(workspace: Workspace, cameras: Sequence[PlannedCamera]) -> HalfSpaces:
    """The convex part of the zones about each camera that may move."""
    free = np.flatnonzero([not camera.existing for camera in cameras])
    offsets = poses_of(cameras)[free, :3, 3] - np.array(workspace.centre)
    held = [half_spaces(workspace, offset) for offset in offsets]
    return HalfSpaces(
        np.repeat(free, np.array([len(normals) for normals, _ in held], np.int64)),
        np.concatenate([np.empty((0, 3)), *(normals for normals, _ in held)]),
        np.concatenate([np.empty(0), *(least for _, least in held)]),
    )


def _field_cosines(camera: PlannedCamera, points: _Array) -> _Array:
    """Cosine of the half field in the plane of the axis and each point."""
    axis = camera.world_from_device[:3, 2]
    ray = points - camera.world_from_device[:3, 3]
    depth = ray @ axis
    aside = ray - depth[:, None] * axis
    distance = np.linalg.norm(aside, axis=1)
    centred = distance <= 1e-12
    aside = np.where(centred[:, None], camera.world_from_device[:3, 0], aside)
    towards = aside / np.linalg.norm(aside, axis=1, keepdims=True)
    along = np.broadcast_to(axis, towards.shape)
    half = half_field(camera, along, towards, np.arctan2(distance, depth))
    return np.cos(half - _SPARE_FIELD)


def _tight_and_apart(tightness: _Array, points: _Array, n: int) -> NDArray[np.int64]:
    """Half of n the tightest (least), half farthest from each other; all if fewer."""
    if len(points) <= n:
        return np.arange(len(points))
    chosen = list(np.argsort(tightness, kind="stable")[: n // 2])
    gap = np.min(np.linalg.norm(points[:, None] - points[chosen][None], axis=2), axis=1)
    while len(chosen) < n:
        farthest = int(np.argmax(gap))
        chosen.append(farthest)
        gap = np.minimum(gap, np.linalg.norm(points - points[farthest], axis=1))
    return np.array(sorted(chosen), dtype=np.int64)
