"""Arrays of an `.npz` that a stranger packed."""

import zlib
from io import BytesIO
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from .errors import PlanFileError

# What numpy and zipfile raise on damaged archives, beside OSError and ValueError.
_DAMAGED = (
    BadZipFile,
    EOFError,
    MemoryError,
    NotImplementedError,
    RuntimeError,
    SyntaxError,
    TypeError,
    TokenError,
    zlib.error,
)
# What all may take, unpacked: bytes, or times what they take packed, if that is more.
# Ours take two to seven times as much; zeros a thousand times.
_LEAST, _TIMES = 1_000_000_000, 100


def unpacked_arrays(content: bytes) -> dict[str, NDArray[Any]]:
    """Return all arrays of an archive by their names; no object is made of any.

    Raises:
        PlanFileError: If it can't be read, or nobody would unpack so much.
    """
    most = max(_LEAST, _TIMES * len(content))
    try:
        with ZipFile(BytesIO(content)) as archive:
            entries = archive.infolist()
        size = sum(entry.file_size for entry in entries)
        if size > most:
            raise PlanFileError(f"it unpacks to {size} bytes, at most {most} are read")
        names = [entry.filename.removesuffix(".npy") for entry in entries]
        if len(set(names)) < len(names):
            raise PlanFileError("two of its arrays have one name")
        with np.load(BytesIO(content), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except PlanFileError:
        raise
    except (OSError, ValueError, *_DAMAGED) as error:
        raise PlanFileError(f"not a readable .npz ({error})") from None
