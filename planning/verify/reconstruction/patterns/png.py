"""Grey PNG images of flat areas: the same bytes for the same image, and fast.

Each row is stored as its difference from the row above (PNG's filter `Up`), which is
zero nearly everywhere in a pattern, so that the fastest packing is also a small one.
"""

import struct
import zlib
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_UP = 2
_LEVEL = 1


def write_grey_png(image: NDArray[np.uint8], file: BinaryIO) -> None:
    """Write an image of 8-bit grey levels, shape (h, w)."""
    height, width = image.shape
    rows = np.empty((height, width + 1), dtype=np.uint8)
    rows[:, 0] = _UP
    rows[0, 1:] = image[0]
    # Differences are modulo 256, as the format asks.
    np.subtract(image[1:], image[:-1], out=rows[1:, 1:])
    file.write(_SIGNATURE)
    _chunk(file, b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    _chunk(file, b"IDAT", zlib.compress(rows.data, _LEVEL))
    _chunk(file, b"IEND", b"")


def _chunk(file: BinaryIO, kind: bytes, content: bytes) -> None:
    file.write(struct.pack(">I", len(content)) + kind + content)
    file.write(struct.pack(">I", zlib.crc32(kind + content)))
