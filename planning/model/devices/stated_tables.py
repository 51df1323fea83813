"""What a plan's copy of a rig's tables must hold, so that anyone can compute with it.

Whether it is true is another question. Keys that aren't known are kept.
"""

import json
from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    ValidationError,
    model_validator,
)

from planning.model.light.dense_code import DenseCode
from planning.model.light.photometry_table import PhotometryTable
from planning.model.table_types import Positive

from .bodies import Triple

# Length below which a vector is no direction.
_NO_DIRECTION = 1e-9
_MOST_SHOWN = 60


def _is_direction(vector: Triple) -> Triple:
    if not max(map(abs, vector)) > _NO_DIRECTION:
        raise ValueError("should be a direction")
    return vector


_Direction = Annotated[Triple, AfterValidator(_is_direction)]


class _Stated(BaseModel):
    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)


class _Zone(_Stated):
    name: str
    centre_mm: Triple
    size_mm: Triple
    turn_deg: Triple
    blocks: bool = True


class _Plane(_Stated):
    name: str
    centre_mm: Triple
    normal: _Direction
    extent_mm: tuple[Positive, Positive]
    along: _Direction | None = None
    thickness_mm: Positive


class _Workspace(_Stated):
    axis: _Direction | None = None
    half_angle_deg: float | None = None
    floor_mm: float | None = None
    min_mm: Triple | None = None
    max_mm: Triple | None = None
    keep_out: tuple[_Zone, ...] = ()
    mounting: tuple[_Plane, ...] = ()

    @model_validator(mode="after")
    def _has_both_corners(self) -> Self:
        if (self.min_mm is None) is not (self.max_mm is None):
            raise ValueError("should have min_mm and max_mm, or neither")
        return self


class _Dense(_Stated):
    shifts: int
    period_px: int
    phase_noise_deg: float

    @model_validator(mode="after")
    def _is_code(self) -> Self:
        DenseCode(self.shifts, self.period_px)
        return self


class _Rings(_Stated):
    tilt: float | None = None
    shift_m: float | None = None
    gap_m: float | None = None
    margin_m: float = 0.0
    outer_radius: float | None = None


class _Calibration(_Stated):
    angle_deg: float | None = None
    position_mm: float | None = None
    focal_percent: float | None = None
    principal_px: float | None = None


_TABLES: Mapping[str, type[BaseModel]] = {
    "workspace": _Workspace,
    "rings": _Rings,
    "calibration": _Calibration,
    "dense": _Dense,
    "photometry": PhotometryTable,
}
STATED_TABLES = tuple(_TABLES)


def check_stated(name: str, table: Mapping[str, object]) -> None:
    """Refuse a table, of `STATED_TABLES`, that holds what none can compute with.

    Raises:
        ValueError: It names the first fault: where, what is written, and the rule.
    """
    try:
        _TABLES[name].model_validate_json(json.dumps(table), strict=True)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
    else:
        return
    where = ".".join(map(str, (name, *fault["loc"])))
    if fault["type"] == "missing":
        raise ValueError(f"{where} is missing")
    value = repr(fault["input"])
    value = value if len(value) <= _MOST_SHOWN else f"{value[: _MOST_SHOWN - 3]}..."
    rule = fault["msg"].removeprefix("Value error, ").removeprefix("Input ")
    raise ValueError(f"{where} = {value} {rule}")
