"""States the elastic baseline program for cameras that are to take over a hole.

Where a camera's part ends beside samples that none measures, (10) is violated: camera
2, which is to go on from there, doesn't reach E. So it is at every sample of the hole
for the limits of the camera that comes nearest to measuring it. What gives way least
closes most of the hole; the farther a limit is past, the less it weighs, since not
every sample has to be measured.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from planning.model.devices.planned import PlannedCamera
from solvers.poses.baseline_problem import BaselineProblem

from .baseline_limits import BaselineLimits, RingsOnSurface, best_rings
from .baseline_terms import BaselineTerms, image_sides
from .camera_moves import Looks
from .seams import (
    SampledSurface,
    Seam,
    find_seam,
    spread_points,
)

_Array = NDArray[np.float64]
_Mask = NDArray[np.bool_]

# Samples that each camera keeps, of the hole that it is to take over, and at each end
# of a part beside that.
_KEPT, _HOLE, _END = 24, 24, 6
# Margins above this, of a cosine, aren't used up within a step.
_AT_STAKE = 0.4
# Limits that are so far past weigh half as much as those just past.
_HALF_WEIGHT = 0.15
# What a sample weighs that a program before lost.
_DEMANDED = 3.0
# As how far past a sample counts that only a shadow keeps from a camera.
_HIDDEN = 0.3


@dataclass(frozen=True, eq=False)
class HoleTerms:
    """Cameras as they stand, and what the others are to take over.

    Attributes:
        cameras: The cameras.
        measured: Which camera measures which sample, shape (n, k).
        surface: The samples.
        hole: Samples that none measures and that are wanted, shape (n,).
        limits: What binds a camera.
        rings: Rings of each projector on the samples; None: no rings.
    """

    cameras: Sequence[PlannedCamera]
    measured: _Mask
    surface: SampledSurface
    hole: _Mask
    limits: BaselineLimits
    rings: RingsOnSurface | None = None

    def problem(
        self, looks: Looks, lost: NDArray[np.int64], max_step: float
    ) -> BaselineProblem:
        """Return the elastic program about looks as they are.

        Samples that the program before lost, `lost`, are among those kept.
        """
        margins = np.column_stack([self._margins(camera) for camera in self.cameras])
        past = self.past(margins)
        owner, nearest = past.argmax(axis=1), past.max(axis=1)
        kept, weights = [np.zeros((0, 2), np.int64)], [np.zeros(0)]
        for c, samples, each in self._kept(margins, lost):
            kept.append(np.column_stack([np.full(len(samples), c), samples]))
            weights.append(np.where(np.isin(samples, lost), _DEMANDED, 1.0) * each)
        for c in range(len(self.cameras)):
            mine = np.flatnonzero(self.hole & (owner == c))
            some = mine[spread_points(self.surface.points[mine], _HOLE)]
            kept.append(np.column_stack([np.full(len(some), c), some]))
            each = len(mine) / max(len(some), 1)
            weights.append(each * _HALF_WEIGHT / (_HALF_WEIGHT - nearest[some]))
        terms = BaselineTerms(
            self.cameras, self.measured, self.surface, self.limits, self.rings
        )
        held, beyond, reserves = [kept[0]], [kept[0]], [np.zeros(0)]
        for seam in self.ends(past):
            one, two = seam.cameras
            some = spread_points(self.surface.points[seam.points], _END)
            ends, n = seam.points[some], len(some)
            held.append(np.column_stack([np.full(n, one), ends]))
            beyond.append(np.column_stack([np.full(n, two), seam.beyond[some]]))
            reserves.append(margins[ends, one])
            weights.append(np.full(n, len(seam.points) / n))
        return terms.elastic(
            looks,
            np.concatenate([*kept, *held, *beyond]),
            np.concatenate(weights),
            np.concatenate(reserves),
            max_step,
        )

    def past(self, margins: _Array) -> _Array:
        """How far limits are past, as margins of 0 or less; inf for what stays."""
        past = np.where(margins > 0.0, -_HIDDEN, margins)
        past[:, [bool(camera.existing) for camera in self.cameras]] = -np.inf
        return past

    def _kept(
        self, margins: _Array, lost: NDArray[np.int64]
    ) -> Iterator[tuple[int, NDArray[np.int64], float]]:
        """Some of what each camera measures best, and how many each stands for.

        Where there is much to spare nothing is at stake.
        """
        held = np.where(self.measured, margins, -np.inf)
        best, camera = held.max(axis=1), held.argmax(axis=1)
        for c in range(len(self.cameras)):
            at_stake = (best > -np.inf) & (best < _AT_STAKE) & (camera == c)
            mine = np.flatnonzero(at_stake)
            first = np.flatnonzero(np.isin(mine, lost))[:_KEPT]
            n = _KEPT + len(first)
            some = mine[spread_points(self.surface.points[mine], n, first)]
            yield c, some, len(mine) / max(len(some), 1)

    def ends(self, past: _Array) -> Iterator[Seam]:
        """Where a part ends beside what another camera is to take over.

        That is the one nearest to measuring it, `past` its limits by so much, (n, k).
        """
        for one in range(len(self.cameras)):
            others = past.copy()
            others[:, one] = -np.inf
            nearest = np.where(self.hole, others.argmax(axis=1), -1)
            for two in np.unique(nearest[self.hole & (others.max(axis=1) > -np.inf)]):
                parts = np.column_stack([self.measured[:, one], nearest == two])
                seam = find_seam((0, 1), self.surface, parts)
                if seam.shares_border:
                    yield replace(seam, cameras=(one, int(two)))

    def _margins(self, camera: PlannedCamera) -> _Array:
        """What the tightest limit of a camera leaves of each sample, (n,).

        In units of a cosine, or of a share of the distance; shadows don't count.
        """
        pose, surface = camera.world_from_device, self.surface
        ray = surface.points - pose[:3, 3]
        distance = lengths(ray)
        ray = ray / distance[:, None]
        facing = -np.einsum("ij,ij->i", ray, surface.normals)
        near, far = camera.device.range_m
        local = ray @ pose[:3, :3]
        low, high = image_sides(camera.device, 0.0)
        aside, depth = local[:, :2], local[:, 2:]
        inside = np.minimum(
            (aside - low * depth) / np.hypot(1.0, low),
            (high * depth - aside) / np.hypot(1.0, high),
        )
        least = [
            facing - np.cos(self.limits.max_incidence),
            distance / near - 1.0,
            1.0 - distance / far,
            inside.min(axis=1),
        ]
        if self.rings is not None:
            every = np.arange(len(distance))
            least.append(best_rings(camera, every, surface, self.rings, self.limits)[3])
        return np.minimum.reduce(least)
