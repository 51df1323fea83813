"""A folder of Gray-code images in OpenCV's order, as cameras saved them.

Images are in the order of the numbers in their names: bits of the columns from the
highest, each followed by its inverse, those of the rows, then white and black; or white
and black first.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from planning.model.errors import CapturesError
from planning.model.files import reading
from planning.verify.reconstruction.arrays import Images
from planning.verify.reconstruction.captures.captures import scaled
from planning.verify.reconstruction.captures.images import SUFFIXES, read_grey
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern

_LISTED = 4
# Images whose means differ by less, as a share of white less black, are as bright.
_AS_BRIGHT = 0.02
_NUMBER = re.compile(r"\d+")


@dataclass(frozen=True, eq=False)
class GrayImages:
    """Images of one camera under one projector.

    Attributes:
        stack: In the pattern's order, levels 0 to 255, shape (n_frames, h, w).
        names: Of their files.
        notes: What was made good on reading.
    """

    stack: Images
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()


def image_size(folder: Path) -> tuple[int, int]:
    """Return the width and height of the first image of a folder [px].

    Raises:
        CapturesError: If there is none, or it can't be read.
    """
    first = _files(folder)[0]
    try:
        with Image.open(first) as image:
            return image.size
    except OSError as error:
        raise CapturesError(f"{first}: not a readable image ({error})") from None


def read_gray(folder: Path, pattern: DensePattern) -> GrayImages:
    """Read the images of a pattern without sinusoids.

    Raises:
        CapturesError: If images are missing, or too many, of another size or depth, or
            white and black aren't where either order has them.
    """
    files, wanted = _files(folder), len(pattern.frames)
    width, height = pattern.resolution
    if len(files) != wanted:
        gaps = _gaps(files, wanted)
        missing = f"; numbers {_some(gaps)} are missing" if gaps else ""
        raise CapturesError(
            f"{folder}: {len(files)} images, the Gray code of {width} x {height} px "
            f"takes {wanted} (bits of columns and rows, each with its inverse, white, "
            f"black){missing}; complete them, or give the size that was coded"
        )
    size = image_size(folder)
    images = [read_grey(file, size) for file in files]
    for file, image in zip(files, images, strict=True):
        if image.dtype != images[0].dtype:
            raise CapturesError(
                f"{file}: {8 * image.itemsize} bits, {files[0].name} has "
                f"{8 * images[0].itemsize}; record all frames alike"
            )
    stack, names = scaled(np.stack(images)), [file.name for file in files]
    order, notes = _order(stack, pattern, names)
    return GrayImages(stack[order], tuple(names[k] for k in order), notes)


def _order(
    stack: Images, pattern: DensePattern, names: Sequence[str]
) -> tuple[list[int], tuple[str, ...]]:
    """Return where each frame of the pattern is, by how bright the images are.

    None is brighter than white or darker than black; on a part of the panel a bit may
    be as bright or as dark all over.
    """
    w, n = pattern.white, len(stack)
    level = stack[:, ::4, ::4].mean(axis=(1, 2))
    white, black = int(np.argmax(level)), int(np.argmin(level))
    slack = _AS_BRIGHT * (level[white] - level[black])

    def lit(first: int) -> bool:
        bright = level[first] >= level[white] - slack
        return bool(bright and level[first + 1] <= level[black] + slack)

    if lit(w):
        return list(range(n)), ()
    if lit(0):
        note = f"white and black come first ({names[0]}, {names[1]})"
        return [*range(2, n), 0, 1], (note,)
    raise CapturesError(
        f"{names[white]} is the brightest image and {names[black]} the darkest; white "
        f"must be {names[w]} and black {names[w + 1]} (or the first two): bring the "
        f"images into OpenCV's order"
    )


def _files(folder: Path) -> list[Path]:
    """Images of a folder in the order of the last number in their names."""
    if not folder.is_dir():
        raise CapturesError(f"{folder}: no such folder; give that of the images")
    with reading(folder, CapturesError):
        files = [one for one in folder.iterdir() if one.suffix.lower() in SUFFIXES]
    if not files:
        raise CapturesError(f"{folder}: holds no image ({', '.join(SUFFIXES)})")
    unnumbered = sorted(one.name for one in files if not _NUMBER.search(one.stem))
    if unnumbered:
        raise CapturesError(
            f"{folder}: {_some(unnumbered)} carry no number, which their order is by"
        )
    return sorted(files, key=lambda one: (_number(one), one.name))


def _number(file: Path) -> int:
    return int(_NUMBER.findall(file.stem)[-1])


def _gaps(files: Sequence[Path], wanted: int) -> list[str]:
    """Numbers that are missing, of so many from 0 or 1 on."""
    numbers = {_number(file) for file in files}
    first = 0 if 0 in numbers or max(numbers) < wanted else 1
    every = range(first, max(first + wanted, min(max(numbers) + 1, 2 * wanted)))
    return [str(n) for n in every if n not in numbers]


def _some(names: Sequence[str]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
