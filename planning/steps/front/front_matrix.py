"""The one visibility matrix of a front: what every candidate lights and sees."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import camera_candidate_views
from planning.model.devices.planned import PlannedCamera
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import (
    CandidateSet,
    CandidateSource,
    NothingLitError,
)
from planning.report.advice.projector_relaxations import nothing_lit
from planning.report.advice.standing_inside import standing_inside
from planning.report.partial_plan import Prepared
from planning.scene.draws import DRAWS
from planning.scene.measuring.camera_views import CameraView, CandidateViews
from planning.scene.measuring.measurability import view
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers import solve_cover

# Counted work of the cover about which more candidates are offered.
_SEEDS_BUDGET = 2e8


@dataclass(frozen=True, eq=False)
class FrontMatrix:
    """What candidates light and see of the same samples of the target.

    Attributes:
        candidates: Projectors, existing ones first, and the first limit that each
            violates; no region has a floor there.
        cameras: Candidates, existing ones first.
        seen: Which camera sees which sample, nothing in between, shape (n, m).
    """

    candidates: CandidateSet
    cameras: tuple[PlannedCamera, ...]
    seen: NDArray[np.bool_]

    @property
    def scene(self) -> Scene:
        """Surface and requirements."""
        return self.candidates.scene

    @property
    def target(self) -> Target:
        """The samples."""
        return self.candidates.samples

    @cached_property
    def views(self) -> CandidateViews:
        """How the cameras see the samples; what is in between is kept, no ray cast."""
        limits = self.scene.requirements.camera
        views: list[CameraView] = []
        for camera, column in zip(self.cameras, self.seen.T, strict=True):
            some = np.flatnonzero(column)
            seen = view(camera, self.target.take(some), limits, None)
            views.append(CameraView(some, seen))
        return CandidateViews(self.scene, self.cameras).knowing(self.target, views)


def matrix_of(ready: Prepared, clock: Stopwatch) -> FrontMatrix:
    """Look once at what candidates light and see.

    Around those of a lattice that cover what is asked there are more candidates.

    Raises:
        InfeasibleLimitsError: If no candidate lights any sample.
    """
    scene, rig = ready.scene.without_floors, ready.request.rig
    with clock.stage("matrix", "front: what candidates light and see"):
        samples = scene.target_samples(DRAWS.projectors)
        source = CandidateSource(scene, ready.templates)
        lattice = source.lattice(rig.n_projector_poses)
        candidates = CandidateSet.over(scene, samples, lattice)
        if not candidates.lit.any():
            error = NothingLitError(candidates)
            helps = nothing_lit(scene, error) + standing_inside(scene, lattice)
            raise InfeasibleLimitsError(f"{error}; {helps}")
        cover = candidates.cover
        good = solve_cover(cover.problem, seed=cover.seed, budget=_SEEDS_BUDGET)
        around = source.around(candidates.of(good.selected), len(lattice))
        candidates = candidates.extended(around)
        offer = camera_candidate_views(scene, ready.cameras, rig.n_camera_poses)
        seen = np.zeros((len(samples), len(offer.cameras)), dtype=bool)
        for column, sight in enumerate(offer.on(samples)):
            seen[sight.samples, column] = True
        clock.say(
            f"  {len(candidates.projectors):,} projectors and {len(offer.cameras):,} "
            f"cameras on {len(samples):,} samples"
        )
    return FrontMatrix(candidates, offer.cameras, seen)
