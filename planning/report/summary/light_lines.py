"""What a plan says of light, for a person."""

import math

from planning.model.document.device_records import GreySample, ProjectorRecord
from planning.model.light.light_budget import SATURATED, LightBudget
from planning.model.plan import RigPlan
from planning.model.words import count_words, labelled


def light_lines(plan: RigPlan) -> list[str]:
    """Return exposures and grey levels at the extremes, or that light isn't counted."""
    light = plan.requirements.triangulation.light
    if light is None:
        return ["LIGHT    not counted: the rig states no [photometry]"]
    low, high = light.albedo
    surface = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    head = (
        f"{light.lumens:g} lm, {light.room_lux:g} lux of the room, "
        f"f/{light.f_number:g}, albedo {surface}; grey levels of 255, lit and dark:"
    )
    lines = [head, *(_line(p, light) for p in plan.document.projectors)]
    return labelled("LIGHT", lines)


def _line(record: ProjectorRecord, light: LightBudget) -> str:
    exposure = record.exposure
    if exposure is None:
        return f"{record.id}   no exposure was planned"
    words = f"{record.id}   exposed {1e3 * exposure.exposure_s:.1f} ms"
    if light.period_s is not None:
        n = round(exposure.exposure_s / light.period_s)
        words += f" ({count_words(n, 'refresh')})".replace("refreshs", "refreshes")
    if (grey := exposure.farthest) is not None:
        words += f"; farthest sample, {1e3 * grey.distance_m:.0f} mm, {_greys(grey)}"
    if (grey := exposure.most_grazing) is not None:
        angle = math.degrees(grey.incidence)
        words += f"; most grazing, {angle:.1f} deg, {_greys(grey)}"
    if (grey := exposure.brightest) is not None:
        words += f"; brightest {_greys(grey)}"
        if grey.lit[1] >= SATURATED:
            words += ", CLIPPED: a narrower aperture or less light"
    return words


def _greys(grey: GreySample) -> str:
    return " and ".join(
        f"{low:.0f}" if low == high else f"{low:.0f} to {high:.0f}"
        for low, high in (grey.lit, grey.dark)
    )
