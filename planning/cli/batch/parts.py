"""Which parts a batch plans, and where their plans go."""

import glob
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from geometry.files.archives import is_mesh_name
from planning.model.errors import InputError

from .part_names import called_before, folders_of, one_line, told_apart


@dataclass(frozen=True)
class Part:
    """A mesh file of a batch.

    Attributes:
        path: Where it is.
        name: Its path below what was given, which plans and tables call it by; more of
            its path where another part has the same.
        folder: Where its plan goes, below the output folder.
    """

    path: Path
    name: str
    folder: str


def find_parts(
    given: Sequence[str],
    out: Path | None = None,
    known: Mapping[str, str] | None = None,
) -> tuple[Part, ...]:
    """Return the meshes in folders, of patterns, and those named, by their names.

    Args:
        given: Folders, patterns and files.
        out: A folder of plans, whose clouds and exports are no parts of a folder
            above it; None: there is none.
        known: Folders of the plans that stand there, by their parts' names.

    Raises:
        InputError: If there are none.
    """
    found: dict[str, tuple[str, Path]] = {}
    for one in given:
        for path, name in _below(one, out and os.path.realpath(out)):
            found.setdefault(os.path.realpath(path), (name, path))
    if not found:
        raise InputError(
            f"{one_line(', '.join(given))}: no mesh there; give a folder, a pattern or "
            f"files"
        )
    names, paths = zip(*sorted(found.values()), strict=True)
    called = called_before(paths, told_apart(paths, names), known or {})
    parts = sorted(zip(called, paths, strict=True))
    folders = folders_of([name for name, _ in parts], known)
    return tuple(
        Part(path, name, folder)
        for (name, path), folder in zip(parts, folders, strict=True)
    )


def _below(given: str, out: str | None) -> Iterator[tuple[Path, str]]:
    root = Path(given)
    if root.is_dir():
        for folder, below, names in os.walk(root):
            places = {one: os.path.realpath(os.path.join(folder, one)) for one in below}
            below[:] = sorted(one for one in below if places[one] != out)
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
