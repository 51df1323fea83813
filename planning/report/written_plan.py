"""Scene and devices of a plan that was written: what its claims were computed on."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from planning.model.devices.device_poses import DECIMALS, moved_to
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.input_records import ModelRecord
from planning.model.plan import RigPlan
from planning.scene.placed_bodies import Obstruction
from planning.scene.scene import Scene

from .claims.judged import Devices

_D = TypeVar("_D", PlannedProjector, PlannedCamera)


def written_scene(plan: RigPlan, *, threads: int) -> Scene:
    """Return the surface and the requirements of a plan."""
    surface = plan.surface
    return Scene(
        surface.mesh,
        surface.region,
        surface.steep,
        plan.requirements,
        plan.document.seed,
        threads,
        obstructions=Obstruction.about(surface.mesh, surface.obstacles, threads),
    )


def written_devices(plan: RigPlan) -> Devices:
    """Return a plan's devices, and what stands at its reference poses."""
    surface, workspace = plan.surface, plan.requirements.workspace
    rig = plan.document.rig
    widest = np.round([workspace.reference_ring_radius], DECIMALS)
    lit = templates_of(plan.projectors, rig.models("projector"))
    views = templates_of(plan.cameras, rig.models("camera"))
    poses = zip(
        surface.reference_projectors,
        surface.reference_rings,
        surface.models_of("projector"),
        strict=True,
    )
    cameras = zip(surface.reference_cameras, surface.models_of("camera"), strict=True)
    return Devices(
        plan.projectors,
        plan.cameras,
        tuple(
            replace(
                lit[model],
                world_from_device=pose,
                world_from_ring=ring,
                ring_radii=widest,
            )
            for pose, ring, model in poses
        ),
        tuple(moved_to(views[model], pose) for pose, model in cameras),
    )


def templates_of(devices: Sequence[_D], models: Sequence[ModelRecord]) -> list[_D]:
    """Return a device of each model that stands nowhere; the plan may hold none."""
    like = replace(devices[0], existing="")
    if len(models) == 1:
        return [like]
    return [
        replace(like, device=model.optics, body=model.body, model=model.name)
        for model in models
    ]
