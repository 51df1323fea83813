"""How the limits of a rig file may give way, one at a time."""

import numpy as np

from geometry.devices import DeviceModel, PinholeModel
from planning.model.requirements import Requirements
from planning.rig import optics
from planning.rig.rig import Rig
from planning.rig.rig_tables import PinholeTable
from planning.rings.ring_radii import ring_gap
from planning.scene.limits.limit import Array, Focus, LimitRelaxation, RigFacts
from planning.scene.limits.pair_limits import MEASURED_LIMITS
from planning.scene.limits.projector_limits import PROJECTOR_LIMITS

# Two ends of a range agree if they were computed from the same focus [m].
_SAME_M = 1e-6


def relaxations_of_projectors(
    required: Requirements, device: DeviceModel
) -> tuple[LimitRelaxation, ...]:
    """Return every way in which a limit of the projectors may give way."""
    facts = RigFacts(required, device)
    return tuple(r for limit in PROJECTOR_LIMITS for r in limit.relaxations(facts))


def relaxations_of_cameras(
    rig: Rig, required: Requirements
) -> tuple[LimitRelaxation, ...]:
    """Return every way in which a limit of the cameras or of pairs may give way.

    Args:
        rig: As written: how sharpness and rings came about.
        required: The limits.
    """
    device, limits = rig.camera_device(), required.triangulation
    gap = rig.ring_gap_m or ring_gap(
        rig.projector_device(), device, limits, rig.standoff_m
    )
    focus = _focus(rig.table.camera, device)
    facts = RigFacts(required, device, focus, gap, rig.ring_gap_m is None)
    return tuple(r for limit in MEASURED_LIMITS for r in limit.relaxations(facts))


def _focus(table: PinholeTable, device: PinholeModel) -> Focus | None:
    """The blur that counts as sharp, where the range follows from it."""
    if table.focus is None or table.pixel_um is None:
        return None
    pixel, at = 1e-6 * table.pixel_um, 1e-3 * table.focus.distance_mm
    number, blur = table.focus.f_number, table.focus.blur_px
    focal = device.focal_px * pixel
    low, high = table.range_mm or (0.0, np.inf)
    allowed = 1e-3 * low, 1e-3 * high
    near, far = optics.depth_of_field(focal, number, blur * pixel, at)
    sharp = max(near, allowed[0]), min(far, allowed[1])
    if not np.allclose(sharp, device.range_m, rtol=0.0, atol=_SAME_M):
        return None

    def circle(distances: Array) -> Array:
        return optics.blur_diameter(focal, number, at, distances) / pixel

    return Focus(blur, number, allowed, circle)
