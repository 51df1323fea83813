"""What the readers share: their error, words as numbers, bodies put together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints

# Up to here every whole number has a float64 of its own.
_LARGEST = 2.0**53


class FormatError(Exception):
    """A file's content breaks the rules of its format; the reader names the file."""


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


def joined(parts: Sequence[ScenePart]) -> tuple[Array, Ints]:
    """Return all parts in the world; mirrored ones keep their outside outside."""
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
    return np.concatenate(vertices), np.concatenate(faces)
