"""What a member of a family takes for itself, and its own plan with the family's rig.

Its samples are those that the family's covers were solved on, and so are the candidates
and what they cover: no ray is cast again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planning.cameras.camera_cover import CameraCover, candidate_cover, measured_of
from planning.cameras.proved_cameras import CameraStage
from planning.model.document.certificates import (
    BestArea,
    CandidateBound,
    Certificate,
    NeededCount,
    OneFewer,
)
from planning.projectors.candidate_set import CandidateSet
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.candidate_certificate import bodies_left_out, unsought
from planning.proofs.selection import CandidateCover, Selection, select_fewest
from planning.report.partial_plan import PartialPlan, Prepared
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.measuring.measured import LitSamples, taken
from planning.scene.placed_bodies import Device
from planning.scene.samples import Target
from planning.scene.scene import Scene

# Counted work of the cover of one member, which the proof of the whole stands beside.
_BUDGET = 3e8


@dataclass(frozen=True, eq=False)
class MemberNeeds:
    """The stages of one member alone, whose certificates are of what it takes."""

    projectors: ProjectorStage
    cameras: CameraStage


def member_needs(
    ready: Prepared, partial: PartialPlan, first_face: int, member: int
) -> MemberNeeds:
    """Return what a member takes of the family's candidates.

    Args:
        ready: The member alone.
        partial: The family's projectors and cameras.
        first_face: Of the member's, among all faces of the family.
        member: Its index in the family.
    """
    candidates = _projector_candidates(ready.scene, partial, first_face, member)
    views, samples, measured = _camera_candidates(
        ready.scene, partial, first_face, member
    )
    return _needs(ready, partial, candidates, views, samples, measured)


def outsider_needs(
    ready: Prepared, partial: PartialPlan, draws: tuple[Target, Target]
) -> MemberNeeds:
    """Return the same of a member that the family's rig needn't serve.

    Its samples are those of `draws`, for projectors and cameras. Rings that light none
    of the members served don't light it either.
    """
    scene, shown = ready.scene, partial.final_projectors
    candidates = CandidateSet.over(scene, draws[0], partial.stage.reference)
    among = scene.among(shown)
    views = CandidateViews(among, partial.camera_stage.reference)
    samples, measured = measured_of(among, shown, views, draws[1])
    return _needs(ready, partial, candidates, views, samples, measured)


def _needs(
    ready: Prepared,
    partial: PartialPlan,
    candidates: CandidateSet,
    views: CandidateViews,
    samples: LitSamples,
    measured: np.ndarray,
) -> MemberNeeds:
    chosen = _places(partial.stage.projectors, candidates.projectors)
    own = select_fewest(candidates.cover, known=chosen, budget=_BUDGET)
    weight = candidates.samples.samples.weight
    proof = _certificate(candidates.cover, own, weight, candidates.projectors)
    stage = ProjectorStage({}, proof, partial.projectors, candidates)
    scene = ready.scene.among(partial.projectors)
    cover = candidate_cover(scene, measured, samples, views.cameras)
    chosen = _places(partial.camera_stage.cover.cameras, views.cameras)
    fewest = (
        select_fewest(cover, known=chosen, budget=_BUDGET)
        if measured.any()
        else unsought(cover)
    )
    weight = samples.target.samples.weight
    own_proof = _certificate(cover, fewest, weight, views.cameras)
    return MemberNeeds(
        stage,
        CameraStage(
            {},
            own_proof,
            partial.cameras,
            CameraCover(views, samples, measured, fewest),
        ),
    )


def member_partial(
    ready: Prepared, partial: PartialPlan, needs: MemberNeeds
) -> PartialPlan:
    """Return the family's rig before one member, as a plan of this mesh alone."""
    projectors, cameras = partial.final_projectors, partial.cameras
    rings = None if partial.rings is None else partial.rings.on(ready.scene)
    stage, views = needs.projectors, needs.cameras
    lights = _places(partial.stage.projectors, stage.candidates.projectors)
    sights = _places(partial.camera_stage.cover.cameras, views.reference)
    lit_m2 = _area_m2(stage.candidates.lit[:, lights], stage.candidates.samples)
    seen = views.cover.measured[:, sights]
    measured_m2 = _area_m2(seen, views.cover.samples.target)
    return replace(
        partial,
        ready=ready,
        stage=replace(
            stage,
            by_count={len(projectors): projectors},
            certificate=_of_count(stage.certificate, len(projectors), lit_m2),
        ),
        camera_stage=replace(
            views,
            by_count={len(cameras): cameras},
            certificate=_of_count(views.certificate, len(cameras), measured_m2),
            cameras=cameras,
        ),
        rings=rings,
    )


def _projector_candidates(
    scene: Scene, partial: PartialPlan, first_face: int, member: int
) -> CandidateSet:
    every = partial.stage.candidates
    rows = np.flatnonzero(every.samples.member == member)
    area = _target_area(scene)
    own = _own(every.samples.take(rows), first_face, area / max(len(rows), 1))
    return CandidateSet(scene, own, every.projectors, every.stages[rows], 0)


def _camera_candidates(
    scene: Scene, partial: PartialPlan, first_face: int, member: int
) -> tuple[CandidateViews, LitSamples, np.ndarray]:
    cover, family = partial.camera_stage.cover, partial.scene
    rows = np.flatnonzero(cover.samples.target.member == member)
    mean = np.mean([_target_area(one) for one in family.surfaces])
    weight = cover.samples.target.samples.weight * _target_area(scene) / float(mean)
    lit = taken(cover.samples, rows, cover.samples.lit)
    lit = replace(lit, target=_own(lit.target, first_face, weight))
    views = CandidateViews(scene.among(partial.projectors), cover.candidates.cameras)
    return views, lit, cover.measured[rows]


def _own(target: Target, first_face: int, weight: float) -> Target:
    """Return samples of a member as those of a mesh alone."""
    samples = replace(
        target.samples, faces=target.samples.faces - first_face, weight=weight
    )
    return Target(samples, target.steep)


def _target_area(scene: Scene) -> float:
    return float(scene.mesh.face_areas[scene.target_faces].sum())


def _places(devices: Sequence[object], among: Sequence[object]) -> np.ndarray:
    """Return where devices stand among candidates; those that don't are left out."""
    place = {id(one): k for k, one in enumerate(among)}
    known = [place[id(one)] for one in devices if id(one) in place]
    return np.array(sorted(known), dtype=np.int64)


def _certificate(
    cover: CandidateCover,
    own: Selection,
    sample_area_m2: float,
    candidates: Sequence[Device],
) -> Certificate:
    """What was proved of the candidates that a member takes for itself."""
    reached = int(np.any(cover.covers, axis=1).sum()) * sample_area_m2
    proof = Certificate(
        count=own.needed,
        status="optimal" if own.lower_bound >= own.needed else "feasible",
        required_m2=own.required * sample_area_m2,
        n_samples=len(cover.covers),
        candidates=CandidateBound(
            lower_bound=own.lower_bound,
            n_candidates=cover.covers.shape[1],
            proof=own.proof,
        ),
        continuous=None,
        greedy_count=own.needed,
        needed=NeededCount(count=own.needed, lower_bound=own.lower_bound),
        best_area=BestArea(
            value_m2=cover.n_covered(own.smallest) * sample_area_m2,
            upper_bound_m2=reached,
        ),
        one_fewer=OneFewer(upper_bound_m2=reached),
    )
    return proof.changed(**bodies_left_out(candidates))


def _of_count(proof: Certificate, count: int, found_m2: float) -> Certificate:
    """What a member's certificate is of as many devices as the family has.

    Of these, those that stand at candidates cover `found_m2`.
    """
    least, needed, best = proof.candidates.lower_bound, proof.needed.count, {}
    # Where so many are proved too few, they fall short by a sample at least.
    short = OneFewer(upper_bound_m2=proof.required_m2 * (1.0 - 1e-6))
    status = "optimal" if least >= count else "feasible"
    if needed > count:
        most = short if least > count else proof.best_area
        area = BestArea(value_m2=found_m2, upper_bound_m2=most.upper_bound_m2)
        status, best = "infeasible", {"best_area": area}
    return proof.changed(
        count=count,
        status=status,
        candidates=proof.candidates.changed(lower_bound=min(least, count)),
        greedy_count=max(count, proof.greedy_count),
        needed=NeededCount(count=max(needed, count), lower_bound=least),
        one_fewer=short if least >= count else proof.one_fewer,
        alone=needed,
        **best,
    )


def _area_m2(covers: np.ndarray, samples: Target) -> float:
    """Area of the samples that any device covers; shape (n, n_devices)."""
    return int(np.any(covers, axis=1).sum()) * samples.samples.weight
