"""Candidate poses of a sensor head, and the devices that it holds there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations
from typing import TypeVar

import numpy as np

from geometry.arrays import Array
from geometry.devices import PinholeModel
from planning.model.devices.device_poses import moved_to
from planning.model.devices.heads import Head, HeadDevice
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Workspace
from planning.scene.placed_bodies import Device
from planning.scene.scene import Scene
from planning.scene.workspace.admissible import admissible
from planning.scene.workspace.candidates import Candidates
from planning.scene.workspace.shell_positions import Range

from .housings import collision, has_room, in_the_way

_D = TypeVar("_D", PlannedProjector, PlannedCamera)

# Quarter turns about the line of sight: which side of what is looked at the projector
# is on decides what both reach.
_ROLLS = 4
_PIXELS = 1000
_LEAST_M = 1e-3


@dataclass(frozen=True, eq=False)
class PlacedHead:
    """A head at a pose, with what it holds.

    It is turned by so many `quarters` about its line of sight, from upright.
    """

    world_from_head: Array
    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]
    quarters: int = 0

    @property
    def places(self) -> Array:
        """Optical centres of its devices, (n, 3)."""
        devices = (*self.projectors, *self.cameras)
        return np.stack([device.world_from_device[:3, 3] for device in devices])

    def named(self, station: str) -> "PlacedHead":
        """Return the head with its devices at a station of that name."""
        return replace(
            self,
            projectors=tuple(replace(p, station=station) for p in self.projectors),
            cameras=tuple(replace(c, station=station) for c in self.cameras),
        )


@dataclass(frozen=True, eq=False)
class HeadSource:
    """Gives poses of a head over the workspace.

    Attributes:
        scene: Surface and requirements.
        head: The head.
        workspace: Where the origin of its frame may stand.
        projectors: A projector of each of the rig's models, `cameras` likewise.
        carried: Whether all poses are of one head.
    """

    scene: Scene
    head: Head
    workspace: Workspace
    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]
    carried: bool = False

    def over(self, n: int) -> tuple[PlacedHead, ...]:
        """Return about n poses over the workspace.

        Raises:
            InfeasibleLimitsError: If the workspace holds no position.
        """
        views = self._offer.over(-(-n // _ROLLS))
        return tuple(h for k in range(_ROLLS) for h in self._turned(views, k))

    def around(
        self, head: PlacedHead, n: int, scale: float = 1.0
    ) -> tuple[PlacedHead, ...]:
        """Return poses close around one of a lattice of n, turned as it is."""
        view = replace(self.view, world_from_device=head.world_from_head)
        views = self._offer.around([view], n // _ROLLS, scale, far=True)
        return self._turned(views, head.quarters)

    def at(self, world_from_head: Array) -> PlacedHead:
        """Return the head at a pose."""
        return PlacedHead(
            world_from_head,
            tuple(
                moved_to(
                    _model(self.projectors, d), world_from_head @ d.head_from_device
                )
                for d in self.head.projectors
            ),
            tuple(
                moved_to(_model(self.cameras, d), world_from_head @ d.head_from_device)
                for d in self.head.cameras
            ),
        )

    def colliding(self, heads: Sequence[PlacedHead]) -> tuple[int, int] | None:
        """Return two heads of which a housing is in the other's way; None: none are.

        They collide, or one stands in the light or the view of the other.
        """
        body = self.head.body
        if self.carried or body is None:
            return None
        clearance = self.scene.requirements.workspace.clearance_m
        pair = collision(body, [head.world_from_head for head in heads], clearance)
        if pair is not None:
            return pair
        for i, j in permutations(range(len(heads)), 2):
            pose, places = heads[i].world_from_head, heads[j].places
            if in_the_way(body, pose, places, self._ball):
                return i, j
        return None

    @cached_property
    def _ball(self) -> tuple[Array, float]:
        """A ball that holds all of the object: centre (3,), radius [m]."""
        centre = np.array(self.scene.requirements.workspace.centre)
        ways = self.scene.mesh.vertices - centre
        return centre, float(np.linalg.norm(ways, axis=1).max())

    @cached_property
    def view(self) -> PlannedCamera:
        """A camera that sees the head's measuring volume, in its frame."""
        volume = self.head.volume
        width, height = volume.size_at(np.array(self.head.working_m)).tolist()
        focal = _PIXELS * self.head.working_m / width
        resolution = _PIXELS, max(1, round(_PIXELS * height / width))
        matrix = np.diag([focal, focal, 1.0])
        matrix[:2, 2] = [0.5 * (n - 1) for n in resolution]
        device = PinholeModel(matrix, resolution, (volume.near_m, volume.far_m))
        return PlannedCamera("", np.eye(4), device)

    @cached_property
    def _offer(self) -> Candidates[PlannedCamera]:
        (offer,) = self.scene.candidates([self.view], self.workspace).of_models
        return offer

    def _turned(
        self, views: Sequence[PlannedCamera], quarters: int
    ) -> tuple[PlacedHead, ...]:
        """The head at poses, turned by so many quarters about the line of sight."""
        turn, angle = np.eye(4), 2.0 * np.pi * quarters / _ROLLS
        turn[:2, :2] = np.round(
            [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        )
        every = (self.at(view.world_from_device @ turn) for view in views)
        return tuple(
            replace(head, quarters=quarters) for head in every if self.may_stand(head)
        )

    def may_stand(self, head: PlacedHead) -> bool:
        """Whether workspace and object let its devices and its housing stand there."""
        space = self.scene.requirements.workspace
        kinds = (
            (head.projectors, space.projector_radius_m),
            (head.cameras, space.camera_radius_m),
        )
        return all(
            admissible(space, radius, _offsets(devices, space)).all()
            for devices, radius in kinds
        ) and has_room(self.scene, self.head.body, head.world_from_head)


def widened(space: Workspace, head: Head) -> Workspace:
    """Return a workspace that holds a head's devices where it holds its origin."""
    lever = max(np.linalg.norm(d.head_from_device[:3, 3]) for d in head.devices)

    def wider(radius: Range) -> Range:
        return max(_LEAST_M, radius[0] - float(lever)), radius[1] + float(lever)

    return replace(
        space,
        projector_radius_m=wider(space.projector_radius_m),
        camera_radius_m=wider(space.camera_radius_m),
    )


def _model(templates: Sequence[_D], device: HeadDevice) -> _D:
    """The template of a head's device: of its model, or the first."""
    named = (t for t in templates if t.model == device.model)
    return next(named) if device.model else templates[0]


def _offsets(devices: Sequence[Device], space: Workspace) -> Array:
    places = np.stack([device.world_from_device[:3, 3] for device in devices])
    return places - np.array(space.centre)
