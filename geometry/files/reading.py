"""What the readers share: error and result, words as numbers, bodies put together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints
from geometry.mesh.file_origin import FileOrigin

METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
# As 3MF and, in the plural, mesh libraries name them; without the s of the plural.
_UNIT_NAMES = {
    **{"micron": "um", "micrometer": "um", "millimeter": "mm", "centimeter": "cm"},
    **{"meter": "m", "inch": "in", "inche": "in", "foot": "ft", "feet": "ft"},
}
# Up to here every whole number has a float64 of its own.
_LARGEST = 2.0**53


class FormatError(Exception):
    """A file's content breaks the rules of its format; the reader names the file."""


@dataclass(frozen=True, eq=False)
class RawMesh:
    """What a file holds: positions in its own unit, triangles, and the stated unit.

    ``origin`` is None where each triangle is a polygon of the file, in its order.
    """

    vertices: Array
    faces: Ints
    unit: str | None
    origin: FileOrigin | None = None


def known_unit(name: str) -> str | None:
    """Return the short name of a unit; None: not known."""
    unit = _UNIT_NAMES.get(name.lower().removesuffix("s"), name)
    return unit if unit in METRES else None


def decode(data: bytes) -> str:
    """Return the text of a UTF-8, UTF-16 or Latin-1 file; its numbers are ASCII."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    return data.removeprefix(b"\xef\xbb\xbf").decode("latin-1")


def numbers(words: Sequence[str]) -> Array:
    """Return words as numbers, shape (n,).

    Python also takes digit groups (1_000) and digits of other scripts; no mesh format
    does, so there they are damage.
    """
    try:
        values = np.array(words, dtype=np.float64).reshape(-1)
    except ValueError as error:
        raise FormatError(f"a number can't be read ({error})") from None
    text = "".join(words)
    if not text.isascii() or "_" in text:
        raise FormatError("a number is written with other signs than digits")
    return values


def whole(values: Array | Ints) -> Ints:
    """Return vertex numbers as integers."""
    if not np.all((values == np.floor(values)) & (np.abs(values) < _LARGEST)):
        raise FormatError("a face names a vertex by a number that isn't whole")
    return values.astype(np.int64)


# A few nested references can ask for more instances than any machine holds.
_MAX_FACES = 50_000_000


@dataclass(frozen=True, eq=False)
class ScenePart:
    """A body in its own coordinates, and the affine map (4, 4) to where it stands."""

    vertices: Array
    faces: Ints
    world_from_part: Array


def joined(parts: Sequence[ScenePart], unit: str) -> RawMesh:
    """Return all parts in the world; mirrored ones keep their outside outside."""
    known = known_unit(unit)
    if known is None:
        raise FormatError(f"it states the unit '{unit}', which isn't known")
    total = sum(len(part.faces) for part in parts)
    if total > _MAX_FACES:
        raise FormatError(
            f"its instances add up to {total} faces, at most {_MAX_FACES} are read"
        )
    vertices: list[Array] = [np.empty((0, 3))]
    faces: list[Ints] = [np.empty((0, 3), np.int64)]
    n = 0
    for part in parts:
        corners, count = part.faces, len(part.vertices)
        if len(corners) and not (corners.min() >= 0 and corners.max() < count):
            raise FormatError(f"a face names a vertex that isn't there, of {count}")
        turn = part.world_from_part[:3, :3]
        # Infinite coordinates are counted and removed later; here they may become NaN.
        with np.errstate(invalid="ignore", over="ignore"):
            vertices.append(part.vertices @ turn.T + part.world_from_part[:3, 3])
        mirrored = bool(np.linalg.det(turn) < 0)
        faces.append((corners[:, ::-1] if mirrored else corners) + n)
        n += count
    return RawMesh(np.concatenate(vertices), np.concatenate(faces), known)
