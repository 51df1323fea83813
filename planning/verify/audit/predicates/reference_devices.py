"""The reference poses as the audit sees them, each with the optics of its model."""

import numpy as np

from geometry.devices import ParallelModel, PinholeModel
from planning.model.plan import RigPlan

from .audit_devices import AuditCamera, AuditProjector
from .occlusion import bodies_about


def reference_projectors(plan: RigPlan) -> tuple[AuditProjector, ...]:
    """Return the reference projectors: each pose with the optics of its model."""
    if not plan.projectors:
        return ()
    last = np.array([plan.requirements.workspace.reference_ring_radius])
    devices, surface = optics_of(plan, "projector"), plan.surface
    poses = zip(
        surface.reference_projectors,
        surface.reference_rings,
        surface.models_of("projector"),
        strict=True,
    )
    stations = _stations(plan, len(surface.reference_projectors))
    return tuple(
        AuditProjector(
            *(devices[model], pose, ring, last),
            bodies_about(plan, "projector", pose),
            code=plan.projectors[0].code,
            station=station,
        )
        for station, (pose, ring, model) in zip(stations, poses, strict=True)
    )


def _stations(plan: RigPlan, n_devices: int) -> list[str]:
    """Names of the reference heads that so many devices belong to, one head's first.

    Empty where the plan has none: then each reference device measures with any.
    """
    stations = plan.document.stations
    heads = 0 if stations is None else stations.n_reference
    if not heads:
        return [""] * n_devices
    return [f"reference {k * heads // n_devices}" for k in range(n_devices)]


def optics_of(plan: RigPlan, kind: str) -> list[PinholeModel | ParallelModel]:
    """Return the optics of each model of a kind."""
    models, devices = plan.document.rig.models(kind), getattr(plan, f"{kind}s")
    # Of one, the plan's own device: its model is audited against it.
    return [m.optics for m in models] if len(models) > 1 else [devices[0].device]


def reference_cameras(plan: RigPlan) -> tuple[AuditCamera, ...]:
    """Return the reference cameras: each pose with the optics of its model."""
    if not plan.cameras:
        return ()
    devices, surface = optics_of(plan, "camera"), plan.surface
    poses = zip(surface.reference_cameras, surface.models_of("camera"), strict=True)
    stations = _stations(plan, len(surface.reference_cameras))
    return tuple(
        AuditCamera(devices[model], pose, bodies_about(plan, "camera", pose), station)
        for station, (pose, model) in zip(stations, poses, strict=True)
    )
