"""What projectors show: `[rings]` and `[dense]` of a rig file."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from planning.model.document.ring_records import RingAxis
from planning.model.light.dense_code import DenseCode
from planning.model.table_types import Table


class RingsTable(Table):
    """The ring pattern, `[rings]`; without a gap the planner chooses it."""

    tilt_deg: Annotated[float, Field(ge=0.0, lt=45.0)] = 8.0
    gap_mm: Annotated[float, Field(ge=0.01)] | None = None
    spacing: Literal["uniform", "curvature"] = "curvature"
    axis: RingAxis = "auto"
    margin_mm: Annotated[float, Field(ge=0.0)] = 15.0


class DenseTable(Table):
    """What tells every pixel of a projector, `[dense]`; see `DenseCode`."""

    shifts: Annotated[int, Field(ge=0, le=64)] = 4
    period_px: Annotated[int, Field(ge=4, le=1024)] = 16
    phase_noise_deg: Annotated[float, Field(gt=0.0, le=90.0)] = 1.0

    @model_validator(mode="after")
    def _check_code(self) -> Self:
        self.code()
        return self

    def code(self) -> DenseCode:
        """Return the code.

        Raises:
            ValueError: If there can't be one of these numbers.
        """
        noise = math.radians(self.phase_noise_deg)
        return DenseCode(self.shifts, self.period_px, noise)
