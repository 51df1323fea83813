"""Orthographic views of the world, and what every picture has in common."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from planning.model.files import write_atomically

Colour: TypeAlias = tuple[int, int, int]

# Everything is drawn so many times finer and then reduced, which smooths its edges.
SUPERSAMPLING = 2
BACKGROUND: Colour = (255, 255, 255)
CLAY: Colour = (214, 205, 196)


def save_picture(picture: Image.Image, path: Path, plan: str = "") -> None:
    """Write a picture as a PNG, the same bytes every time, with a plan's digest."""
    text = PngInfo()
    if plan:
        text.add_text("ringrig-plan", plan)
    write_atomically(path, lambda file: picture.save(file, format="PNG", pnginfo=text))


@dataclass(frozen=True, eq=False)
class PictureView:
    """An orthographic view of the world, +x right and +y down in the picture.

    Attributes:
        focus: World point at the centre of the picture [m], shape (3,).
        right: World direction of +x in the picture, unit, shape (3,).
        up: World direction of -y in the picture, unit, shape (3,).
        size: Width and height in [px].
        m_per_px: Metres that a pixel spans.
    """

    focus: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    size: tuple[int, int]
    m_per_px: float

    @property
    def to_viewer(self) -> NDArray[np.float64]:
        """World direction from the scene to the viewer, unit, shape (3,)."""
        return np.cross(self.right, self.up)

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return picture coordinates of world points; (..., 3) to (..., 2)."""
        centre = 0.5 * np.array(self.size)
        plane = (points - self.focus) @ np.stack([self.right, -self.up], axis=1)
        return centre + plane / self.m_per_px


def facing(
    direction: Sequence[float] | NDArray[np.float64],
    up: Sequence[float] | NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the right and up directions of a view from somewhere.

    Seen straight along `up`, the world axis that follows up's own in the order
    x, y, z, x points right: x where z is up, as on a map.

    Raises:
        ValueError: If a direction has no length or isn't finite.
    """
    back, upward = np.array(direction, dtype=float), np.array(up, dtype=float)
    for name, vector in (("direction", back), ("up", upward)):
        length = np.linalg.norm(vector)
        if not (length > 0 and np.isfinite(length)):
            raise ValueError(f"{name} must have a length, got {vector.tolist()}")
    back, upward = back / np.linalg.norm(back), upward / np.linalg.norm(upward)
    right = np.cross(upward, back)
    if np.linalg.norm(right) < 1e-6:
        right = np.eye(3)[(int(np.argmax(np.abs(upward))) + 1) % 3]
        right = right - (right @ back) * back
    right /= np.linalg.norm(right)
    return right, np.cross(back, right)


def fitted(
    points: NDArray[np.float64],
    direction: Sequence[float] | NDArray[np.float64],
    up: Sequence[float] | NDArray[np.float64],
    size: tuple[int, int],
    *,
    margin_px: float | tuple[float, float],
) -> PictureView:
    """Return the view from a direction that holds all points, as large as can be.

    The margin is at every side, or at the sides and above and below.
    """
    right, upward = facing(direction, up)
    plane = points @ np.stack([right, upward], axis=1)
    low, high = plane.min(axis=0), plane.max(axis=0)
    room = np.maximum(np.array(size) - 2.0 * np.array(margin_px), 1.0)
    m_per_px = float(np.max((high - low) / room))
    back = np.cross(right, upward)
    middle = 0.5 * (low + high)
    focus = middle[0] * right + middle[1] * upward + points.mean(axis=0) @ back * back
    return PictureView(focus, right, upward, size, m_per_px or 1.0)
