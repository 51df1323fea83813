"""States the baseline program of `solvers` for cameras as they stand.

Seams and kept samples are drawn from what is measured now; samples that a proposal lost
come back as kept ones, so that the next one knows of them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.devices import PinholeModel
from planning.model.devices.device_poses import poses_of
from planning.model.devices.planned import PlannedCamera
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
from .baseline_rows import check_seam
from .camera_moves import Looks
from .seams import SampledSurface, Seam, both_orders, find_seams, spread_points

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
# Places along a border of the image.
_BORDER = 9


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
        looks: Looks,
        pairs: Sequence[tuple[int, int]],
        demanded: NDArray[np.int64],
        max_step: float,
    ) -> BaselineProblem:
        """Return the program for neighbours that go on to look so.

        `demanded` are (camera, sample)
        pairs that must be kept besides the drawn ones, (q, 2). No centre moves farther
        than `max_step` [m].
        """
        kept = np.unique(np.concatenate([self._sole_samples(), demanded]), axis=0)
        seams = find_seams(both_orders(pairs), self.surface, self.measured_by)
        points = self._seam_points(seam for seam in seams if seam.shares_border)
        index = np.array(pairs, dtype=np.int64)
        return self._stated(looks, index, points, kept, max_step)

    def elastic(
        self,
        looks: Looks,
        kept: NDArray[np.int64],
        weights: _Array,
        reserves: _Array,
        max_step: float,
    ) -> BaselineProblem:
        """Return the elastic program of pairs (camera, sample), `BaselineProblem.kept`.

        Centres and aims move no farther than `max_step` [m].
        """
        none, index = self._seam_points(()), np.zeros((0, 2), dtype=np.int64)
        gives = (weights, reserves)
        return self._stated(looks, index, none, kept, max_step, gives)

    def _stated(
        self,
        looks: Looks,
        pairs: NDArray[np.int64],
        seams: SeamPoints,
        kept: NDArray[np.int64],
        max_step: float,
        gives: tuple[_Array, _Array] | None = None,
    ) -> BaselineProblem:
        limits, cameras = self.limits, self.cameras
        space, (weights, reserves) = limits.workspace, gives or (None, np.zeros(0))
        return BaselineProblem(
            centres=poses_of(cameras)[:, :3, 3],
            aims=looks.aims,
            pairs=pairs,
            shell=PositionShell(
                np.array(space.centre),
                space.camera_radius_m,
                np.array(space.axis),
                space.half_angle,
                np.array(space.up),
                space.floor_m,
            ),
            seams=seams,
            kept=self._kept_points(kept),
            rolls=looks.rolls,
            ups=looks.ups,
            weights=weights,
            reserves=reserves,
            sides=image_sides(cameras[0].device, _SPARE_FIELD),
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
        facing = facing / lengths(ray)
        holder = np.argmax(np.where(self.measured_by[lost], facing, -2.0), axis=1)
        return np.column_stack([holder, lost]).astype(np.int64)

    def _seam_points(self, seams: Iterable[Seam]) -> SeamPoints:
        """Points at which (10) is stated."""
        spare, none = max(_SPARE_FIELD, self.limits.spare_field), np.zeros((0, 3))
        fields = np.zeros((0, 2))
        rows = [(fields.astype(np.int64), none, none, none, np.zeros(0), fields)]
        for seam in seams:
            pair = [self.cameras[index] for index in seam.cameras]
            test = check_seam(pair, self.surface, seam, self.limits.max_incidence)
            some = _tight_and_apart(test.slack, test.points, _SEAM_POINTS)
            fields = np.column_stack([test.half_field1, test.half_field2])
            rows.append(
                (
                    np.tile(np.array(seam.cameras), (len(some), 1)),
                    test.points[some],
                    test.angles.outward[some],
                    test.angles.onward[some],
                    test.angles.delta_surface[some],
                    fields[some] - spare,
                )
            )
        return SeamPoints(*(np.concatenate(x) for x in zip(*rows, strict=True)))

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
            facing /= lengths(ray)
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
        sigma, pitch = np.zeros(len(kept)), np.zeros(len(kept))
        across = np.zeros((len(kept), 3))
        for c in np.unique(index):
            mine, camera = np.flatnonzero(index == c), self.cameras[c]
            if self.rings is not None:
                across[mine], sigma[mine], pitch[mine], _ = best_rings(
                    camera, samples[mine], self.surface, self.rings, self.limits
                )
        return KeptPoints(index, points, normals, across, sigma, pitch)


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


def image_sides(device: PinholeModel, spare: float) -> _Array:
    """Return the least and largest x/z and y/z of a rectangle in the image, (2, 2).

    So many radians stay free on every side. Under distortion it is the largest upright
    one that the borders leave about the middle.
    """
    width, height = device.resolution
    edge = np.linspace(0.0, 1.0, _BORDER)[:, None]
    low, high = np.array([-0.5, -0.5]), np.array([width, height]) - 0.5
    sides = np.empty((2, 2))
    for axis, other in ((0, 1), (1, 0)):
        for end, value in enumerate((low, high)):
            border = np.empty((_BORDER, 2))
            border[:, axis] = value[axis]
            border[:, other] = (low + edge * (high - low))[:, other]
            rays = device.rays(border)
            slope = np.arctan2(rays[:, axis], rays[:, 2])
            sides[end, axis] = slope.min() - spare if end else slope.max() + spare
    return np.tan(sides)


def _tight_and_apart(tightness: _Array, points: _Array, n: int) -> NDArray[np.int64]:
    """Half of n the tightest (least), half farthest from each other; all if fewer."""
    return spread_points(points, n, np.argsort(tightness, kind="stable"))
