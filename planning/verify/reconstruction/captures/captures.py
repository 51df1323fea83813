"""A folder of captured images: `FOLDER/C1/P1/00-white.png` and so on.

Camera, projector, then the name of the frame that was shown, as in `patterns/`: images
are paired with what was projected by name, never by their order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from planning.model.errors import CapturesError
from planning.model.files import reading, write_together
from planning.verify.reconstruction.arrays import Images
from planning.verify.reconstruction.patterns.ring_patterns import Frames
from planning.verify.reconstruction.scanner import Scanner

from .images import SUFFIXES, read_grey

# Bits that sensors have; 16-bit files hold what fewer bits gave.
_DEPTHS = (8, 10, 12, 14, 16)
_LISTED = 4


@dataclass(frozen=True, eq=False)
class CaptureFolder:
    """Where images of every pair of a plan's devices are; its patterns were shown."""

    path: Path
    plan: Scanner

    def place(self, p: int, c: int) -> Path:
        """Return the folder of a pair."""
        return self.path / self.plan.cameras[c].id / self.plan.projectors[p].id

    def require(self) -> None:
        """Refuse a folder that holds none of the cameras (CapturesError)."""
        if not self.path.is_dir():
            raise CapturesError(f"{self.path}: no such folder; give that of the images")
        ids = [camera.id for camera in self.plan.cameras]
        if not any((self.path / name).is_dir() for name in ids):
            raise CapturesError(
                f"{self.path}: has no folder of a camera; they must be called "
                f"{_some(ids)}, it holds {_holding(self.path)}"
            )

    def read(self, p: int, c: int) -> Images:
        """Return the images of a pair, shape (n_frames, h, w), levels 0 to 255.

        Raises:
            CapturesError: If one is missing, twice there, unreadable, of another size,
                or of another depth than the rest.
        """
        files = self._files(p, c)
        resolution = self.plan.cameras[c].resolution
        levels = [read_grey(file, resolution) for file in files]
        for file, image in zip(files, levels, strict=True):
            if image.dtype != levels[0].dtype:
                raise CapturesError(
                    f"{file}: {8 * image.itemsize} bits, {files[0].name} has "
                    f"{8 * levels[0].itemsize}; record all frames alike"
                )
        return scaled(np.stack(levels))

    def write(self, p: int, c: int, stack: NDArray[np.uint8]) -> None:
        """Write the images of a pair as 8-bit PNG."""
        place = self.place(p, c)
        place.mkdir(parents=True, exist_ok=True)
        pictures = map(Image.fromarray, stack)
        names = self.plan.frame_names(p, c)
        write_together(
            {
                place / f"{name}.png": partial(
                    picture.save, format="PNG", compress_level=1
                )
                for name, picture in zip(names, pictures, strict=True)
            }
        )

    def _files(self, p: int, c: int) -> list[Path]:
        place, names = self.place(p, c), self.plan.frame_names(p, c)
        if not place.is_dir():
            above = place.parent
            near = above.is_dir() and _entries(above)
            holds = f"; {above} holds {_holding(above)}" if near else ""
            raise CapturesError(f"{place}: no such folder{holds}")
        entries = _entries(place)
        images: dict[str, list[Path]] = {}
        for file in entries:
            if file.suffix.lower() in SUFFIXES:
                images.setdefault(file.stem, []).append(file)
        missing = [name for name in names if name not in images]
        if missing:
            known = {frame.name for frame in self.plan.frames(p)}
            others = [file.name for file in entries if file.stem not in known]
            also = f"; holds {_some(others)}, no frame's name" if others else ""
            raise CapturesError(f"{place}: lacks {_some(missing)}{also}")
        for name in names:
            if len(images[name]) > 1:
                twice = _some([file.name for file in images[name]])
                raise CapturesError(f"{place}: {twice} are one frame; keep one")
        return [images[name][0] for name in names]


def whole_image(frames: Frames, resolution: tuple[int, int]) -> Images:
    """Return windows of rendered frames as images of a camera's own size."""
    width, height = resolution
    left, top = frames.corner
    n, tall, wide = frames.stack.shape
    stack = np.zeros((n, height, width), dtype=frames.stack.dtype)
    stack[:, top : top + tall, left : left + wide] = frames.stack
    return stack


def scaled(stack: NDArray[np.uint8 | np.uint16]) -> Images:
    """Bring 16-bit files to levels of 0 to 255, by the bits that the sensor used."""
    if stack.dtype == np.uint8:
        return stack.astype(np.uint8, copy=False)
    largest = int(stack.max())
    bits = next(bits for bits in _DEPTHS if largest < 1 << bits)
    return (stack * np.float32(255.0 / ((1 << bits) - 1))).astype(np.float32)


def _entries(folder: Path) -> list[Path]:
    with reading(folder, CapturesError):
        return sorted(folder.iterdir())


def _holding(folder: Path) -> str:
    return _some([entry.name for entry in _entries(folder)])


def _some(names: Sequence[str]) -> str:
    """Name the first few."""
    if not names:
        return "nothing"
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
