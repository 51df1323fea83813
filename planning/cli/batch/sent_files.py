"""What a part is planned from: its mesh and the rig, with the files that they name."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path, PurePath, PurePosixPath
from typing import Any, cast
from urllib.parse import unquote

from geometry.files.file_content import file_content
from planning.model.errors import InputError
from planning.rig.toml.laying import DEVICES

from .part_names import one_line

# What TOML has in quotes, or behind a #: each but the last is a string.
_QUOTED = re.compile(
    r'"""(?:\\.|[^\\])*?"""|'
    r"'''.*?'''|"
    r'"(?:\\.|[^"\\\n])*"|'
    r"'[^'\n]*'|"
    r"#[^\n]*",
    re.DOTALL,
)


def part_files(path: Path) -> dict[str, bytes]:
    """Return a mesh file with what it refers to, by name: the mesh comes first.

    Raises:
        InputError: If it can't be read, or what it names has no place beside it.
    """
    files = {path.name: _content(path)}
    if path.suffix.lower() == ".gltf":
        for name in _buffers(files[path.name]):
            if PurePath(name).is_absolute():
                raise InputError(
                    f"{one_line(f'{path}: its buffer {name!r}')} must be named from "
                    f"the mesh's folder; put it there and name it without a folder"
                )
            with suppress(InputError):
                files[name] = _content(path.parent / name)
    return files


def rig_files(name: str) -> dict[str, bytes]:
    """Return a rig file that can be read with all files it names; nothing of a preset.

    They are called as it names them, but for absolute paths: those get others, and
    stand so in the rig file that is returned.

    Raises:
        InputError: If the rig file can't be read, or a file that it names.
    """
    if not (name.lower().endswith(".toml") or "/" in name or "\\" in name):
        return {}
    path = Path(name)
    text = _content(path).decode()
    names = tuple(dict.fromkeys(_named(tomllib.loads(text))))
    called = _called(names)
    text = _renamed(text, called)
    if {*_named(tomllib.loads(text))} != {*called.values()}:
        raise InputError(
            f"{one_line(name)}: names files by absolute paths in a way that can't be "
            f"sent along; name them from the rig file's folder"
        )
    files = {path.name: text.encode()}
    for one in names:
        files |= _beside(path, one, called[one])
    return files


def _named(rig: Mapping[str, Any]) -> Iterator[str]:
    """Yield the files that a rig file names."""
    keys = {"obstacle": "file", **dict.fromkeys(DEVICES, "calibration")}
    for table, key in keys.items():
        given = rig.get(table)
        listed = cast(list[Any], given if isinstance(given, list) else [given])
        for entry in listed:
            if isinstance(entry, dict):
                name = cast(dict[str, Any], entry).get(key)
                if name and isinstance(name, str):
                    yield name


def _called(names: tuple[str, ...]) -> dict[str, str]:
    """Return what files go along as that a rig file names so."""
    called: dict[str, str] = {}
    for number, name in enumerate(names, 1):
        path = PurePath(name)
        called[name] = f"file-{number}/{path.name}" if path.is_absolute() else name
    return called


def _renamed(text: str, called: Mapping[str, str]) -> str:
    """Return a rig file's text with other names of files."""

    def other(found: re.Match[str]) -> str:
        quoted = found[0]
        if quoted.startswith("#"):
            return quoted
        name = tomllib.loads(f"name = {quoted}")["name"]
        new = called.get(name, name)
        return quoted if new == name else json.dumps(new, ensure_ascii=False)

    return _QUOTED.sub(other, text)


def _beside(rig: Path, name: str, called: str) -> dict[str, bytes]:
    """Return a file that a rig file names, with what that refers to."""
    try:
        files = part_files(rig.parent / name)
    except InputError as error:
        remedy = "what a rig file names is looked for beside it"
        raise InputError(f"{one_line(str(rig))}: {error}; {remedy}") from None
    first, *others = files
    beside = PurePosixPath(called).parent
    return {called: files[first], **{str(beside / o): files[o] for o in others}}


def _content(path: Path) -> bytes:
    try:
        return file_content(path)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{one_line(str(path))}: can't be read ({why})") from None


def _buffers(content: bytes) -> Iterator[str]:
    with suppress(ValueError, AttributeError, TypeError, RecursionError):
        for buffer in json.loads(content).get("buffers", []):
            name = buffer.get("uri", "")
            if name and not name.startswith("data:"):
                yield unquote(name)
