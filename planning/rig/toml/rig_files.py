"""Rig files and presets: found, read, laid over their base, checked.

Every fault becomes one line that says where it stands, what was written, the rule and
what to do.
"""

import difflib
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from geometry.files.file_content import file_content
from planning.model.errors import RigError
from planning.model.files import reading
from planning.model.table_types import fault_words, told_once
from planning.rig.rig_tables import RigTable

from .laying import DEVICES, lay_over
from .named import WHOLE_FILE, Named
from .preset_files import preset_names, preset_text


def read_rig(source: str | Path | Mapping[str, Any]) -> RigTable:
    """Read and check a preset, a file, or tables as a file has them.

    Text with `.toml` or a separator is a path.

    Raises:
        RigError: One line for each fault.
    """
    if isinstance(source, Mapping):
        where, tables = "rig", dict(source)
    elif _is_path(source):
        where, tables = str(source), _read_file(Path(source))
    else:
        where, tables = f"rig {source}", tomllib.loads(preset_text(str(source)))
    named = Named(rig_folder(source))
    tables, table = named.resolved(tables), None
    faults = named.faults
    try:
        table = RigTable.model_validate(tables)
    except ValidationError as error:
        entries = told_once(error.errors(include_url=False))
        for entry in entries:
            entry["loc"] = _in_list(entry["loc"])
        faults += [_fault(e) for e in entries if not _follows(e, named.broken)]
    if table is None or faults:
        raise RigError("\n".join(f"{where}: {fault}" for fault in faults))
    return table


def _follows(entry: ErrorDetails, broken: set[str]) -> bool:
    """Whether a fault is there only because a named thing wasn't found."""
    if entry["type"] == "missing" and WHOLE_FILE in broken:
        return True
    loc = entry["loc"]
    if len(loc) > 1 and loc[0] in DEVICES and isinstance(loc[1], int):
        return f"{loc[0]}[{loc[1]}]" in broken
    return bool(loc) and loc[0] in broken


def _in_list(loc: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return where a device of a list stands: `more_cameras[0]` is the second."""
    if len(loc) < 2 or not isinstance(loc[1], int):
        return loc
    name = str(loc[0]).removeprefix("more_").removesuffix("s")
    return (name, loc[1] + 1, *loc[2:]) if name in DEVICES else loc


def rig_folder(source: str | Path | Mapping[str, Any]) -> Path:
    """Return where files that a rig names are looked for: beside its own."""
    if isinstance(source, Mapping) or not _is_path(source):
        return Path()
    return Path(source).parent


def changed(table: RigTable, tables: Mapping[str, Any]) -> RigTable:
    """Return a rig with tables laid over it, as over the `base` of a file.

    Raises:
        RigError: One line for each fault.
    """
    below, over = table.model_dump(exclude_unset=True), dict(tables)
    for role in DEVICES:
        given = over.get(role)
        if isinstance(given, tuple):
            over[role] = [*given]
        elif isinstance(given, str) or {"name", "device"} & {*(given or ())}:
            # A whole device takes the place of a list.
            below.pop(f"more_{role}s", None)
    return read_rig(lay_over(below, over))


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
        remedy = "correct that line"
        if "overwrite" in str(error):
            remedy = (
                "a key stands there twice; with tables of its own a device is "
                'named within: [projector] device = "NAME"'
            )
        raise RigError(f"{path}: not TOML ({error}); {remedy}") from None


def _fault(entry: ErrorDetails) -> str:
    unknown = _nearest_key(entry["loc"]) if entry["type"] == "extra_forbidden" else ""
    remedy = "write such a value, or remove the key"
    return fault_words(entry, unknown=unknown, remedy=remedy)


def _nearest_key(loc: tuple[int | str, ...]) -> str:
    """Say in which table a key belongs, or which of the same may have been meant."""
    # A number is a place in a list of tables.
    table = ".".join(part for part in loc[:-1] if isinstance(part, str))
    tables = {k: v for k, v in _tables("", RigTable) if not k.startswith("more_")}
    key = str(loc[-1])
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
