"""Rig files and presets: found, read, laid over their base, checked.

Every fault becomes one line that says where it stands, what was written, the rule and
what to do.
"""

import difflib
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from geometry.files.file_content import file_content
from planning.model.errors import RigError
from planning.model.files import reading
from planning.model.light.photometry_table import SensorTable
from planning.model.table_types import SourcedTable, fault_words

from .rig_tables import CalibrationTable, RigTable

_DEVICES = ("projector", "parallel_projector", "camera")
# Tables that may name a preset: by which key, and where those are.
_PRESETS = {
    "calibration": ("from", "calibrations"),
    "photometry": ("sensor", "sensors"),
}
# Ways to say one thing: a figure laid over a base replaces the base's other ways.
_SAME = (
    ("focal_px", "focal_mm", "throw_ratio"),
    ("principal_point_px", "vertical_offset_percent"),
)


@dataclass(frozen=True)
class Figure:
    """One figure of a device, by its dotted key, and where it was read."""

    device: str
    key: str
    value: object
    source: str


@dataclass(frozen=True)
class Preset:
    """A rig that comes with the program; its devices' names are by table."""

    name: str
    description: str
    devices: dict[str, str]
    figures: tuple[Figure, ...]


def list_calibrations() -> tuple[Preset, ...]:
    """Return what `from` of `[calibration]` takes, each with its figures."""
    return tuple(_of_table("calibrations", CalibrationTable))


def list_sensors() -> tuple[Preset, ...]:
    """Return what `sensor` of `[photometry]` takes, each with its figures."""
    return tuple(_of_table("sensors", SensorTable))


def _of_table(
    folder: str, kind: type[CalibrationTable] | type[SensorTable]
) -> Iterator[Preset]:
    for name in _names("presets", folder):
        table = kind.model_validate(_figures_of(folder, name))
        yield Preset(name, table.description, {}, _figures("", table))


def list_presets() -> tuple[Preset, ...]:
    """Return the rigs that come with the program, by name."""
    return tuple(_preset(name) for name in preset_names())


def preset_names() -> tuple[str, ...]:
    """Return the names that `load_rig` takes without a file."""
    return _names("presets")


def read_rig(name_or_path: str | Path) -> RigTable:
    """Read and check a preset, or a file: text with `.toml` or a separator is a path.

    Raises:
        RigError: One line for each fault.
    """
    if _is_path(name_or_path):
        where, tables = str(name_or_path), _read_file(Path(name_or_path))
    else:
        where, tables = (
            f"rig {name_or_path}",
            tomllib.loads(preset_text(str(name_or_path))),
        )
    # A preset may itself be laid over another.
    while (base := tables.pop("base", None)) is not None:
        if not isinstance(base, str) or base not in preset_names():
            raise RigError(
                f"{where}: base = {base!r} must name a preset: "
                f"{', '.join(preset_names())}"
            )
        tables = lay_over(tomllib.loads(preset_text(base)), tables)
    for key in _PRESETS:
        if isinstance(table := tables.get(key), dict):
            tables[key] = _with_preset(where, key, table)
    try:
        return RigTable.model_validate(tables)
    except ValidationError as error:
        faults = [f"{where}: {_fault(e)}" for e in error.errors(include_url=False)]
        raise RigError("\n".join(faults)) from None


def rig_folder(name_or_path: str | Path) -> Path:
    """Return where files that a rig names are looked for: beside its own."""
    return Path(name_or_path).parent if _is_path(name_or_path) else Path()


def lay_over(base: dict[str, Any], tables: dict[str, Any]) -> dict[str, Any]:
    """Return a preset's tables with a file's laid over them, key by key.

    A device that the file names is taken whole from the file; without a name its
    figures replace those of the preset, whose sources for them no longer hold.
    """
    merged = {**base}
    for key, value in tables.items():
        old = base.get(key)
        if not (isinstance(value, dict) and isinstance(old, dict)):
            merged[key] = value
        elif key in _PRESETS:
            merged[key] = _lay_figures_over(old, value)
        elif key not in _DEVICES:
            merged[key] = {**old, **value}
        else:
            merged[key] = value if "name" in value else _lay_device_over(old, value)
    return merged


def _lay_device_over(base: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    replaced = {key for key in given if not isinstance(given[key], dict)}
    replaced |= {key for group in _SAME if replaced & set(group) for key in group}
    device = {key: value for key, value in base.items() if key not in replaced}
    focus = given.get("focus")
    if isinstance(focus, dict):
        replaced |= {f"focus.{key}" for key in focus}
        device["focus"] = {**base.get("focus", {}), **focus}
    whole = tuple(f"{key}." for key in ("body", "mount") if key in given)
    replaced |= {key for key in base.get("sources", {}) if key.startswith(whole)}
    sources = {k: v for k, v in base.get("sources", {}).items() if k not in replaced}
    newer = given.get("sources", {})
    device |= {key: given[key] for key in given if key not in ("focus", "sources")}
    device["sources"] = {**sources, **newer} if isinstance(newer, dict) else newer
    return device


def _lay_figures_over(base: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Return a calibration laid over another: what it replaces has no source."""
    if set(given) & {"from", "sensor"}:
        return given
    kept = {k: v for k, v in base.get("sources", {}).items() if k not in given}
    newer = given.get("sources", {})
    sources = {**kept, **newer} if isinstance(newer, dict) else newer
    # One that is changed isn't what it is called any more.
    unnamed = {"description": ""} if set(given) - {"sources"} else {}
    return {**base, **unnamed, **given, "sources": sources}


def _with_preset(where: str, key: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return a table laid over the preset that it names, if it names one."""
    given, (word, folder) = dict(given), _PRESETS[key]
    if (name := given.pop(word, None)) is None:
        return given
    known = _names("presets", folder)
    if name not in known:
        raise RigError(
            f"{where}: [{key}] {word} = {name!r} must be one of {', '.join(known)}"
        )
    preset = _figures_of(folder, name)
    laid = _lay_figures_over(preset, given)
    # A sensor's figures are a few of its table's; they keep its name.
    if folder == "sensors" and not set(given) & set(preset):
        laid["description"] = preset["description"]
    return laid


def _figures_of(folder: str, name: str) -> dict[str, Any]:
    file = files("planning.rig").joinpath("presets", folder, f"{name}.toml")
    table = tomllib.loads(file.read_text(encoding="utf-8"))
    return {**table, "description": f"{name}: {table['description']}"}


def _names(*folder: str) -> tuple[str, ...]:
    names = (entry.name for entry in files("planning.rig").joinpath(*folder).iterdir())
    return tuple(sorted(name[:-5] for name in names if name.endswith(".toml")))


def _is_path(name: str | Path) -> bool:
    text = str(name)
    named = text.lower().endswith(".toml") or "/" in text or "\\" in text
    return named or isinstance(name, Path)


def _read_file(path: Path) -> dict[str, Any]:
    presets = f"; give a rig file or a preset ({', '.join(preset_names())})"
    with reading(path, RigError, absent=presets):
        content = file_content(path)
    try:
        return tomllib.loads(content.decode())
    except ValueError as error:
        raise RigError(f"{path}: not TOML ({error}); correct that line") from None


def preset_text(name: str) -> str:
    """Return the file of a preset.

    Raises:
        RigError: If there is none of this name.
    """
    known = preset_names()
    if name not in known:
        close = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"presets: {', '.join(known)}"
        raise RigError(
            f"rig {name}: no such preset; {hint} A file's name ends in .toml"
        )
    file = files("planning.rig").joinpath("presets", f"{name}.toml")
    return file.read_text(encoding="utf-8")


def _preset(name: str) -> Preset:
    table = read_rig(name)
    devices: dict[str, str] = {}
    figures: list[Figure] = []
    for role in _DEVICES:
        device = getattr(table, role)
        if device is not None:
            devices[role] = device.name
            figures += _figures(role, device)
    if table.calibration.description:
        devices["calibration"] = table.calibration.description
    return Preset(name, table.description, devices, tuple(figures))


def _figures(role: str, table: SourcedTable) -> tuple[Figure, ...]:
    figures: list[Figure] = []
    for key in table.figures():
        value: object = table
        for part in key.split("."):
            value = getattr(value, part)
        figures.append(Figure(role, key, value, table.sources.get(key, "assumed")))
    return tuple(figures)


def _fault(entry: ErrorDetails) -> str:
    unknown = _nearest_key(entry["loc"]) if entry["type"] == "extra_forbidden" else ""
    remedy = "write such a value, or remove the key"
    return fault_words(entry, unknown=unknown, remedy=remedy)


def _nearest_key(loc: tuple[int | str, ...]) -> str:
    """Say in which table a key belongs, or which of the same may have been meant."""
    # A number is a place in a list of tables.
    table = ".".join(part for part in loc[:-1] if isinstance(part, str))
    tables, key = dict(_tables("", RigTable)), str(loc[-1])
    homes = [name for name, known in tables.items() if key in known]
    if "" in homes:
        return "it belongs above the first table"
    if homes:
        return f"it belongs in [{'] or ['.join(homes)}]"
    known = tables[table]
    close = difflib.get_close_matches(key, known, n=1)
    return f"did you mean {close[0]}?" if close else f"keys here: {', '.join(known)}"


def _tables(name: str, model: type[BaseModel]) -> Iterator[tuple[str, list[str]]]:
    """Yield the keys of a table by its name, and of all tables within it."""
    yield name, list(model.model_fields)
    for key, field in model.model_fields.items():
        # A field holds a table bare, beside None or in a list.
        for kind in getattr(field.annotation, "__args__", (field.annotation,)):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from _tables(f"{name}.{key}".removeprefix("."), kind)
