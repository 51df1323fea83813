"""Entries of the cache in a folder: whole or none, and the oldest make room.

An entry is a file named by its key. It is written beside and moved into place, so that
readers, other runs and a kill see all of it or nothing; and it begins with a checksum
of its key and bytes, so that one that was damaged or renamed afterwards is none.
"""

import hashlib
import os
import re
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from planning.model.files import write_atomically

LIMIT_BYTES = 2_000_000_000
_SUM = 20
# Of runs that were killed; what is younger may be what another run is writing [s].
_BUSY_S = 600.0
_SUFFIX = ".ringrig"
_OURS = re.compile(r"[.]?[0-9a-f]{40}[.]ringrig([.].*)?")


class Entries(Protocol):
    """Bytes by their keys."""

    def get(self, key: str, /) -> bytes | None:
        """Return an entry; None: there is none."""
        ...

    def put(self, key: str, value: bytes, /) -> None:
        """Keep an entry."""
        ...


class MemoryEntries(dict[str, bytes]):
    """Entries that are forgotten with the process."""

    def put(self, key: str, value: bytes) -> None:
        """Keep an entry."""
        self[key] = value


@dataclass(frozen=True)
class FolderEntries:
    """Entries in a folder of their own, which needn't exist.

    Attributes:
        folder: Where they are.
        limit_bytes: Size of all; those read or written longest ago go first.
    """

    folder: Path
    limit_bytes: int = LIMIT_BYTES

    def get(self, key: str) -> bytes | None:
        """Return an entry; None: there is none, or not a whole one."""
        path = self._path(key)
        try:
            data = path.read_bytes()
        except OSError:
            return None
        value = data[_SUM:]
        if data[:_SUM] != _checksum(key, value):
            with suppress(OSError):
                path.unlink()
            return None
        with suppress(OSError):
            # Its age counts from its last use.
            os.utime(path)
        return value

    def put(self, key: str, value: bytes) -> None:
        """Keep an entry, and drop the oldest beyond the limit.

        Raises:
            OSError: If it can't be written.
        """
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_atomically(
                self._path(key),
                lambda file: file.writelines((_checksum(key, value), value)),
            )
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.folder)) from None
        self._make_room()

    def size(self) -> tuple[int, int]:
        """Return how many entries there are, and their bytes."""
        sizes = [size for _, size, path in self._files() if not _partial(path)]
        return len(sizes), sum(sizes)

    def clear(self) -> None:
        """Drop all entries; what others put into the folder stays."""
        for *_, path in self._files():
            path.unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{_SUFFIX}"

    def _make_room(self) -> None:
        files = sorted(self._files())
        whole = [file for file in files if not _partial(file[2])]
        excess = sum(size for _, size, _ in whole) - self.limit_bytes
        dropped = [f for f in files if _partial(f[2]) and time.time() - f[0] > _BUSY_S]
        for file in whole:
            if excess > 0:
                excess -= file[1]
                dropped.append(file)
        for *_, path in dropped:
            with suppress(OSError):
                path.unlink()

    def _files(self) -> Iterator[tuple[float, int, Path]]:
        """When each of our files was used last [s], its bytes, and where it is."""
        with suppress(FileNotFoundError):
            for path in self.folder.iterdir():
                # Another run may drop it meanwhile.
                with suppress(FileNotFoundError):
                    if _OURS.fullmatch(path.name) and path.is_file():
                        told = path.stat()
                        yield told.st_mtime, told.st_size, path


def _partial(path: Path) -> bool:
    """Whether a file is still written, or was left so."""
    return path.suffix != _SUFFIX


def _checksum(key: str, value: bytes) -> bytes:
    return hashlib.blake2b(value, key=key.encode(), digest_size=_SUM).digest()
