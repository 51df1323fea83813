"""Tables of a plan: frames where pandas is there, else plain rows."""

from collections.abc import Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from planning.model.plan import RigPlan
from planning.report.summary.devices.device_lines import standing
from planning.scene.placed_bodies import kind_of

# A pandas.DataFrame, else a list of rows.
Table = Any
Row = dict[str, Any]
_CM2 = 1e4
# What `standing` yields, but for the distance.
_STANDING = (
    *("x_mm", "y_mm", "z_mm", "pan_deg", "tilt_deg", "roll_deg"),
    *("azimuth_deg", "elevation_deg"),
)


def table(rows: Sequence[Row]) -> Table:
    """Return rows as a pandas frame, or as they are where pandas is missing."""
    if find_spec("pandas") is None:
        return list(rows)
    return import_module("pandas").DataFrame(list(rows))


def device_rows(plan: RigPlan) -> list[Row]:
    """Return where devices stand [mm] and how they are turned [degrees]."""
    areas = {p.id: p.lit_area_m2 for p in plan.document.projectors}
    areas |= {c.id: c.seen_area_m2 for c in plan.document.cameras}
    return [
        {"id": device.id, "kind": kind_of(device)}
        | dict(zip(_STANDING, numbers[:-1], strict=True))
        | {"area_cm2": _CM2 * areas[device.id], "existing": device.existing}
        for device, numbers in standing(plan)
    ]


def coverage_rows(plan: RigPlan) -> list[Row]:
    """Return the areas of target and surface, a row each [cm²]."""
    named = {"target": plan.coverage.target, "surface": plan.coverage.surface}
    return [
        {"of": name}
        | {key.replace("_m2", "_cm2"): _CM2 * area for key, area in dict(areas).items()}
        for name, areas in named.items()
    ]


def region_rows(plan: RigPlan) -> list[Row]:
    """Return the dominant regions; None where nothing of one can be reached."""
    return list(_regions(plan))


def _regions(plan: RigPlan) -> Iterator[Row]:
    for region in plan.document.regions:
        areas, row = region.coverage, {"id": region.id}
        row |= {"area_cm2": _CM2 * region.area_m2}
        row |= {"cone_deg": float(np.degrees(region.cone_angle))}
        row |= {"lit_by": " ".join(region.lit_by)}
        if areas is not None:
            row |= {
                "measured_by": " ".join(areas.measured_by),
                "lit": _share(areas.lit_m2, areas.reachable_by_projectors_m2),
                "measured": _share(areas.measured_m2, areas.reachable_by_cameras_m2),
                "floor": areas.floor,
            }
        yield row


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole > 0.0 else None
