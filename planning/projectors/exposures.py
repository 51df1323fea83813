"""How long frames are exposed: one time for each projector, for all cameras alike.

Cameras are triggered by the projector that shines, all at once, and wait for whole
refreshes of its image; how bright surface is depends on the projector's place and
light, not on which camera looks. So exposures are planned before there are cameras.
"""

from collections.abc import Sequence
from dataclasses import replace

from planning.model.devices.planned import PlannedProjector
from planning.scene.codes.patterns import panel_light
from planning.scene.draws import DRAWS
from planning.scene.lighting import light_on, lit_stages
from planning.scene.limits.light_terms import electrons
from planning.scene.limits.projector_limits import LIT
from planning.scene.scene import Scene


def with_exposures(
    scene: Scene, projectors: Sequence[PlannedProjector]
) -> tuple[PlannedProjector, ...]:
    """Return projectors with the longest exposures under which nothing lit clips.

    Of the target, where it is brightest; one refresh at least. As they are where the
    rig says nothing of light.
    """
    light = scene.requirements.triangulation.light
    if light is None:
        return tuple(projectors)
    target = scene.target_samples(DRAWS.projectors)
    lit = lit_stages(scene, projectors, target) == LIT
    planned: list[PlannedProjector] = []
    for projector, column in zip(projectors, lit.T, strict=True):
        some = target.take(column)
        *_, lux = panel_light(projector, some.samples.points)
        bright, _ = electrons(light, lux * light_on(projector, some).incidence_cos, 1.0)
        most = float(bright.max(initial=0.0)) * light.albedo[1]
        time = light.exposure_s(most * light.grey_per_electron)
        planned.append(replace(projector, exposure_s=time))
    return tuple(planned)
