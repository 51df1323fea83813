"""Cameras for `planning.proofs.moved_poses`: one fewer, from anywhere."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs.moved_poses import free_devices
from planning.proofs.selection import CandidateCover
from planning.scene.bodies.clearance import with_clearance
from planning.scene.measuring.measured import measured_by, taken
from planning.scene.scene import Scene
from planning.scene.workspace.model_candidates import ModelCandidates, one_of_each

from .camera_cover import CameraCover, candidate_cover, denial, fresh_samples
from .camera_routes import cover_by_cover
from .proved_cameras import CameraStage, camera_stage

_WHY = "fewer; found from poses anywhere, one moved at a time"


@dataclass(frozen=True, eq=False)
class CameraOffer:
    """Known poses of cameras for projectors as they are, and what gives others."""

    scene: Scene
    projectors: Sequence[PlannedProjector]
    found: CameraCover

    @property
    def known(self) -> tuple[PlannedCamera, ...]:
        """The candidates."""
        return self.found.candidates.cameras

    @property
    def cover(self) -> CandidateCover:
        """What they measure."""
        found = self.found
        return candidate_cover(self.scene, found.measured, found.samples, self.known)

    @cached_property
    def _offer(self) -> ModelCandidates[PlannedCamera]:
        return self.scene.candidates(one_of_each(self.known))

    def around(
        self, device: PlannedCamera, n_lattice: int, scale: float
    ) -> tuple[PlannedCamera, ...]:
        """Return poses around one."""
        between = self._offer.around((device,), n_lattice, scale)
        return with_clearance(self.scene, between)

    def covers(
        self, devices: Sequence[PlannedCamera], samples: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Return which of some samples each measures."""
        lit = self.found.samples
        return measured_by(self.scene, devices, taken(lit, samples, lit.lit))

    def confirms(self, devices: tuple[PlannedCamera, ...], draw: int) -> bool:
        """Return whether they measure enough of fresh samples."""
        fresh, _ = fresh_samples(self.scene, self.projectors, draw)
        chosen = len(self.known) + np.arange(len(devices))
        offered = self.found.candidates.joined(devices)
        return denial(self.scene, self.projectors, offered, chosen, fresh) is None


def has_room(stage: CameraStage) -> bool:
    """Return whether the bound over all poses leaves room for fewer cameras.

    Cameras with bodies aren't looked at.
    """
    proof = stage.certificate
    bound = proof.continuous
    if bound is None or proof.status == "infeasible" or stage.cover.has_bodies:
        return False
    return bound.lower_bound < proof.needed.count


def one_camera_fewer(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    stage: CameraStage,
    starts: int,
) -> CameraStage | None:
    """Return the stage of fewer cameras from poses anywhere; None: none were found.

    They join the candidates, over which the count is proved again.
    """
    proof, cover = stage.certificate, stage.cover
    offer = CameraOffer(scene, projectors, cover)
    found = free_devices(offer, proof.needed.count - 1, starts)
    if not found:
        return None
    joined = len(offer.known) + np.arange(len(found))
    known = np.append(np.arange(proof.given), joined)
    candidates = cover.candidates.joined(found)
    again = cover_by_cover(scene, projectors, candidates, known)
    needed = again.selection.needed
    if needed >= proof.needed.count:
        return None
    routes = stage.routes
    if routes is not None:
        routes = routes.changed(cover=needed, taken="cover", why=_WHY)
    return camera_stage(scene, again, routes)
