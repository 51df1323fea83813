"""Observations of points on an object, read from a CSV file: `docs/use/ranges.md`.

Millimetres and degrees in the file, metres and radians from here on.
"""

import csv
import hashlib
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.files.file_content import file_content
from geometry.shapes.sight_lines import SightLines
from planning.model.errors import InputError

REQUIRED = ("point", "x_mm", "y_mm", "z_mm", "dx", "dy", "dz", "sigma_deg")
OPTIONAL = ("range_mm", "sigma_mm")
# Farther off than this first order no longer holds, and nobody aims so badly [deg].
_WORST_DEG = 5.0
# As the largest number of a rig file: beyond any rig.
_FARTHEST = 1e9


@dataclass(frozen=True)
class Observation:
    """A direction in which a point was seen, and the distance if one was measured.

    The line counts from 1; `sigma_rad` is about either axis across the unit direction.
    """

    line: int
    point: str
    origin_m: tuple[float, float, float]
    direction: tuple[float, float, float]
    sigma_rad: float
    range_m: float | None = None
    range_sigma_m: float | None = None


@dataclass(frozen=True, eq=False)
class RangeFile:
    """The rows of a file of observations, in their order, and its digest."""

    path: str
    sha256: str
    observations: tuple[Observation, ...]


def read_range_file(path: str | Path) -> RangeFile:
    """Read observations.

    Raises:
        InputError: If the file can't be read whole; it names the line, the value and
            the rule.
    """
    try:
        data = file_content(path)
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "isn't text in UTF-8"
        raise InputError(f"{path}: {str(why).lower()}") from None
    rows = _rows(text, str(path))
    where, header = next(rows, (0, []))
    names = [name.strip() for name in header]
    _check_header(names, f"{path}: line {where}" if where else f"{path}")
    observations = [_observation(names, row, f"{path}: line {n}", n) for n, row in rows]
    if not observations:
        raise InputError(f"{path}: holds no observation below its header")
    return RangeFile(str(path), hashlib.sha256(data).hexdigest(), tuple(observations))


def sight_lines(observations: list[Observation]) -> SightLines:
    """Return observations of one point as arrays."""
    names = "origin_m", "direction", "sigma_rad", "range_m", "range_sigma_m"
    columns = ([getattr(o, name) for o in observations] for name in names)
    # None becomes NaN.
    return SightLines(*(np.array(column, dtype=np.float64) for column in columns))


def _rows(text: str, path: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with their line numbers; empty lines and `#` comments are left out."""
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


def _check_header(names: list[str], where: str) -> None:
    known = (*REQUIRED, *OPTIONAL)
    missing = [name for name in REQUIRED if name not in names]
    strange = [name for name in names if name not in known]
    twice = sorted({name for name in names if names.count(name) > 1})
    for what, which in (("lacks", missing), ("doesn't know", strange)):
        if which:
            raise InputError(
                f"{where}: the header {what} {', '.join(map(repr, which))}; columns "
                f"are {', '.join(REQUIRED)} and, if need be, {', '.join(OPTIONAL)}"
            )
    if twice:
        raise InputError(f"{where}: the header names {', '.join(twice)} twice")
    if ("range_mm" in names) != ("sigma_mm" in names):
        raise InputError(f"{where}: range_mm and sigma_mm go together; give both")


def _observation(
    names: list[str], row: list[str], where: str, line: int
) -> Observation:
    if len(row) != len(names):
        raise InputError(f"{where}: {len(row)} cells, the header has {len(names)}")
    cells = {name: cell.strip() for name, cell in zip(names, row, strict=True)}
    if not cells["point"]:
        raise InputError(f"{where}: point is empty; every row names its point")
    x, y, z, *direction = (_number(cells, name, where) for name in REQUIRED[1:7])
    length = math.hypot(*direction)
    if not length > 1e-9:
        raise InputError(f"{where}: dx, dy, dz = 0 0 0 is no direction")
    sigma = _number(cells, "sigma_deg", where)
    if not 0.0 < sigma <= _WORST_DEG:
        raise InputError(
            f"{where}: sigma_deg = {sigma:g} must be over 0 and at most {_WORST_DEG:g}"
        )
    dx, dy, dz = (part / length for part in direction)
    return Observation(
        line,
        cells["point"],
        (1e-3 * x, 1e-3 * y, 1e-3 * z),
        (dx, dy, dz),
        math.radians(sigma),
        *_distance(cells, where),
    )


def _distance(cells: dict[str, str], where: str) -> tuple[float | None, float | None]:
    given = [bool(cells.get(name)) for name in OPTIONAL]
    if not any(given):
        return None, None
    if not all(given):
        raise InputError(
            f"{where}: {OPTIONAL[given.index(True)]} without "
            f"{OPTIONAL[given.index(False)]}; give both or neither"
        )
    values = [_number(cells, name, where) for name in OPTIONAL]
    for name, value in zip(OPTIONAL, values, strict=True):
        if not value > 0.0:
            raise InputError(f"{where}: {name} = {value:g} must be positive")
    return 1e-3 * values[0], 1e-3 * values[1]


def _number(cells: dict[str, str], name: str, where: str) -> float:
    try:
        value = float(cells[name])
    except ValueError:
        raise InputError(
            f"{where}: {name} = {cells[name]!r} must be a number"
        ) from None
    if not abs(value) <= _FARTHEST:
        raise InputError(
            f"{where}: {name} = {value:.12g} must be finite, at most {_FARTHEST:g}"
        )
    return value
