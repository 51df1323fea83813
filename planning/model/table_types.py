"""What every table of a rig file is made of: strict values in stated ranges."""

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
Acute = Annotated[float, Field(gt=0.0, lt=90.0)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
PositivePair = Annotated[list[Positive], Field(min_length=2, max_length=2)]
Axis = Annotated[list[float], Field(min_length=3, max_length=3)]
Sides = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Name = Annotated[str, Field(min_length=1)]
# No length in mm, angle or number of pixels or poses is as large; squares of what is
# larger by far overflow.
_LARGEST = 1e9
UpName = Literal["x", "y", "z", "-x", "-y", "-z"]


def _off_is_none(value: object) -> object:
    return None if value == "off" else value


# TOML has no null: a limit that isn't to bind is written "off".
Limit = Annotated[Positive | None, BeforeValidator(_off_is_none)]


class Table(BaseModel):
    """A TOML table: nothing unknown, nothing converted, nothing infinite or absurd."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False
    )

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        for name in type(self).model_fields:
            for value in _numbers(getattr(self, name)):
                if abs(value) > _LARGEST:
                    raise ValueError(
                        f"{name}: {value:g} is out of range; at most {_LARGEST:g}"
                    )
        return self


def _numbers(value: object) -> Iterator[float]:
    if isinstance(value, list | tuple):
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, int | float):
        yield value
