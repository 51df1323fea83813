"""Candidate poses of a projector: where they come from, and what each lights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.proofs.device_stock import DeviceStock
from planning.proofs.quotas import RegionFloors
from planning.proofs.selection import CandidateCover
from planning.scene.bodies.clearance import candidates_with_clearance, with_clearance
from planning.scene.lighting import lit_stages
from planning.scene.limits import projector_limits
from planning.scene.placed_bodies import existing_devices, movable
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene
from planning.scene.workspace.model_candidates import ModelCandidates


@dataclass(frozen=True, eq=False)
class CandidateSource:
    """Gives poses whose bodies are clear of what stands already.

    Attributes:
        scene: Surface and requirements.
        templates: Optics of each model of projectors, and its rings until cameras are
            known.
    """

    scene: Scene
    templates: tuple[PlannedProjector, ...]

    @cached_property
    def _offer(self) -> ModelCandidates[PlannedProjector]:
        return self.scene.candidates(self.templates)

    def lattice(self, n: int) -> tuple[PlannedProjector, ...]:
        """Return existing projectors, and at least n of each model anywhere."""
        existing = existing_devices(self.scene.requirements, self.templates)
        every = n * len(self.templates)
        return existing + candidates_with_clearance(self.scene, every, self._offer.over)

    def around(
        self,
        chosen: Sequence[PlannedProjector],
        n_lattice: int,
        scale: float = 1.0,
        *,
        far: bool = False,
    ) -> tuple[PlannedProjector, ...]:
        """Return poses close around those chosen, existing ones excepted.

        `n_lattice` is the number of poses of the lattice that they are from; `scale`
        says how far out, as a share of its spacing; every other one is `far` from the
        object if they may be.
        """
        between = self._offer.around(movable(chosen), n_lattice, scale, far=far)
        return with_clearance(self.scene, between)

    def towards(self, directions: NDArray[np.float64]) -> tuple[PlannedProjector, ...]:
        """Return poses in directions from the centre of the workspace, shape (k, 3)."""
        return with_clearance(self.scene, self._offer.towards(directions))


@dataclass(frozen=True, eq=False)
class CandidateSet:
    """Candidate poses, and the first limit that each violates at each sample, (n, k).

    The first `n_existing` are taken whatever they light, and stay.
    """

    scene: Scene
    samples: Target
    projectors: tuple[PlannedProjector, ...]
    stages: NDArray[np.int8]
    n_existing: int

    @classmethod
    def over(
        cls, scene: Scene, samples: Target, projectors: tuple[PlannedProjector, ...]
    ) -> "CandidateSet":
        """Return what poses light; those of existing projectors come first."""
        limits = scene.requirements.projector
        stages = scene.cache.recall(
            "lit_stages",
            (scene.mesh, scene.bodies, limits, projectors, samples),
            lambda: lit_stages(scene, projectors, samples),
        )
        n_existing = len(scene.requirements.existing_of("projector"))
        return cls(scene, samples, projectors, stages, n_existing)

    @cached_property
    def lit(self) -> NDArray[np.bool_]:
        """Which pose lights which sample, shape (n, k)."""
        return self.stages == projector_limits.LIT

    @property
    def unshadowed(self) -> NDArray[np.bool_]:
        """Which pose would light which sample without the mesh's shadows, (n, k)."""
        return self.lit | (self.stages == projector_limits.OCCLUDED)

    @cached_property
    def reached(self) -> NDArray[np.bool_]:
        """Which samples any pose lights, shape (n,)."""
        return np.any(self.lit, axis=1)

    @cached_property
    def cover(self) -> CandidateCover:
        """What the poses light, with what is required of them."""
        required = self.scene.requirements
        return CandidateCover(
            self.lit,
            required.dominant_coverage,
            seed=self.scene.seed,
            max_count=required.max_projectors,
            n_existing=self.n_existing,
            regions=RegionFloors.of(self.scene, self.samples),
            stock=self.stock,
        )

    @cached_property
    def stock(self) -> DeviceStock | None:
        """How many there are of each pose's model; None: any number."""
        counts = self.scene.requirements.stock_of("projector")
        return DeviceStock.of(self.projectors, counts)

    def extended(self, more: tuple[PlannedProjector, ...]) -> "CandidateSet":
        """Return these poses and more."""
        return self.joined(CandidateSet.over(self.scene, self.samples, more))

    def joined(self, other: "CandidateSet") -> "CandidateSet":
        """Return both sets of poses, which are of the same samples, as one."""
        stages = np.concatenate([self.stages, other.stages], axis=1)
        return replace(
            self, projectors=self.projectors + other.projectors, stages=stages
        )

    def take(self, chosen: NDArray[np.int64]) -> "CandidateSet":
        """Return some of the poses, the existing ones among them."""
        return replace(self, projectors=self.of(chosen), stages=self.stages[:, chosen])

    def of(self, chosen: NDArray[np.int64]) -> tuple[PlannedProjector, ...]:
        """Return the projectors of some poses."""
        return tuple(self.projectors[i] for i in chosen)

    def on(self, samples: Target) -> "CandidateSet":
        """Return what the same poses light of other samples."""
        return CandidateSet.over(self.scene, samples, self.projectors)

    def with_samples(self, fresh: "CandidateSet") -> "CandidateSet":
        """Return the same poses on the samples of both."""
        return replace(
            self,
            samples=merged(self.samples, fresh.samples),
            stages=np.concatenate([self.stages, fresh.stages]),
        )


class NothingLitError(InfeasibleLimitsError):
    """No candidate lights any sample."""

    def __init__(self, candidates: CandidateSet) -> None:
        n_causes = len(projector_limits.CAUSES)
        stages = candidates.stages.ravel()
        counts = np.bincount(stages, minlength=n_causes)[:n_causes]
        share = 100.0 * counts / counts.sum()
        named = ", ".join(
            f"{cause} {percent:.0f} %"
            for cause, percent in sorted(
                zip(projector_limits.CAUSES, share, strict=True),
                key=lambda pair: -pair[1],
            )
            if percent >= 1.0
        )
        super().__init__(
            f"no projector of {len(candidates.projectors)} poses lights any part of "
            f"the target; of all pairs of pose and sample, the first limit that fails "
            f"is {named}"
        )
        self.candidates = candidates
