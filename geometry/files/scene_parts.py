"""Bodies of a scene, each placed by a transform, joined to one mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints

from .file_numbers import FormatError

# A few nested references can ask for more instances than any machine holds.
_MAX_FACES = 50_000_000


@dataclass(frozen=True, eq=False)
class ScenePart:
    """A body in its own coordinates, and where it stands.

    Attributes:
        vertices: Shape (n, 3).
        faces: Shape (m, 3).
        world_from_part: Affine map, shape (4, 4).
    """

    vertices: Array
    faces: Ints
    world_from_part: Array


def joined(parts: Sequence[ScenePart]) -> tuple[Array, Ints]:
    """Return all parts in the world; mirrored ones keep their outside outside.

    Raises:
        FormatError: If a face names a vertex that its own part doesn't have, or the
            parts add up to more faces than can be held.
    """
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
