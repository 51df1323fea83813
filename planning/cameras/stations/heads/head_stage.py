"""Heads of a plan as stages of their projectors and cameras, and their bound."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planning.cameras.camera_cover import CameraCover, candidate_cover
from planning.cameras.proved_cameras import CameraStage
from planning.model.devices.planned import PlannedProjector
from planning.model.document.certificates import NeededCount
from planning.projectors.candidate_set import CandidateSet
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.all_poses import BoundQuestion, Effort
from planning.proofs.candidate_certificate import unproved, unsought
from planning.proofs.projector_bound import bound_projectors
from planning.proofs.quotas import RegionFloors
from planning.proofs.selection import fewest_count
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.measuring.measured import LitSamples, measured_by
from planning.scene.scene import Scene

from .head_poses import PlacedHead


def stages_of(
    scene: Scene, planned: Sequence[PlacedHead], reference: Sequence[PlacedHead]
) -> tuple[ProjectorStage, CameraStage]:
    """Return the devices of heads as stages of which nothing is proved.

    What is proved is of heads. After the planned ones stand those of the reference set,
    each of which measures by itself. Samples are none that heads or steps were
    fitted to: of those more is lit than of others.
    """
    heads = [*planned, *reference]
    projectors = tuple(p for head in heads for p in head.projectors)
    cameras = tuple(c for head in heads for c in head.cameras)
    n_projectors = sum(len(head.projectors) for head in planned)
    n_cameras = sum(len(head.cameras) for head in planned)
    target = scene.target_samples(DRAWS.projectors)
    stages = lit_stages(scene, projectors, target)
    candidates = CandidateSet(scene, target, projectors, stages, n_projectors)
    proof = unproved(candidates.cover, target.samples.weight).changed(given=0)
    lights = ProjectorStage(
        {n_projectors: projectors[:n_projectors]},
        proof,
        projectors[:n_projectors],
        candidates,
    )
    # Reference cameras without a station measure with the planned projectors alone.
    lamps = tuple(p for k, p in enumerate(projectors) if k < n_projectors or p.station)
    lit = lit_stages(scene, lamps, target) == LIT
    bright = np.flatnonzero(lit[:, :n_projectors].any(axis=1))
    samples = LitSamples.of(lamps, target.take(bright), lit[bright])
    views = CandidateViews(scene, cameras)
    seen = views.on(samples.target)
    # One without a station would measure with projectors of every station, and with one
    # that has none every camera would.
    measured = np.zeros((len(bright), len(cameras)), dtype=bool)
    at_stations = np.array([bool(lamp.station) for lamp in lamps])
    planned_ones = np.arange(len(lamps)) < n_projectors
    for stationed in {bool(camera.station) for camera in cameras}:
        counts = at_stations if stationed else planned_ones
        by = replace(samples, lit=samples.lit & counts)
        some = [k for k, c in enumerate(cameras) if bool(c.station) is stationed]
        those, theirs = [cameras[k] for k in some], [seen[k] for k in some]
        measured[:, some] = measured_by(scene, those, by, theirs)
    cover = candidate_cover(scene, measured, samples, cameras)
    cover = replace(cover, n_existing=n_cameras)
    proof = unproved(cover, target.samples.weight).changed(given=0)
    return lights, CameraStage(
        {n_cameras: cameras[:n_cameras]},
        proof,
        cameras[:n_cameras],
        CameraCover(views, samples, measured, unsought(cover)),
    )


def least_by_light(
    scene: Scene,
    heads: Sequence[PlacedHead],
    templates: tuple[PlannedProjector, ...],
    effort: Effort,
) -> int:
    """Return how many heads it takes at least, wherever they stand.

    As many projectors as light enough anywhere in the workspace, shared out among
    heads.
    """
    projectors = tuple(p for head in heads for p in head.projectors)
    target = scene.target_samples(DRAWS.projectors)
    target = target.take(
        np.arange(min(len(target), effort.most_samples or len(target)))
    )
    candidates = CandidateSet.over(scene, target, projectors)
    count, area = fewest_count(candidates.cover), target.samples.weight * len(target)
    proof = unproved(candidates.cover, target.samples.weight)
    proof = proof.changed(given=0, needed=NeededCount(count=count, lower_bound=0))
    reached = candidates.reached
    question = BoundQuestion.about(
        proof,
        reached,
        np.zeros(len(target), dtype=bool),
        scene.requirements.dominant_coverage,
        area,
        RegionFloors.of(scene, target),
    )
    wanted = target.take(np.flatnonzero(reached))
    bound = bound_projectors(scene, templates, wanted, question, effort).proof()
    return -(-bound.lower_bound // len(heads[0].projectors))
