"""A flat board with marks, and where it may be held."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array

# Directions that a board is turned to, and how far from the middle it is held, as
# shares of the object's radius along its own axes.
_DIRECTIONS = 40
_OFFSETS = (
    *((0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.0, 0.0, -0.5)),
    *((0.5, 0.0, 0.0), (0.0, 0.5, 0.0)),
)


@dataclass(frozen=True)
class Board:
    """Marks in a grid on one side of a flat board: dots, or corners of a checkerboard.

    Attributes:
        size_m: Width and height of the grid, between its outermost marks [m].
        marks: How many across and down.
    """

    size_m: tuple[float, float]
    marks: tuple[int, int]

    def points(self) -> Array:
        """Return the marks in the board's frame, which they lie on z = 0 of, (n, 3)."""
        axes = (
            np.linspace(-0.5 * size, 0.5 * size, n)
            for size, n in zip(self.size_m, self.marks, strict=True)
        )
        x, y = np.meshgrid(*axes)
        return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def board_for(radius_m: float, marks: tuple[int, int]) -> Board:
    """Return a board of 4 : 3 whose diagonal is as long as the object is wide."""
    return Board((1.6 * radius_m, 1.2 * radius_m), marks)


def board_poses(centre: Array, radius_m: float, up: Array) -> Array:
    """Return poses of a board about the object's place, marks towards +z, (n, 4, 4).

    Directions lie on a golden spiral; the board's own y runs down.
    """
    k = np.arange(_DIRECTIONS) + 0.5
    z, turn = 1.0 - 2.0 * k / _DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - z * z)
    normals = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    x = np.cross(normals, up)
    # No normal of the spiral is `up` itself, an axis.
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    axes = np.stack([x, np.cross(normals, x), normals], axis=2)
    poses = np.tile(np.eye(4), (len(_OFFSETS) * _DIRECTIONS, 1, 1))
    poses[:, :3, :3] = np.repeat(axes, len(_OFFSETS), axis=0)
    offsets = radius_m * np.einsum("nij,kj->nki", axes, np.array(_OFFSETS))
    poses[:, :3, 3] = centre + offsets.reshape(-1, 3)
    return poses
