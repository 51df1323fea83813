"""Which samples cameras measure by each other's images, and what keeps others back."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import Requirements
from planning.scene.limits.limit import first_violated
from planning.scene.limits.view_pair_limits import (
    FEW_VIEWS,
    MEASURED_BY_VIEWS,
    VIEW_PAIR_LIMITS,
)
from planning.scene.measuring.camera_views import CameraView, camera_views, view_of
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .view_pairs import Sightings, ViewPairQuality

_Ints = NDArray[np.int64]
_Mask = NDArray[np.bool_]
# Cameras of a reference set that are looked at together.
_BLOCK = 24


def views_of(required: Requirements) -> int:
    """Return how many cameras must see a sample, two at least."""
    return max(2, required.min_views or 2)


@dataclass(frozen=True, eq=False)
class ViewPairs:
    """One camera's pairs with those before it, on k samples that both see.

    Attributes:
        first, second: Rows of the sightings, shape (k,).
        samples: Which samples, shape (k,).
        quality: How well each is measured.
        first_violated: Index in `VIEW_PAIR_LIMITS`, or their number, shape (k,).
    """

    first: _Ints
    second: _Ints
    samples: _Ints
    quality: ViewPairQuality
    first_violated: NDArray[np.int8]

    @property
    def measured(self) -> _Mask:
        """Which keep every limit, shape (k,)."""
        return self.first_violated == len(VIEW_PAIR_LIMITS)


@dataclass(frozen=True, eq=False)
class MeasuredViews:
    """What cameras measure of n samples, each pair looked at.

    Attributes:
        seen: Which camera sees which, shape (n, m).
        by_pair: Which camera is one of a good pair, of those that enough see, (n, m).
        others: Whether it is measured without each camera, shape (n, m).
        furthest: How far samples come over all pairs: index in `VIEW_CAUSES` of what
            holds them back, `MEASURED_BY_VIEWS` where nothing does, shape (n,); of
            those that no camera sees what the cameras' views say.
    """

    seen: _Mask
    by_pair: _Mask
    others: _Mask
    furthest: NDArray[np.int8]

    @cached_property
    def measured(self) -> _Mask:
        """Which are measured, shape (n,)."""
        return self.furthest == MEASURED_BY_VIEWS


def view_pairs(
    scene: Scene, sightings: Sightings, n_cameras: int
) -> Iterator[ViewPairs]:
    """Yield each camera's pairs with the cameras before it."""
    limits = scene.requirements.triangulation
    for camera in range(1, n_cameras):
        scene.check_cancelled()
        rows = sightings.rows_of(camera)
        second, first = sightings.partners(rows, slice(0, rows.start))
        quality = sightings.quality(first, second, limits)
        violated = first_violated(VIEW_PAIR_LIMITS, quality, limits, len(first))
        yield ViewPairs(first, second, sightings.sample[first], quality, violated)


def measured_views(
    scene: Scene, cameras: Sequence[PlannedCamera], target: Target
) -> MeasuredViews:
    """Return what cameras measure of samples.

    A sample is measured where `views_of` cameras see it, and some pair of them keeps
    the limits of angle and deviation.
    """
    n, m, least = len(target), len(cameras), views_of(scene.requirements)
    sightings = Sightings.of(
        camera_views(scene, cameras, target), target.samples.normals
    )
    seen = np.zeros((n, m), dtype=bool)
    seen[sightings.sample, sightings.camera] = True
    furthest = np.full(n, FEW_VIEWS, dtype=np.int8)
    pairs = np.zeros(n, dtype=np.int64)
    of_camera = np.zeros((n, m), dtype=np.int64)
    for pair in view_pairs(scene, sightings, m):
        stage = (FEW_VIEWS + pair.first_violated).astype(np.int8)
        np.maximum.at(furthest, pair.samples, stage)
        good, samples = pair.measured, pair.samples[pair.measured]
        np.add.at(pairs, samples, 1)
        for rows in (pair.first[good], pair.second[good]):
            np.add.at(of_camera, (samples, sightings.camera[rows]), 1)
    count = seen.sum(axis=1)
    few = count < least
    furthest[few] = FEW_VIEWS
    enough = ~few[:, None]
    without = (pairs[:, None] > of_camera) & (count[:, None] - seen >= least)
    return MeasuredViews(seen, (of_camera > 0) & enough, without, furthest)


def unseen_causes(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    target: Target,
    measured: MeasuredViews,
) -> NDArray[np.int8]:
    """Return `furthest` with what keeps samples from every camera's view, (n,)."""
    furthest = measured.furthest.copy()
    dark = np.flatnonzero(~measured.seen.any(axis=1))
    stage = np.zeros(len(dark), dtype=np.int8)
    for camera in cameras if len(dark) else ():
        view = view_of(scene, camera, target.take(dark))
        stage = np.maximum(stage, view.first_violated)
    furthest[dark] = stage
    return furthest


def reached_by_views(
    scene: Scene, cameras: Sequence[PlannedCamera], target: Target
) -> _Mask:
    """Return which samples enough cameras see, some pair of them well, shape (n,)."""
    limits, least = scene.requirements.triangulation, views_of(scene.requirements)
    normals = target.samples.normals
    pending, reached = np.arange(len(target)), np.zeros(len(target), dtype=bool)
    known: list[CameraView] = []
    paired = np.zeros(len(target), dtype=bool)
    for start in range(0, len(cameras), _BLOCK):
        scene.check_cancelled()
        if not len(pending):
            break
        fresh = camera_views(
            scene, cameras[start : start + _BLOCK], target.take(pending)
        )
        known = [_still(view, reached) for view in known]
        n_old = len(known)
        known += [CameraView(pending[view.samples], view.view) for view in fresh]
        sightings = Sightings.of(known, normals)
        for camera in range(max(n_old, 1), len(known)):
            rows = sightings.rows_of(camera)
            second, first = sightings.partners(rows, slice(0, rows.start))
            left = ~paired[sightings.sample[first]]
            first, second = first[left], second[left]
            good = sightings.good(first, second, limits)
            paired[sightings.sample[first[good]]] = True
        reached |= paired & (sightings.counts() >= least)
        pending = np.flatnonzero(~reached)
    return reached


def _still(view: CameraView, reached: _Mask) -> CameraView:
    return view.take(np.flatnonzero(~reached[view.samples]))
