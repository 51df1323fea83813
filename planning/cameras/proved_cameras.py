"""The fewest cameras with what is proved of their number, over candidates and all."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.devices import PinholeModel
from planning.model.devices.planned import PlannedCamera
from planning.model.document.certificates import RouteCounts
from planning.proofs.all_poses import BoundQuestion, Effort, joined, with_existing_alone
from planning.proofs.camera_bound import bound_cameras
from planning.proofs.candidate_certificate import PlannedStage, certified
from planning.proofs.quotas import RegionFloors
from planning.scene.measuring.measured import taken
from planning.scene.scene import Scene

from .camera_cover import CameraCover, candidate_cover


@dataclass(frozen=True, eq=False)
class CameraStage(PlannedStage):
    """Cameras with what was proved of their number.

    Attributes:
        cameras: As they stand.
        cover: Candidates and samples, to prove the count again under other ring axes.
        routes: What either route needs; None where none was compared.
        rival: As many cameras of the paper's route, at their largest baselines, as the
            cover has.
    """

    cameras: tuple[PlannedCamera, ...]
    cover: CameraCover
    routes: RouteCounts | None = None
    rival: tuple[PlannedCamera, ...] = ()

    @property
    def reference(self) -> tuple[PlannedCamera, ...]:
        """The candidates."""
        return self.cover.candidates.cameras


def camera_stage(
    scene: Scene, cover: CameraCover, routes: RouteCounts | None = None
) -> CameraStage:
    """Return the cameras of a cover, with the best ones for every other count."""
    candidates = candidate_cover(
        scene, cover.measured, cover.samples, cover.candidates.cameras
    )
    others, proof = certified(
        candidates,
        cover.selection,
        cover.samples.target.samples.weight,
        cover.interference,
        cover.by_count,
    )
    by_count = {n: cover.among_candidates(of) for n, of in others.items()}
    return CameraStage(by_count, proof, cover.cameras, cover, routes)


def bound_stage(
    scene: Scene, stage: CameraStage, devices: Sequence[PinholeModel], effort: Effort
) -> CameraStage:
    """Return the stage with the bound over all poses in its certificate.

    It has none where existing cameras measure all that is reached of the first samples,
    and aren't enough for all.
    """
    proof, cover = stage.certificate, stage.cover
    samples, measured = cover.samples, cover.measured
    n_samples = len(samples.target)
    n = min(n_samples, effort.most_samples or n_samples)
    reached = np.any(measured[:n], axis=1)
    free = np.any(measured[:n, : proof.given], axis=1)
    wanted = np.flatnonzero(reached & ~free)
    if proof.needed.count <= proof.given:
        n_reached = int(np.any(measured, axis=1).sum())
        return replace(stage, certificate=with_existing_alone(proof, n_reached))
    if not wanted.size:
        return stage
    question = BoundQuestion.about(
        proof,
        reached,
        free,
        scene.requirements.coverage,
        samples.target.samples.weight * n_samples,
        RegionFloors.of(scene, samples.target, "camera").take(np.arange(n)),
    )
    lit = taken(samples, wanted, samples.lit)
    known = measured[wanted].T
    bound = bound_cameras(scene, devices, lit, question, effort, known)
    certificate, refutation = joined(proof, bound.proof()), bound.refutation()
    return replace(stage, certificate=certificate, refutation=refutation)
