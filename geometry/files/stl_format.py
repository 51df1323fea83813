"""Strict reader of STL, ASCII and binary."""

import re
import struct

import numpy as np

from geometry.arrays import Array

from .reading import FormatError, RawMesh, decode, numbers

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
# A facet in words; None stands for a number.
_FACET = (
    *("facet", "normal", None, None, None, "outer", "loop"),
    *(3 * ("vertex", None, None, None)),
    *("endloop", "endfacet"),
)
_SOLID = re.compile(
    r"\s*solid\b([^\r\n]*)([\r\n].*?)\bendsolid\b([^\r\n]*)", re.I | re.S
)
# In the place of a solid's name.
_GEOMETRY = re.compile(r"\bfacet\s+normal\b|\bendloop\b|\bendfacet\b", re.I)


def read_stl(data: bytes) -> RawMesh:
    """Return the triangles of an STL file, every corner apart.

    A file whose length is the one that its counter states is binary, even if it begins
    with "solid"; colours in the attribute bytes are passed over.
    """
    counted = struct.unpack("<I", data[80:84])[0] if len(data) >= 84 else -1
    if len(data) == 84 + 50 * counted:
        corners = np.frombuffer(data, _RECORD, offset=84)["corners"].astype(np.float64)
    else:
        text = decode(data)
        if re.match(r"\s*solid\b", text, re.I) is None or "\0" in text:
            raise FormatError(
                "it is neither ASCII STL nor binary STL of the stated length"
                + (f" ({counted} facets in {len(data)} bytes)" if counted >= 0 else "")
            )
        corners = _ascii(text)
    corners = corners.reshape(-1, 3)
    return RawMesh(corners, np.arange(len(corners)).reshape(-1, 3), None)


def _ascii(text: str) -> Array:
    at = 0
    parts: list[Array] = []
    while text[at:].strip():
        solid = _SOLID.match(text, at)
        if solid is None:
            read = sum(len(part) for part in parts)
            facets = len(re.findall(r"^\s*facet\b", text, re.M | re.I))
            raise FormatError(
                f"{read} of {facets} facets could be read; a 'solid' without its "
                "'endsolid' may be cut short"
            )
        if _GEOMETRY.search(solid[1]) or _GEOMETRY.search(solid[3]):
            raise FormatError(
                "facets stand on the line of a 'solid' or 'endsolid', where its name "
                "belongs"
            )
        parts.append(_facets(solid[2].split()))
        at = solid.end()
    return np.concatenate(parts)


def _facets(words: list[str]) -> Array:
    """Return the corners (m, 3, 3) of the facets of one solid."""
    size = len(_FACET)
    # A facet that is cut short comes after all whole ones.
    faulty = {len(words) // size} if len(words) % size else set[int]()
    for column, word in enumerate(_FACET):
        if word is not None and {w.lower() for w in words[column::size]} - {word}:
            of_column = enumerate(words[column::size])
            faulty.add(next(i for i, other in of_column if other.lower() != word))
    if faulty:
        raise FormatError(
            f"facet {min(faulty) + 1} isn't 'facet normal x y z', 'outer loop', three "
            "'vertex x y z', 'endloop', 'endfacet'"
        )
    places = [k for k, word in enumerate(_FACET) if word is None][3:]
    columns = [numbers(words[k::size]) for k in places]
    return np.stack(columns, axis=1).reshape(-1, 3, 3)
