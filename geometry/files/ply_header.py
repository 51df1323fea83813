"""What the header of a PLY file declares: elements, and the columns of their rows."""

import re
from dataclasses import dataclass, field

from geometry.arrays import Array, Ints

from .reading import FormatError

_TYPES = {
    name: code
    for code, names in {
        "i1": ("char", "int8"),
        "u1": ("uchar", "uint8"),
        "i2": ("short", "int16"),
        "u2": ("ushort", "uint16"),
        "i4": ("int", "int32"),
        "u4": ("uint", "uint32"),
        "f4": ("float", "float32"),
        "f8": ("double", "float64"),
    }.items()
    for name in names
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class PlyProperty:
    """A column of an element: its name, its type, and the type of its list's length."""

    name: str
    dtype: str
    count_dtype: str | None


@dataclass(frozen=True, eq=False)
class PlyLists:
    """Lists of one property: their values end to end, and the length of each."""

    values: Array | Ints
    lengths: Ints


@dataclass(frozen=True, eq=False)
class PlyElement:
    """One element of the header with its rows, column by column."""

    name: str
    count: int
    properties: list[PlyProperty] = field(default_factory=list[PlyProperty])
    scalars: dict[str, Array] = field(default_factory=dict[str, Array])
    lists: dict[str, PlyLists] = field(default_factory=dict[str, PlyLists])


def read_header(data: bytes) -> tuple[str, list[PlyElement], bytes]:
    """Return the order of bytes (text: none), the elements, and what follows."""
    start = re.match(rb"ply[ \t]*(\r\n|\r|\n)", data)
    if start is None:
        raise FormatError("it has no PLY header")
    # A lone CR ends lines only where it ends the first; binary data may begin with LF.
    newline = start[1]
    end = re.search(newline + rb"end_header[ \t]*" + newline, data)
    if end is None:
        raise FormatError("it has no PLY header that ends")
    lines = data[start.end() : end.start()].decode("latin-1").split(newline.decode())
    order: str | None = None
    elements: list[PlyElement] = []
    for line in lines:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in _ORDERS:
            order = _ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isdecimal():
            elements.append(PlyElement(words[1], int(words[2])))
        elif words[0] == "property" and elements:
            elements[-1].properties.append(_property(words, line))
        else:
            raise FormatError(f"its header has the line '{shortened(line)}'")
    if order is None:
        raise FormatError("its header doesn't state the format")
    if len({element.name for element in elements}) != len(elements):
        raise FormatError("its header declares an element twice")
    for element in elements:
        columns = element.properties
        if len({c.name for c in columns}) < len(columns) or (
            element.count and not columns
        ):
            raise FormatError(
                f"its element '{shortened(element.name)}' has no or equal properties"
            )
    return order, elements, data[end.end() :]


def _property(words: list[str], line: str) -> PlyProperty:
    if len(words) == 3 and words[1] in _TYPES:
        return PlyProperty(words[2], _TYPES[words[1]], None)
    if len(words) == 5 and words[1] == "list" and words[3] in _TYPES:
        count = _TYPES.get(words[2], "f4")
        if not count.startswith("f"):
            return PlyProperty(words[4], _TYPES[words[3]], count)
    raise FormatError(f"its header has the line '{shortened(line)}'")


def shortened(text: str) -> str:
    """Return the begin of a text from a file, fit for a message."""
    return ascii(text.strip()[:60])[1:-1]
