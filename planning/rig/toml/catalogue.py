"""The catalogue of single devices, and a rig's table of what `device` names.

A projector by its name; a camera by its own and, after a plus, that of its lens, or a
bare focal length: ``basler/acA2440-75um + 16mm``.
"""

import math
import re
from functools import cache
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from planning.model.table_types import (
    Name,
    Pair,
    Positive,
    PositivePair,
    SourcedTable,
)
from planning.rig.rig_tables import Rate, Resolution

from .preset_files import devices_of, near

# What a lens can be set to has no far end.
FARTHEST_MM = 100_000.0
_FOCAL = ("focal_px", "focal_mm", "throw_ratio", "calibration")
_BARE_LENS = re.compile(r"(\d+(?:\.\d+)?) ?mm")
_PLAIN_LENS = "assumed: a lens of that focal length, no model named"


class Entry(SourcedTable):
    """What is published of one device; `price` with its currency and date."""

    name: Name
    description: Name
    mount: str = ""
    price: Name | None = None

    def figures(self) -> tuple[str, ...]:
        """Return the names of the figures, of which each needs a source."""
        return tuple(key for key in super().figures() if key != "mount")


class ProjectorEntry(Entry):
    """A projector: throw ratios and shifts that its lens can be set to."""

    resolution_px: Resolution
    throw_ratio: Positive
    throw_ratios: PositivePair | None = None
    vertical_offset_percent: float
    shift_percent: Pair | None = None
    pixel_um: Positive
    range_mm: PositivePair
    frame_rate_hz: Rate
    lumens: Positive | None = None


class CameraEntry(Entry):
    """A camera without its lens."""

    resolution_px: Resolution
    pixel_um: Positive
    frame_rate_hz: Rate | None = None

    @property
    def diagonal_mm(self) -> float:
        """Diagonal of the sensor [mm]."""
        return 1e-3 * self.pixel_um * math.hypot(*self.resolution_px)


class LensEntry(Entry):
    """A lens: stops from open to closed, nearest object, and how wide its image is."""

    focal_mm: Positive
    f_numbers: PositivePair
    nearest_mm: Positive
    image_circle_mm: Annotated[float, Field(gt=0.0)]

    @model_validator(mode="after")
    def _check_stops(self) -> Self:
        if not self.f_numbers[0] <= self.f_numbers[1]:
            raise ValueError(f"f_numbers = {self.f_numbers} must rise")
        return self


_KINDS: dict[str, type[Entry]] = {
    "projectors": ProjectorEntry,
    "cameras": CameraEntry,
    "lenses": LensEntry,
}


@cache
def catalogue(kind: str) -> dict[str, Any]:
    """Return the `projectors`, `cameras` or `lenses` that are known, by name."""
    model = _KINDS[kind]
    return {
        name: model.model_validate(table) for name, table in devices_of(kind).items()
    }


def device_table(role: str, device: object, given: dict[str, Any]) -> dict[str, Any]:
    """Return the table of `camera` or `projector` that a device stands for.

    Args:
        role: Table of the rig file.
        device: As written.
        given: What is written beside it, and replaces its figures.

    Raises:
        ValueError: It says what is wrong with the name, or with a figure beside it.
    """
    if not isinstance(device, str):
        raise ValueError(
            f"device = {device!r} must be the name of one; `plan rigs devices` lists "
            f"them"
        )
    if role == "projector":
        return _projector(device, given)
    if role == "camera":
        return _camera(device, given)
    raise ValueError(
        "takes no device: the catalogue has no projector of parallel light"
    )


def split_camera(device: str) -> tuple[CameraEntry, LensEntry | float | None]:
    """Return a camera and its lens; of a bare one its focal length [mm].

    Raises:
        ValueError: If one of them isn't known, or they don't fit each other.
    """
    name, _, lens_name = (part.strip() for part in device.partition("+"))
    camera = _found("cameras", name)
    if not lens_name:
        return camera, None
    if bare := _BARE_LENS.fullmatch(lens_name):
        return camera, float(bare[1])
    lens = _found("lenses", lens_name)
    if lens.mount != camera.mount and (lens.mount, camera.mount) != ("C", "CS"):
        raise ValueError(
            f"device = {device!r}: the lens has a mount {lens.mount}, the camera "
            f"{camera.mount}; name a lens that fits (`plan rigs devices`)"
        )
    if camera.diagonal_mm > lens.image_circle_mm:
        raise ValueError(
            f"device = {device!r}: the lens draws an image of "
            f"{lens.image_circle_mm:g} mm across, the sensor's diagonal is "
            f"{camera.diagonal_mm:.1f} mm; its corners would be dark, name another"
        )
    return camera, lens


def _camera(device: str, given: dict[str, Any]) -> dict[str, Any]:
    camera, lens = split_camera(device)
    table = _figures(camera, "resolution_px", "pixel_um", "frame_rate_hz")
    table |= {"name": camera.name, "device": device}
    if lens is None:
        if not set(_FOCAL) & set(given):
            raise ValueError(
                f"device = {device!r} is a camera without a lens; write "
                f"{device.strip() + ' + 16mm'!r}, or a lens of `plan rigs devices`"
            )
        return table
    sources = table["sources"]
    if not isinstance(lens, LensEntry):
        table |= {"focal_mm": lens, "range_mm": [10.0 * lens, FARTHEST_MM]}
        table["name"] += f" with a {lens:g} mm lens"
        sources["focal_mm"] = _PLAIN_LENS
        sources["range_mm"] = "assumed: from ten focal lengths on"
        return table
    table |= {
        "focal_mm": lens.focal_mm,
        "range_mm": [lens.nearest_mm, FARTHEST_MM],
        "name": f"{camera.name} with {lens.name}",
    }
    sources["focal_mm"] = lens.sources["focal_mm"]
    sources["range_mm"] = lens.sources["nearest_mm"]
    return table


def _projector(device: str, given: dict[str, Any]) -> dict[str, Any]:
    entry = _found("projectors", device.strip())
    for key, ends in (
        ("throw_ratio", entry.throw_ratios),
        ("vertical_offset_percent", entry.shift_percent),
    ):
        value = given.get(key)
        is_number = isinstance(value, int | float)
        if ends and is_number and not ends[0] <= value <= ends[1]:
            raise ValueError(
                f"{key} = {value:g}: the lens of {device} goes from {ends[0]:g} to "
                f"{ends[1]:g}; write one of these, or describe your projector without "
                f"`device`"
            )
    keys = ("resolution_px", "throw_ratio", "vertical_offset_percent", "pixel_um")
    table = _figures(entry, *keys, "range_mm", "frame_rate_hz")
    return table | {"name": entry.name, "device": device}


def _found(kind: str, name: str) -> Any:  # noqa: ANN401
    known = catalogue(kind)
    if name not in known:
        one = "lens" if kind == "lenses" else kind[:-1]
        raise ValueError(
            f"device: no {one} {name!r} in the catalogue; "
            f"{near(name, tuple(known))} `plan rigs devices` lists them all"
        )
    return known[name]


def _figures(entry: Entry, *keys: str) -> dict[str, Any]:
    kept = [key for key in keys if getattr(entry, key) is not None]
    return {
        **{key: getattr(entry, key) for key in kept},
        "sources": {key: entry.sources[key] for key in kept},
    }
