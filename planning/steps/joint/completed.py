"""Turns devices that were chosen together into a plan with rings, proofs and claims."""

from dataclasses import dataclass, replace

import numpy as np

from planning.cameras.axis_choice import place_for_axes
from planning.cameras.camera_cover import NothingMeasuredError, plan_cameras
from planning.cameras.proved_cameras import CameraStage, camera_stage
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.input_records import RigRecord
from planning.projectors.candidate_set import CandidateSet
from planning.projectors.exposures import with_exposures
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs import projector_bound
from planning.proofs.candidate_certificate import counted
from planning.proofs.selection import select_fewest
from planning.report.partial_plan import PartialPlan
from planning.rings.kept_pairs import rings_for_pairs

Projectors = tuple[PlannedProjector, ...]
Cameras = tuple[PlannedCamera, ...]


@dataclass(frozen=True)
class Costs:
    """What devices cost, by the rig."""

    rig: RigRecord

    def projectors(self, devices: Projectors) -> float:
        """Return the cost of projectors."""
        return sum(self.rig.cost_of("projector", one.model) for one in devices)

    def cameras(self, devices: Cameras) -> float:
        """Return the cost of cameras."""
        return sum(self.rig.cost_of("camera", one.model) for one in devices)

    def both(self, projectors: Projectors, cameras: Cameras) -> float:
        """Return the cost of devices of both kinds."""
        return self.projectors(projectors) + self.cameras(cameras)


def with_cameras_for(
    partial: PartialPlan,
    projectors: Projectors,
    cameras: Cameras,
    costs: Costs,
    below: float,
) -> PartialPlan | None:
    """Return the plan with other projectors, and cameras for them.

    These are the fewest of all candidates, which fresh samples confirm, if with them
    all costs less than `below`; else the cameras given. None where nothing is measured.
    """
    request = partial.request
    stage = projector_stage(partial, projectors)
    if stage is None:
        return None
    projectors = with_exposures(partial.scene, projectors)
    try:
        solution = place_for_axes(
            partial.scene.among(projectors),
            projectors,
            partial.camera_stage.cover.candidates,
            "cover",
            axis=partial.axes,
            margin=request.ring_margin,
        )
    except NothingMeasuredError:
        return None
    fewest = solution.stage
    met = fewest.certificate.status != "infeasible"
    if not (met and costs.both(projectors, fewest.cameras) < below):
        return with_devices(partial, projectors, cameras)
    return PartialPlan(
        partial.ready,
        stage,
        solution.projectors,
        fewest,
        fewest.cameras,
        axes=solution.axes,
    )


def with_devices(
    partial: PartialPlan, projectors: Projectors, cameras: Cameras
) -> PartialPlan | None:
    """Return the plan with other devices as they stand, with rings for them.

    What is proved is proved again for these projectors. None where nothing is measured.
    """
    request = partial.request
    stage = projector_stage(partial, projectors)
    projectors = with_exposures(partial.scene, projectors)
    views = cameras_proved(partial, projectors, cameras) if stage else None
    if stage is None or views is None:
        return None
    rings = None
    if request.ring_axis is not None:
        rings = rings_for_pairs(
            partial.scene.among((*projectors, *cameras)),
            projectors,
            cameras,
            request.rig.rings.spacing,
            views.cover.samples,
            margin=request.ring_margin,
        )
    return PartialPlan(
        partial.ready,
        stage,
        projectors,
        views,
        cameras,
        axes=partial.axes,
        rings=rings,
    )


def projector_stage(
    partial: PartialPlan, projectors: Projectors
) -> ProjectorStage | None:
    """Return the stage of other projectors, with what is proved of their number.

    Fewer than the fewest candidates join these; None where they light too little of
    the stage's samples.
    """
    stage = partial.stage
    reached = stage.candidates.reached.sum()
    area = float(reached) * stage.candidates.samples.samples.weight
    if len(projectors) >= stage.certificate.needed.count:
        return counted(replace(stage, projectors=projectors), projectors, area)
    before = stage.candidates
    candidates = before.joined(
        CandidateSet.over(before.scene, before.samples, projectors)
    )
    known = len(before.projectors) + np.arange(len(projectors))
    selection = select_fewest(candidates.cover, known=known)
    if selection.status == "infeasible" or selection.needed > len(projectors):
        return None
    ready, request = partial.ready, partial.request
    effort = projector_bound.PROVE if request.prove else projector_bound.DEFAULT
    stage = ProjectorStage.over(candidates, selection)
    proved = prove_fewest(partial.scene, stage, ready.templates, effort)
    if len(proved.projectors) == len(projectors):
        stage = proved
    return counted(replace(stage, projectors=projectors), projectors, area)


def cameras_proved(
    partial: PartialPlan, projectors: Projectors, cameras: Cameras
) -> CameraStage | None:
    """Return the stage of cameras as they stand, with what is proved of their number.

    Where they are fewer than any candidates for these projectors, they join these; None
    where they measure too little of the stage's samples.
    """
    scene = partial.scene.among(projectors)
    views = partial.camera_stage.cover.candidates
    try:
        cover = plan_cameras(scene, projectors, views)
        if len(cameras) < cover.selection.needed:
            known = len(views.cameras) + np.arange(len(cameras))
            cover = plan_cameras(scene, projectors, views.joined(cameras), known)
    except NothingMeasuredError:
        return None
    if len(cameras) < cover.selection.needed:
        return None
    stage = camera_stage(scene, cover)
    area = cover.measured.any(axis=1).sum() * cover.samples.target.samples.weight
    return counted(replace(stage, cameras=cameras), cameras, float(area))
