"""Observations of points on an object, read from a CSV file: `docs/use/ranges.md`.

Millimetres and degrees in the file, metres and radians from here on.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.shapes.sight_lines import SightLines
from planning.model.errors import InputError

from .csv_rows import CsvRow, read_csv

REQUIRED = ("point", "x_mm", "y_mm", "z_mm", "dx", "dy", "dz", "sigma_deg")
OPTIONAL = ("range_mm", "sigma_mm")
# Farther off than this first order no longer holds, and nobody aims so badly [deg].
_WORST_DEG = 5.0


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
    table = read_csv(path, REQUIRED, OPTIONAL)
    if ("range_mm" in table.names) != ("sigma_mm" in table.names):
        raise InputError(
            f"{table.header}: range_mm and sigma_mm go together; give both"
        )
    if not table.rows:
        raise InputError(f"{path}: holds no observation below its header")
    observations = tuple(_observation(row) for row in table.rows)
    return RangeFile(table.path, table.sha256, observations)


def sight_lines(observations: list[Observation]) -> SightLines:
    """Return observations of one point as arrays."""
    names = "origin_m", "direction", "sigma_rad", "range_m", "range_sigma_m"
    columns = ([getattr(o, name) for o in observations] for name in names)
    # None becomes NaN.
    return SightLines(*(np.array(column, dtype=np.float64) for column in columns))


def _observation(row: CsvRow) -> Observation:
    where = row.where
    if not row.has("point"):
        raise InputError(f"{where}: point is empty; every row names its point")
    x, y, z, *direction = (row.number(name) for name in REQUIRED[1:7])
    length = math.hypot(*direction)
    if not length > 1e-9:
        raise InputError(f"{where}: dx, dy, dz = 0 0 0 is no direction")
    sigma = row.number("sigma_deg")
    if not 0.0 < sigma <= _WORST_DEG:
        raise InputError(
            f"{where}: sigma_deg = {sigma:g} must be over 0 and at most {_WORST_DEG:g}"
        )
    dx, dy, dz = (part / length for part in direction)
    return Observation(
        row.line,
        row.cells["point"],
        (1e-3 * x, 1e-3 * y, 1e-3 * z),
        (dx, dy, dz),
        math.radians(sigma),
        *_distance(row),
    )


def _distance(row: CsvRow) -> tuple[float | None, float | None]:
    given = [row.has(name) for name in OPTIONAL]
    if not any(given):
        return None, None
    if not all(given):
        raise InputError(
            f"{row.where}: {OPTIONAL[given.index(True)]} without "
            f"{OPTIONAL[given.index(False)]}; give both or neither"
        )
    values = [row.number(name) for name in OPTIONAL]
    for name, value in zip(OPTIONAL, values, strict=True):
        if not value > 0.0:
            raise InputError(f"{row.where}: {name} = {value:g} must be positive")
    return 1e-3 * values[0], 1e-3 * values[1]
