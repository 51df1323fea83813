"""What the readers of all formats share: their error, and words as numbers."""

from collections.abc import Sequence

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

    Raises:
        FormatError: If a word isn't a decimal number, "nan" or "inf".
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
    """Return vertex numbers as integers.

    Raises:
        FormatError: If one isn't whole, or too large to count anything.
    """
    if not np.all((values == np.floor(values)) & (np.abs(values) < _LARGEST)):
        raise FormatError("a face names a vertex by a number that isn't whole")
    return values.astype(np.int64)
