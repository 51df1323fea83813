"""What frames are exposed for, and how bright the plainest extremes come out."""

import numpy as np

from planning.model.devices.planned import PlannedProjector
from planning.model.document.device_records import ExposureRecord, GreySample
from planning.model.light.light_budget import LightBudget
from planning.report.claims.claims import Claims
from planning.report.claims.judged import Devices
from planning.scene.codes.patterns import panel_light
from planning.scene.lighting import (
    assigned_projectors,
    light_on,
    lit_margins,
    lit_stages,
)
from planning.scene.limits.light_terms import electrons
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import Target
from planning.scene.scene import Scene


def exposure_records(
    scene: Scene, devices: Devices, claims: Claims
) -> list[dict[str, ExposureRecord]]:
    """Return `exposure` of each projector; no key where nothing is said of light."""
    light, target = scene.requirements.triangulation.light, claims.target_samples
    if light is None:
        return [{} for _ in devices.projectors]
    lit = lit_stages(scene, devices.projectors, target) == LIT
    margin = lit_margins(scene, devices.projectors, target)
    primary = assigned_projectors(lit, margin)
    return [
        {"exposure": _record(light, projector, target.take(primary == p))}
        for p, projector in enumerate(devices.projectors)
    ]


def _record(
    light: LightBudget, projector: PlannedProjector, samples: Target
) -> ExposureRecord:
    time = projector.exposure_s or 0.0
    if not len(samples):
        return ExposureRecord(exposure_s=time)
    on = light_on(projector, samples)
    *_, lux = panel_light(projector, samples.samples.points)
    grey = np.stack(electrons(light, lux * on.incidence_cos, time))
    grey *= light.grey_per_electron
    distances = np.linalg.norm(on.offsets, axis=1)

    def told(index: int) -> GreySample:
        bright, dark = (np.array(light.albedo) * grey[:, index, None]).tolist()
        return GreySample(
            point_m=samples.samples.points[index].tolist(),
            normal=samples.samples.normals[index].tolist(),
            distance_m=float(distances[index]),
            incidence=float(np.arccos(min(on.incidence_cos[index], 1.0))),
            lit=tuple(bright),
            dark=tuple(dark),
        )

    return ExposureRecord(
        exposure_s=time,
        farthest=told(int(distances.argmax())),
        most_grazing=told(int(on.incidence_cos.argmin())),
        brightest=told(int(grey[0].argmax())),
    )
