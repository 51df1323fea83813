"""Tables that people write as CSV: a header, then rows of cells, told by their lines.

Empty lines and lines that begin with `#` are left out.
"""

import csv
import hashlib
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from geometry.files.file_content import file_content
from planning.model.errors import InputError

# As the largest number of a rig file: beyond any rig.
_LARGEST = 1e9
# Columns that are named of a file that is another's.
_TOLD = 6


@dataclass(frozen=True)
class CsvRow:
    """One row: its cells by column, its line from 1, and both names for messages."""

    cells: dict[str, str]
    line: int
    where: str

    def has(self, name: str) -> bool:
        """Return whether there is such a column, and something in its cell."""
        return bool(self.cells.get(name))

    def number(self, name: str) -> float:
        """Return a cell as a number.

        Raises:
            InputError: If it is none, or absurd.
        """
        try:
            value = float(self.cells[name])
        except ValueError:
            raise InputError(
                f"{self.where}: {name} = {self.cells[name]!r} must be a number"
            ) from None
        if not abs(value) <= _LARGEST:
            raise InputError(
                f"{self.where}: {name} = {value:.12g} must be finite, at most "
                f"{_LARGEST:g}"
            )
        return value


@dataclass(frozen=True, eq=False)
class CsvTable:
    """The rows of a file in their order, its columns, and its digest."""

    path: str
    sha256: str
    names: tuple[str, ...]
    header: str
    rows: tuple[CsvRow, ...]


def read_csv(
    path: str | Path, required: tuple[str, ...], optional: tuple[str, ...]
) -> CsvTable:
    """Read a table.

    Raises:
        InputError: If it can't be read whole; it names the line, the value, the rule.
    """
    try:
        data = file_content(path)
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "isn't text in UTF-8"
        raise InputError(f"{path}: {str(why).lower()}") from None
    lines = _lines(text, str(path))
    number, header = next(lines, (0, []))
    names = tuple(name.strip() for name in header)
    where = f"{path}: line {number}" if number else f"{path}"
    _check_header(names, where, required, optional)
    rows = tuple(_row(names, cells, n, f"{path}: line {n}") for n, cells in lines)
    return CsvTable(str(path), hashlib.sha256(data).hexdigest(), names, where, rows)


def _lines(text: str, path: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        for row in reader:
            first = row[0].strip() if row else ""
            if first.startswith("#") or not any(cell.strip() for cell in row):
                continue
            yield reader.line_num, row
    except csv.Error as error:
        message = f"{path}: line {reader.line_num}: {error}; quote no cell"
        raise InputError(message) from None


def _check_header(
    names: tuple[str, ...],
    where: str,
    required: tuple[str, ...],
    optional: tuple[str, ...],
) -> None:
    # As spreadsheets write where the comma is the decimal mark.
    for mark in ";\t":
        if mark in "".join(names):
            raise InputError(
                f"{where}: cells are separated by {mark!r}, must be by commas, with "
                f"points in numbers"
            )
    missing = [name for name in required if name not in names]
    strange = [name for name in names if name not in (*required, *optional)]
    twice = sorted({name for name in names if names.count(name) > 1})
    for what, which in (("lacks", missing), ("doesn't know", strange)):
        if which:
            more = f" and {len(which) - _TOLD} more" if len(which) > _TOLD else ""
            told = ", ".join(map(repr, which[:_TOLD])) + more
            raise InputError(
                f"{where}: the header {what} {told}; columns "
                f"are {', '.join(required)} and, if need be, {', '.join(optional)}"
            )
    if twice:
        raise InputError(f"{where}: the header names {', '.join(twice)} twice")


def _row(names: tuple[str, ...], cells: list[str], line: int, where: str) -> CsvRow:
    if len(cells) != len(names):
        raise InputError(f"{where}: {len(cells)} cells, the header has {len(names)}")
    stripped = (cell.strip() for cell in cells)
    return CsvRow(dict(zip(names, stripped, strict=True)), line, where)
