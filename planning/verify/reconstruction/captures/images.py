"""Image files to grey levels: lossless ones of one camera's own size, or refused."""

import io
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from geometry.files.file_content import file_content
from planning.model.errors import CapturesError

SUFFIXES = (".png", ".tif", ".tiff", ".bmp", ".pgm")
_LOSSLESS = ("PNG", "TIFF", "BMP", "PPM")
_KNOWN = (*_LOSSLESS, "JPEG", "GIF", "WEBP")
_PACKED_WITH_LOSS = ("jpeg", "webp")
_SIXTEEN_BITS = 65535
# A channel beyond this is clipped, whatever the others say.
_CLIPPED = 250


def read_grey(path: Path, resolution: tuple[int, int]) -> NDArray[np.uint8 | np.uint16]:
    """Return the grey levels of an image file, shape (h, w), 8 or 16 bits as stored.

    Of colours the mean is taken; where one of them is clipped the pixel is. Its width
    and height must be the resolution [px].

    Raises:
        CapturesError: If it can't be read whole, loses detail, or isn't of that size.
    """
    try:
        with warnings.catch_warnings():
            # A file's size is held against the camera's before anything is unpacked.
            warnings.simplefilter("ignore")
            content = io.BytesIO(file_content(path))
            with Image.open(content, formats=_KNOWN) as image:
                _require_fit(image, resolution, path)
                image.load()
                return _grey(image, path)
    except CapturesError:
        raise
    except FileNotFoundError:
        raise CapturesError(f"{path}: no such file") from None
    # Pillow answers damage with exceptions of many kinds, SyntaxError among them.
    except Exception as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise CapturesError(
            f"{path}: not a readable image ({why}); take or copy it again"
        ) from None


def _require_fit(image: Image.Image, resolution: tuple[int, int], path: Path) -> None:
    packed = str(image.info.get("compression", "")).lower()
    if image.format not in _LOSSLESS or packed in _PACKED_WITH_LOSS:
        raise CapturesError(
            f"{path}: {image.format} moves edges or drops grey levels; save PNG or "
            f"TIFF without loss"
        )
    if image.size != resolution:
        raise CapturesError(
            f"{path}: {image.size[0]} x {image.size[1]} px, must be the camera's "
            f"{resolution[0]} x {resolution[1]}; don't scale, crop or turn images"
        )
    if getattr(image, "n_frames", 1) != 1:
        raise CapturesError(f"{path}: holds several images; save one a file")


def _grey(image: Image.Image, path: Path) -> NDArray[np.uint8 | np.uint16]:
    if image.mode == "L":
        return np.array(image)
    if image.mode == "I" or image.mode.startswith("I;16"):
        levels = np.array(image)
        if levels.min() < 0 or levels.max() > _SIXTEEN_BITS:
            raise CapturesError(
                f"{path}: grey levels {levels.min()} to {levels.max()}, must be 0 to "
                f"{_SIXTEEN_BITS}; save 8 or 16 bits"
            )
        return levels.astype(np.uint16)
    if image.mode in ("P", "PA"):
        image = image.convert("RGBA")
    if image.mode not in ("LA", "RGB", "RGBA"):
        raise CapturesError(
            f"{path}: pixels of mode {image.mode}; save grey levels of 8 or 16 bits"
        )
    channels = np.array(image)
    if image.mode != "RGB":
        if not np.all(channels[:, :, -1] == 255):
            raise CapturesError(f"{path}: is partly transparent; save it without alpha")
        channels = channels[:, :, :-1]
    mean = np.rint(channels.mean(axis=2)).astype(np.uint8)
    return np.where(channels.max(axis=2) >= _CLIPPED, np.uint8(255), mean)
