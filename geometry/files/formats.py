"""From a file's bytes to raw vertices and triangles, whole or not at all.

Each format has a strict reader of its own. The general mesh libraries read some broken
files in part and others as something else, without an error: strips as points,
compressed or sparse data as zeros, mixed lists by the length of the first.
"""

from collections.abc import Callable
from functools import partial
from pathlib import PurePosixPath, PureWindowsPath

from .gltf_format import read_glb, read_gltf
from .ply_format import read_ply
from .reading import FormatError, RawMesh
from .stl_format import read_stl
from .text_formats import read_obj, read_off
from .three_mf_format import read_three_mf

_Fetch = Callable[[str], bytes]
_ALONE = {
    **{"obj": read_obj, "ply": read_ply, "stl": read_stl, "off": read_off},
    **{"glb": read_glb, "3mf": read_three_mf},
}
SUPPORTED = ("obj", "ply", "stl", "off", "glb", "gltf", "3mf")


def read_format(kind: str, data: bytes, fetch: _Fetch | None = None) -> RawMesh:
    """Return the whole content of a mesh file.

    Args:
        kind: One of ``SUPPORTED``.
        data: The file's bytes, decompressed.
        fetch: Returns the bytes of a file named by this one (buffers of a .gltf).

    Raises:
        FormatError: If it isn't whole, or holds no triangles.
    """
    if kind == "gltf":
        raw = read_gltf(data, partial(_beside, fetch))
    else:
        raw = _ALONE[kind](data)
    if len(raw.vertices) == 0:
        raise FormatError("it is empty: no vertices")
    if len(raw.faces) == 0:
        raise FormatError(
            f"it holds {len(raw.vertices)} points and no faces; a surface is needed"
        )
    return raw


def _beside(fetch: _Fetch | None, name: str) -> bytes:
    rooted = PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive
    missing = FormatError(f"it needs the file '{name}', which isn't beside it")
    if fetch is None or rooted or ".." in name:
        raise missing
    try:
        return fetch(name)
    except (FileNotFoundError, KeyError):
        raise missing from None
