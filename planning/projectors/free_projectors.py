"""Projectors for `planning.proofs.moved_poses`: one fewer, from anywhere."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.proofs.selection import CandidateCover
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT

from .candidate_set import CandidateSet, CandidateSource
from .fewest_projectors import confirms


@dataclass(frozen=True, eq=False)
class ProjectorOffer:
    """Known poses of projectors, and what gives others around them."""

    source: CandidateSource
    candidates: CandidateSet

    @property
    def known(self) -> tuple[PlannedProjector, ...]:
        """The candidates."""
        return self.candidates.projectors

    @property
    def cover(self) -> CandidateCover:
        """What they light."""
        return self.candidates.cover

    def around(
        self, device: PlannedProjector, n_lattice: int, scale: float
    ) -> tuple[PlannedProjector, ...]:
        """Return poses around one, every other one far from the object."""
        return self.source.around((device,), n_lattice, scale, far=True)

    def covers(
        self, devices: Sequence[PlannedProjector], samples: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Return which of some samples each lights."""
        some = self.candidates.samples.take(samples)
        return lit_stages(self.candidates.scene, devices, some) == LIT

    def confirms(self, devices: tuple[PlannedProjector, ...], draw: int) -> bool:
        """Return whether they light enough of fresh samples."""
        return confirms(self.candidates, devices, draw)
