"""Which parts a batch plans, where their plans go, and what each is planned from."""

import glob
import json
import os
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, cast

from geometry.files.archives import is_mesh_name
from planning.model.errors import InputError

# What is awkward in the name of a folder.
_AWKWARD = re.compile(r"[^A-Za-z0-9._/-]+")


@dataclass(frozen=True)
class Part:
    """A mesh file of a batch.

    Attributes:
        path: Where it is.
        name: Its path below what was given, which plans and tables call it by.
        folder: Where its plan goes, below the output folder.
    """

    path: Path
    name: str
    folder: str


def find_parts(given: Sequence[str]) -> tuple[Part, ...]:
    """Return the meshes in folders, of patterns, and those named, by their names.

    Raises:
        InputError: If there are none.
    """
    found: dict[Path, str] = {}
    for one in given:
        for path, name in _below(one):
            found.setdefault(path.resolve(), name)
    if not found:
        raise InputError(
            f"{', '.join(given)}: no mesh there; give a folder, a pattern or files"
        )
    pairs = sorted((name, path) for path, name in found.items())
    stems = [_folder(name) for name, _ in pairs]
    often = Counter(stem.lower() for stem in stems)
    parts: list[Part] = []
    taken: set[str] = set()
    for (name, path), stem in zip(pairs, stems, strict=True):
        # Two files of one stem are told apart by what follows it.
        base = _folder(name, whole=True) if often[stem.lower()] > 1 else stem
        folder, again = base, 2
        while folder.lower() in taken:
            folder, again = f"{base}-{again}", again + 1
        taken.add(folder.lower())
        parts.append(Part(path, name, folder))
    return tuple(parts)


def _below(given: str) -> Iterator[tuple[Path, str]]:
    root = Path(given)
    if root.is_dir():
        for folder, below, names in os.walk(root):
            below.sort()
            for name in sorted(names):
                if is_mesh_name(name):
                    path = Path(folder) / name
                    yield path, path.relative_to(root).as_posix()
    elif root.exists() or not glob.has_magic(given):
        yield root, root.name
    else:
        for match in sorted(glob.glob(given)):
            if is_mesh_name(match):
                yield Path(match), Path(match).name


def _folder(name: str, *, whole: bool = False) -> str:
    path = PurePosixPath(name)
    last = path.name if whole else path.name.split(".")[0]
    return _AWKWARD.sub("-", str(path.with_name(last or path.name))).strip("-")


def part_files(path: Path) -> dict[str, bytes]:
    """Return a mesh file with what it refers to, by name: the mesh comes first.

    Raises:
        InputError: If it can't be read.
    """
    files = {path.name: _content(path)}
    if path.suffix.lower() == ".gltf":
        for name in _buffers(files[path.name]):
            with suppress(InputError):
                files[name] = _content(path.parent / name)
    return files


def rig_files(name: str) -> dict[str, bytes]:
    """Return a rig file with the meshes of its obstacles; nothing of a preset.

    Raises:
        InputError: If the rig file can't be read.
    """
    path = Path(name)
    if path.suffix != ".toml":
        return {}
    files = {path.name: _content(path)}
    with suppress(tomllib.TOMLDecodeError, UnicodeDecodeError):
        table = tomllib.loads(files[path.name].decode())
        for obstacle in cast(list[dict[str, Any]], table.get("obstacle", [])):
            with suppress(InputError, TypeError, AttributeError):
                files[obstacle["file"]] = _content(path.parent / obstacle["file"])
    return files


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror})") from None


def _buffers(content: bytes) -> Iterator[str]:
    with suppress(ValueError, AttributeError, TypeError):
        for buffer in json.loads(content).get("buffers", []):
            name = buffer.get("uri", "")
            if name and not name.startswith("data:") and ".." not in name:
                yield name
