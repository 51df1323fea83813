"""A format's folder: its files, complete or not at all, and what README.txt says."""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from planning.model.files import write_together

from .exported_rig import Content, ExportedRig, ExportFormat

README = "README.txt"
_FIRST = "A rig of ringrig as "
_FILES = "Files:"
_WIDTH = 88


@dataclass(frozen=True)
class Exported:
    """What was written of one format.

    Attributes:
        name: Of the format.
        folder: Where it is.
        files: Paths in there, README.txt last.
        lacks: A sentence for each thing of the plan that the format can't hold.
    """

    name: str
    folder: Path
    files: tuple[str, ...]
    lacks: tuple[str, ...]


def write_export(rig: ExportedRig, form: ExportFormat, folder: Path) -> Exported:
    """Write a format into a folder; files of an older export that it lists go.

    Raises:
        OSError: If it can't be written.
    """
    lacks = [*rig.lacks, *form.lacks(rig)]
    files = form.files(rig)
    files[README] = _readme(rig, form, lacks, list(files)).encode()
    old = _listed(folder)
    writers = {folder / name: _writer(content) for name, content in files.items()}
    for path in writers:
        path.parent.mkdir(parents=True, exist_ok=True)
    write_together(writers)
    for name in old - files.keys():
        (folder / name).unlink(missing_ok=True)
    return Exported(form.name, folder, tuple(files), tuple(lacks))


def _readme(
    rig: ExportedRig, form: ExportFormat, lacks: Sequence[str], files: Sequence[str]
) -> str:
    missing = [f"  {sentence}" for sentence in lacks] or ["  nothing of this plan"]
    lines = [
        f"{_FIRST}{form.what}",
        "",
        f"Plan {rig.plan.digest}",
        f"Frame: {rig.frame.words}",
        "",
        *textwrap.wrap(form.notes, _WIDTH, break_long_words=False),
        "",
        "What the format can't hold:",
        *missing,
        "",
        _FILES,
        *(f"  {name}" for name in files),
    ]
    return "\n".join(lines) + "\n"


def _listed(folder: Path) -> set[str]:
    """Return the files of an older export that lie inside its folder."""
    try:
        text = (folder / README).read_text()
    except (OSError, ValueError):
        return set()
    if not text.startswith(_FIRST) or f"\n{_FILES}\n" not in text:
        return set()
    names = {line.strip() for line in text.split(f"\n{_FILES}\n")[1].splitlines()}
    return {
        name
        for name in names
        if name and not Path(name).is_absolute() and ".." not in Path(name).parts
    }


def _writer(content: Content) -> Callable[[BinaryIO], object]:
    return content if callable(content) else lambda file: file.write(content)
