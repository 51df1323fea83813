"""A mesh file's bytes, out of .gz, .bz2 or .zip, and never more than fit."""

import bz2
import gzip
import io
import lzma
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import IO

from geometry.mesh.mesh import MeshError

from .file_content import file_content
from .formats import SUPPORTED

# A small archive can unpack to more than any machine holds.
_MAX_BYTES = 1 << 32
# Bytes unpacked at a time.
_PIECE = 1 << 24
_DAMAGED = (
    *(OSError, EOFError, RuntimeError, NotImplementedError),
    *(zlib.error, lzma.LZMAError, zipfile.BadZipFile),
)


def file_bytes(path: str | Path) -> bytes:
    """Return the bytes of a file as it is."""
    try:
        data = file_content(path)
    except FileNotFoundError:
        raise MeshError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise MeshError(f"{path}: is a directory; name one mesh file") from None
    except (OSError, ValueError) as error:
        raise MeshError(f"{path}: can't be opened ({error})") from None
    if not data:
        raise MeshError(f"{path}: the file is empty (0 bytes); export the mesh again")
    return data


_Unpacked = tuple[str, bytes, Callable[[str], bytes] | None]


def unpacked(path: Path, data: bytes) -> _Unpacked:
    """Return the format, its bytes, and how to fetch files that it names."""
    suffixes = [suffix.lower().lstrip(".") for suffix in path.suffixes] or [""]
    try:
        if suffixes[-1] == "zip":
            return _from_zip(data)
        if suffixes[-1] == "gz":
            with gzip.open(io.BytesIO(data)) as stream:
                content = _at_most(_pieces(stream))
        elif suffixes[-1] == "bz2":
            content = _at_most(_bunzipped(data))
        else:
            return suffixes[-1], data, lambda name: file_content(path.parent / name)
    except _DAMAGED as error:
        raise MeshError(f"{path}: can't be unpacked ({error})") from None
    return (suffixes[-2] if len(suffixes) > 1 else ""), content, None


def _from_zip(data: bytes) -> _Unpacked:
    archive = zipfile.ZipFile(io.BytesIO(data))
    meshes = [
        name
        for name in archive.namelist()
        if PurePosixPath(name).suffix.lower().lstrip(".") in SUPPORTED
        and not name.startswith("__MACOSX/")
    ]
    if len(meshes) != 1:
        held = ", ".join(meshes[:4]) or "none"
        raise OSError(f"it must hold one mesh, holds {len(meshes)}: {held}")
    folder = PurePosixPath(meshes[0]).parent

    def member(name: str) -> bytes:
        with archive.open(name) as stream:
            return _at_most(_pieces(stream))

    kind = PurePosixPath(meshes[0]).suffix.lower().lstrip(".")
    content = member(meshes[0])
    return kind, content, lambda name: member(str(folder / name))


def _bunzipped(data: bytes) -> Iterator[bytes]:
    # The module's own file takes what is behind a stream and no stream for padding.
    while data:
        stream = bz2.BZ2Decompressor()
        yield stream.decompress(data, _PIECE)
        while not stream.eof:
            if stream.needs_input:
                raise EOFError("it ends before the end of its stream")
            yield stream.decompress(b"", _PIECE)
        data = stream.unused_data


def _pieces(stream: IO[bytes] | gzip.GzipFile) -> Iterator[bytes]:
    # Asked for everything at once, gzip sets the largest size aside first.
    return iter(lambda: stream.read(_PIECE), b"")


def _at_most(pieces: Iterable[bytes]) -> bytes:
    held: list[bytes] = []
    total = 0
    for piece in pieces:
        held.append(piece)
        total += len(piece)
        if total > _MAX_BYTES:
            raise OSError(f"it unpacks to more than {_MAX_BYTES >> 30} GiB")
    return b"".join(held)


def is_mesh_name(name: str) -> bool:
    """Return whether a file is read as a mesh, by its name; what it holds may not be.

    A .zip is, though it may hold none. Hidden files, as macOS leaves beside others,
    are none.
    """
    path = PurePosixPath(name.lower())
    if path.name.startswith("."):
        return False
    if path.suffix in (".gz", ".bz2"):
        path = path.with_suffix("")
    return path.suffix.lstrip(".") in (*SUPPORTED, "zip")
