"""What each camera sees of samples, apart from the light that falls on them.

Views don't depend on the projectors, so they are kept while ring axes turn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.cache.content import content
from planning.model.devices.planned import PlannedCamera
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.placed_bodies import blocked_by
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers.bit_rows import pack_rows, unpack_rows

from . import measurability

# Of a cosine: what this decides roughly, `measurability.view` decides exactly.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class CameraView:
    """Samples that one camera sees, with nothing in between, (k,), and how."""

    samples: NDArray[np.int64]
    view: ViewedSamples

    @classmethod
    def joined(cls, views: Sequence["CameraView"]) -> "CameraView":
        """Return the views of several cameras, one after the other."""
        return cls(
            np.concatenate([view.samples for view in views]),
            ViewedSamples.joined([view.view for view in views]),
        )

    def take(self, chosen: NDArray[np.int64]) -> "CameraView":
        """Return the view of some of the samples seen."""
        return CameraView(self.samples[chosen], self.view.take(chosen))


def camera_views(
    scene: Scene, cameras: Sequence[PlannedCamera], target: Target
) -> tuple[CameraView, ...]:
    """Return what each camera sees of samples."""
    offered: list[CameraView] = []
    wanted = np.zeros((len(cameras), len(target)), dtype=bool)
    limits = scene.requirements.camera
    facing = _facing(cameras, target, limits.max_incidence)
    for row, camera in enumerate(cameras):
        scene.check_cancelled()
        some = np.flatnonzero(facing[row])
        in_the_open = measurability.view(camera, target.take(some), limits, None)
        sight = CameraView(some, in_the_open).take(np.flatnonzero(in_the_open.seen))
        wanted[row, sight.samples] = True
        offered.append(sight)
    samples = target.samples
    centres = np.stack([camera.world_from_device[:3, 3] for camera in cameras])
    free = scene.occlusion.seen(centres, target, candidates=wanted)
    views: list[CameraView] = []
    for sight, camera, row in zip(offered, cameras, free, strict=True):
        clear = np.flatnonzero(row[sight.samples])
        points = samples.points[sight.samples[clear]]
        blocked = blocked_by(scene.bodies, camera, points).any(axis=1)
        views.append(sight.take(clear[~blocked]))
    return tuple(views)


def view_of(scene: Scene, camera: PlannedCamera, target: Target) -> ViewedSamples:
    """Return how a camera sees samples, everything in between included."""
    limits = scene.requirements.camera
    return measurability.view(camera, target, limits, scene.occlusion, scene.bodies)


class CandidateViews:
    """Views that the same cameras have of sets of samples, each looked at once."""

    def __init__(self, scene: Scene, cameras: Sequence[PlannedCamera]) -> None:
        self._scene, self.cameras = scene, tuple(cameras)
        self._known: list[tuple[NDArray[np.float64], tuple[CameraView, ...]]] = []
        self._first: CandidateViews | None = None

    @cached_property
    def content(self) -> str:
        """A hash of the cameras and of all that their views depend on."""
        scene = self._scene
        return content(
            self.cameras, scene.mesh, scene.requirements.camera, scene.bodies
        )

    def joined(self, more: Sequence[PlannedCamera]) -> "CandidateViews":
        """Return the views of these cameras, then of more; what is known is kept."""
        both = CandidateViews(self._scene, (*self.cameras, *more))
        both._first = self
        return both

    def knowing(self, target: Target, views: Sequence[CameraView]) -> "CandidateViews":
        """Return the same, with the views of these samples known."""
        both = CandidateViews(self._scene, self.cameras)
        both._known = [*self._known, (target.samples.points, tuple(views))]
        return both

    def on(self, target: Target) -> tuple[CameraView, ...]:
        """Return what each camera sees of samples."""
        points = target.samples.points
        for known, views in self._known:
            if np.array_equal(known, points):
                return views
        first = () if self._first is None else self._first.on(target)
        views = first + self.added_on(target)
        self._known.append((points, views))
        return views

    def added_on(self, target: Target) -> tuple[CameraView, ...]:
        """Return what the cameras see that `joined` added; without it, all."""
        added = self.cameras[0 if self._first is None else len(self._first.cameras) :]
        return camera_views(self._scene, added, target) if added else ()

    def seen(self, target: Target) -> NDArray[np.bool_]:
        """Return which sample (row) each camera (column) sees, shape (n, m)."""

        def answer() -> NDArray[np.uint64]:
            seen = np.zeros((len(target), len(self.cameras)), dtype=bool)
            for column, view in enumerate(self.on(target)):
                seen[view.samples, column] = True
            return pack_rows(seen)

        rows = self._scene.cache.recall("seen", (self, target), answer)
        return unpack_rows(rows, len(self.cameras))


def _facing(
    cameras: Sequence[PlannedCamera], target: Target, max_incidence: float
) -> NDArray[np.bool_]:
    """Whether a camera may meet a sample within the incidence limit, rounding allowed.

    Most of what a candidate can't see faces away from it. With O, P and N about one of
    the samples, -(P - O).N = O.N - P.N and |P - O|^2 = |O|^2 - 2 O.P + |P|^2; shape
    (n_cameras, n).
    """
    normals = target.samples.normals
    middle = target.samples.points[:1].sum(axis=0)
    points = target.samples.points - middle
    centres = np.stack([camera.world_from_device[:3, 3] for camera in cameras]) - middle
    along = centres @ normals.T - np.einsum("ij,ij->i", points, normals)
    squares = np.einsum("ij,ij->i", centres, centres)[:, None] - 2.0 * (
        centres @ points.T
    )
    squares += np.einsum("ij,ij->i", points, points)
    distances = np.sqrt(np.maximum(squares, 0.0))
    return along >= (np.cos(max_incidence) - _ROUNDING) * distances
