"""A rig's limits, tightened by two standard deviations of where the object is.

A plan for the least-squares body then holds for a body that is anywhere within them:
devices keep their play, stay sharp and meet the surface no more obliquely than the rig
allows.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

from planning.model.errors import InfeasibleLimitsError
from planning.scene.ranges.ranged_body import RangedBody

from .rig import Rig
from .rig_tables import RigTable

_SIGMAS = 2.0
_SOURCE = "distances that are sharp, less two standard deviations of --ranges"


@dataclass(frozen=True)
class Guard:
    """What was kept free, and limits as the rig states them, in metres and radians."""

    sigma_m: float
    # Two sigma, and what a surface moved by it changes of an incidence at most.
    length_m: float
    angle_rad: float
    stated: dict[str, Any]


def guarded(rig: Rig, body: RangedBody) -> tuple[Rig, Guard]:
    """Return a rig with limits tightened by what isn't known of a body, and by what.

    ::

        play' = play - 2 sigma,   range' = [near + 2 sigma, far - 2 sigma]
        incidence' = incidence - asin(2 sigma / (standoff - play))

    Raises:
        InfeasibleLimitsError: If a limit is used up: the ranges are known too badly.
    """
    sigma = body.position_sigma_m
    length = _SIGMAS * sigma
    nearest = rig.standoff_m - rig.standoff_play_m
    play = f"placement.standoff_play_mm is {1e3 * rig.standoff_play_m:g}"
    _require(length <= rig.standoff_play_m, body, length, play)
    _require(length < nearest, body, length, "devices stand no nearer than that")
    angle = math.asin(length / nearest)
    limits = rig.table.limits
    stated = {
        "standoff_play_m": rig.standoff_play_m,
        "projector.range_m": list(rig.projector_device().range_m),
        "camera.range_m": list(rig.camera_device().range_m),
        "projector.max_incidence": math.radians(limits.projector_max_incidence_deg),
        "camera.max_incidence": math.radians(limits.camera_max_incidence_deg),
    }
    tight = replace(rig, table=_tightened(rig, body, length, math.degrees(angle)))
    return tight, Guard(sigma, length, angle, stated)


def _tightened(rig: Rig, body: RangedBody, length: float, angle_deg: float) -> RigTable:
    table, limits = rig.table, rig.table.limits
    incidences: dict[str, float] = {}
    for name in ("projector_max_incidence_deg", "camera_max_incidence_deg"):
        stated = getattr(limits, name)
        incidences[name] = stated - angle_deg
        rule = f"limits.{name} = {stated:g} leaves no room for it"
        _require(incidences[name] > 0.0, body, length, rule)
    play = table.placement.standoff_play_mm - 1e3 * length
    devices = {
        "camera": rig.camera_device(),
        rig.projector_key: rig.projector_device(),
    }
    update: dict[str, Any] = {
        "placement": table.placement.model_copy(update={"standoff_play_mm": play}),
        "limits": limits.model_copy(update=incidences),
    }
    for key, device in devices.items():
        # A device that is trusted to be sharp over less than it is.
        named = getattr(table, key)
        low, high = device.range_m[0] + length, device.range_m[1] - length
        near, far = (1e3 * end for end in device.range_m)
        rule = (
            f"{named.name} is sharp from {near:.0f} to {far:.0f} mm, and the standoff "
            f"is {1e3 * rig.standoff_m:.0f} mm"
        )
        _require(low <= rig.standoff_m <= high, body, length, rule)
        sharp = {
            "range_mm": [1e3 * low, 1e3 * high],
            "sources": named.sources | {"range_mm": _SOURCE},
        }
        update[key] = named.model_copy(update=sharp)
    return table.model_copy(update=update)


def _require(holds: bool, body: RangedBody, length: float, limit: str) -> None:
    """Refuse a body that is known too badly for a limit."""
    if holds:
        return
    x, y, z = body.least_known
    bumps = 1e3 * body.ball.shape_sigma
    raise InfeasibleLimitsError(
        f"{body.file.path}: the surface is known to +-{1e3 * length:.1f} mm (two "
        f"standard deviations; {bumps:.1f} mm is how far one point strays from a "
        f"sphere), and {limit}; observe more points, most of all from the side "
        f"({x:.2f}, {y:.2f}, {z:.2f}), or give the rig more room"
    )
