"""What every table of a rig file is made of: strict values in stated ranges."""

from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
Acute = Annotated[float, Field(gt=0.0, lt=90.0)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
PositivePair = Annotated[list[Positive], Field(min_length=2, max_length=2)]
Axis = Annotated[list[float], Field(min_length=3, max_length=3)]
Sides = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Name = Annotated[str, Field(min_length=1)]
UpName = Literal["x", "y", "z", "-x", "-y", "-z"]


def _off_is_none(value: object) -> object:
    return None if value == "off" else value


# TOML has no null: a limit that isn't to bind is written "off".
Limit = Annotated[Positive | None, BeforeValidator(_off_is_none)]


class Table(BaseModel):
    """A TOML table: nothing unknown, nothing converted, nothing infinite."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False
    )
