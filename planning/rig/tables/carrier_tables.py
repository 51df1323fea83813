"""What turns the part or carries a head: `[turntable]` and `[stations]`."""

from collections.abc import Sequence
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from geometry.arrays import Array
from planning.model.devices.bodies import Triple
from planning.model.devices.heads import Stations, Turntable
from planning.model.table_types import Axis, Name, Table

MOST_STEPS, MOST_STATIONS = 360, 1_000
# Length below which a vector is no direction.
_NO_DIRECTION = 1e-9
_Steps = Annotated[int, Field(ge=1, le=MOST_STEPS)]
# TOML has no null: any angle is written "free".
_StepsOrFree = Annotated[
    _Steps | None,
    BeforeValidator(lambda value: None if value == "free" else value),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "integer", "minimum": 1, "maximum": MOST_STEPS},
                {"const": "free"},
            ]
        }
    ),
]
_Seconds = Annotated[float, Field(ge=0.0, le=1e6)]


class TurntableTable(Table):
    """A table that turns the part while devices stand, `[turntable]`."""

    point_mm: Axis | None = None
    axis: Axis | None = None
    steps: _StepsOrFree = None
    max_steps: _Steps | None = None
    seconds_per_step: _Seconds | None = None
    still: list[Name] = Field(default=[])

    @model_validator(mode="after")
    def _check_axis(self) -> Self:
        for key, what in (
            ("point_mm", "a point that the axis runs through"),
            ("axis", "the direction that the part turns about, as [0, 0, 1]"),
        ):
            if getattr(self, key) is None:
                raise ValueError(f"a turntable without {key}; write {what}")
        if not np.linalg.norm(self.axis or [0.0]) > _NO_DIRECTION:
            raise ValueError(f"axis = {self.axis} must not be zero")
        return self

    @model_validator(mode="after")
    def _check_steps(self) -> Self:
        if self.steps is not None and (self.max_steps or 0) > self.steps:
            raise ValueError(
                f"max_steps = {self.max_steps} is more than the {self.steps} angles "
                f"that steps gives; lower it or remove it"
            )
        for name in self.still:
            if self.still.count(name) > 1:
                raise ValueError(f"still names {name!r} twice; name each once")
        return self

    def turntable(self, zones: Sequence[str]) -> Turntable:
        """Return it in metres; `zones` are obstacles that always stand still."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis or [1.0])
        return Turntable(
            point_m=_triple(1e-3 * np.array(self.point_mm)),
            axis=_triple(axis),
            steps=self.steps,
            max_steps=self.max_steps,
            still=(*self.still, *zones),
            seconds_per_step=self.seconds_per_step,
        )


class StationsTable(Table):
    """Poses of one head that is carried between them, `[stations]`."""

    max: Annotated[int, Field(ge=1, le=MOST_STATIONS)] | None = None
    carrier: Literal["robot", "tripod"] = "robot"
    seconds_per_metre: _Seconds | None = None
    seconds_per_station: _Seconds | None = None

    def stations(self) -> Stations:
        """Return them as the planner takes them."""
        return Stations(**self.model_dump())


def _triple(vector: Array) -> Triple:
    x, y, z = vector.tolist()
    return x, y, z
