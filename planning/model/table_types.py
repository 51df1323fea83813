"""What tables that people write are made of: strict values in stated ranges."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import ErrorDetails

from geometry.arrays import Array

from .words import percent_as_share

Positive = Annotated[float, Field(gt=0.0)]
# As JSON Schema has it: a number, or percent as text.
_SHARE = {
    "anyOf": [
        {"type": "number", "minimum": 0, "maximum": 1},
        {"type": "string", "pattern": "^[0-9.]+ ?%$"},
    ]
}
Share = Annotated[
    float,
    BeforeValidator(percent_as_share),
    Field(gt=0.0, le=1.0),
    WithJsonSchema(_SHARE),
]
ShareOrNone = Annotated[
    float,
    BeforeValidator(percent_as_share),
    Field(ge=0.0, le=1.0),
    WithJsonSchema(_SHARE),
]
_Size = TypeVar("_Size", bound=Sequence[int])
# Of an image: more than any sensor has.
_MOST_IN_IMAGE = 400_000_000
Acute = Annotated[float, Field(gt=0.0, lt=90.0)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
PositivePair = Annotated[list[Positive], Field(min_length=2, max_length=2)]
Axis = Annotated[list[float], Field(min_length=3, max_length=3)]
Sides = Annotated[list[Positive], Field(min_length=3, max_length=3)]
_Row = Annotated[list[float], Field(min_length=4, max_length=4)]
WrittenPose = Annotated[list[_Row], Field(min_length=4, max_length=4)]
Name = Annotated[str, Field(min_length=1)]
# How far a written rotation may be from one.
_ROTATION = 1e-4
_MOST_SHOWN = 60
# Keys of a table that need no source.
_NO_FIGURES = {"name", "device", "description", "sources", "count", "cost"}
# No length in mm, angle or number of pixels or poses is as large; squares of what is
# larger by far overflow.
LARGEST = 1e9
UpName = Literal["x", "y", "z", "-x", "-y", "-z"]


def fits_memory(size: _Size) -> _Size:
    """Return the width and height of an image, as they are.

    Raises:
        ValueError: If it has more pixels than any sensor.
    """
    if len(size) == 2 and size[0] * size[1] > _MOST_IN_IMAGE:
        raise ValueError(f"must be {_MOST_IN_IMAGE} pixels at most")
    return size


def _off_is_none(value: object) -> object:
    return None if value == "off" else value


# TOML has no null: a limit that isn't to bind is written "off".
Limit = Annotated[
    Positive | None,
    BeforeValidator(_off_is_none),
    WithJsonSchema(
        {"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"const": "off"}]}
    ),
]


class Table(BaseModel):
    """A TOML table: nothing unknown, nothing converted, nothing infinite or absurd."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False
    )

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        for name in type(self).model_fields:
            for value in _numbers(getattr(self, name)):
                if abs(value) > LARGEST:
                    raise ValueError(
                        f"{name}: {value:g} is out of range; at most {LARGEST:g}"
                    )
        return self


class SourcedTable(Table):
    """A table whose figures name their sources."""

    sources: dict[str, Name] = Field(default={})

    def figures(self) -> tuple[str, ...]:
        """Return the dotted names of the figures that were written."""
        names: list[str] = []
        for key in sorted(self.model_fields_set - _NO_FIGURES):
            value = getattr(self, key)
            if isinstance(value, Table):
                names += [f"{key}.{inner}" for inner in sorted(value.model_fields_set)]
            else:
                names.append(key)
        return tuple(names)

    @model_validator(mode="after")
    def _check_sources(self) -> Self:
        for key in self.sources:
            if key not in self.figures():
                raise ValueError(
                    f"`sources` names `{key}`, which the table doesn't give; "
                    f"remove that source or write the figure"
                )
        return self


def read_pose(rows: list[list[float]], key: str) -> Array:
    """Return a written pose with the rotation next to what was written, (4, 4).

    Raises:
        ValueError: If it isn't a rotation and a position.
    """
    pose = np.array(rows)
    turn = pose[:3, :3]
    off = float(np.abs(turn @ turn.T - np.eye(3)).max())
    mirrored = float(np.linalg.det(turn))
    if mirrored < -0.5:
        raise ValueError(
            f"{key}: its first three columns are mirrored (determinant {mirrored:.3g}, "
            f"of a rotation 1): the axes of a device are x right, y down, z forward; "
            f"turn the axis that is the wrong way round"
        )
    if not off <= _ROTATION:
        raise ValueError(
            f"{key}: its first three columns must be a rotation (R R^T differs "
            f"from the identity by {off:.2g}); write more digits"
        )
    if rows[3] != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError(f"{key}: its last row {rows[3]} must be 0 0 0 1")
    u, _, vt = np.linalg.svd(turn)
    pose[:3, :3] = u @ vt
    return pose


def told_once(faults: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """Return faults without those of a value's other types, where it may have several.

    Pydantic tells each type's: of 1.5 where a share or a list of shares may stand, that
    it is too large, and that it is no list. The first stays where it is of none.
    """
    return [
        fault
        for k, fault in enumerate(faults)
        if not fault["type"].endswith("_type")
        or not any(
            _place(other)[: len(_place(fault))] == _place(fault)
            and (i < k or not other["type"].endswith("_type") or _within(other, fault))
            for i, other in enumerate(faults)
            if i != k
        )
    ]


def _within(inner: ErrorDetails, outer: ErrorDetails) -> bool:
    return len(_place(inner)) > len(_place(outer))


def _place(fault: ErrorDetails) -> tuple[int | str, ...]:
    """Where a fault is; which type a value was read as is a word of pydantic's own."""
    return tuple(k for k in fault["loc"] if isinstance(k, int) or k.isidentifier())


def fault_words(fault: ErrorDetails, *, unknown: str, remedy: str) -> str:
    """Return a fault of a file in words: where, what was written, the rule, the remedy.

    Args:
        fault: As pydantic tells it.
        unknown: What to do about an unknown key.
        remedy: What to do about a value that breaks a rule.
    """
    where = "".join(
        f"[{key}]" if isinstance(key, int) else f".{key}" for key in _place(fault)
    ).removeprefix(".")
    if fault["type"] == "missing":
        return f"`{where}` is missing; write it"
    if fault["type"] == "extra_forbidden":
        return f"`{where}` is not a known key; {unknown}"
    rule = fault["msg"].removeprefix("Value error, ").removeprefix("Input ")
    rule = rule.replace(" after validation", "")
    if fault["type"] == "value_error":
        return f"[{where}] {rule}" if where else rule
    value = repr(fault["input"])
    value = value if len(value) <= _MOST_SHOWN else f"{value[: _MOST_SHOWN - 3]}..."
    return f"`{where or 'the file'}` = {value}: {rule}; {remedy}"


def _numbers(value: object) -> Iterator[float]:
    if isinstance(value, list | tuple):
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, int | float):
        yield value
