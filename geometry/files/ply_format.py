"""Strict reader of PLY: every element is walked, every byte or word used up.

General readers take the first list length for all of an element's rows, or give points
where a file stores strips; a mesh whose rows don't fit its header is refused here.
"""

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .text_formats import FormatError, numbers, whole

_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class PlyProperty:
    """A column of an element: its name, its type, and the type of its list's length."""

    name: str
    dtype: str
    count_dtype: str | None


@dataclass(frozen=True, eq=False)
class PlyList:
    """Lists of one property: their values end to end, and the length of each."""

    values: NDArray[np.float64] | NDArray[np.int64]
    lengths: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Polygons:
    """Vertex numbers at the corners of all faces end to end, and each face's count."""

    values: NDArray[np.int64]
    lengths: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PlyElement:
    """One element of the header with its rows, column by column.

    Attributes:
        count: Number of rows.
        scalars: Values of each plain property, shape (count,).
        lists: Values of each list property.
    """

    name: str
    count: int
    properties: tuple[PlyProperty, ...]
    scalars: dict[str, NDArray[np.float64]] = field(
        default_factory=dict[str, NDArray[np.float64]]
    )
    lists: dict[str, PlyList] = field(default_factory=dict[str, PlyList])


def read_ply(data: bytes) -> dict[str, PlyElement]:
    """Return every element of a PLY file.

    Raises:
        FormatError: If the header can't be understood, or what follows it isn't exactly
            what it promises.
    """
    order, elements, body = _header(data)
    rows = _TextRows(body) if order == "" else _BinaryRows(body, order)
    for element in elements:
        rows.fill(element)
    rows.finish()
    return {element.name: element for element in elements}


def ply_surface(
    elements: dict[str, PlyElement],
) -> tuple[NDArray[np.float64], Polygons]:
    """Return positions (n, 3) in file units and the corners of every face.

    Raises:
        FormatError: If there are no positions, or faces are stored as something else.
    """
    if any(name.startswith("tristrip") for name in elements):
        raise FormatError("it stores triangle strips, which aren't read; store faces")
    vertex = elements.get("vertex")
    if vertex is None:
        raise FormatError("its header declares no vertices")
    if any(axis not in vertex.scalars for axis in "xyz"):
        raise FormatError("its vertices have no x, y and z")
    points = np.stack([vertex.scalars[axis] for axis in "xyz"], axis=1)
    face = elements.get("face")
    if face is None or face.count == 0:
        return points, Polygons(np.empty(0, np.int64), np.empty(0, np.int64))
    named = [face.lists[name] for name in _CORNERS if name in face.lists]
    if len(named) != 1:
        raise FormatError("its faces have no list vertex_indices")
    corners = named[0]
    if not np.all(corners.lengths >= 3):
        at = int(np.argmin(corners.lengths))
        raise FormatError(
            f"face {at + 1} has {corners.lengths[at]} corners, must have three or more"
        )
    return points, Polygons(whole(corners.values), corners.lengths)


def _header(data: bytes) -> tuple[str, list[PlyElement], bytes]:
    found = re.match(rb"ply[ \t]*(\r\n|\r|\n)", data)
    if found is None:
        raise FormatError("it has no PLY header")
    # A lone CR ends lines only where it ends the first; binary data may begin with LF.
    newline = found[1]
    end = re.search(newline + rb"end_header[ \t]*" + newline, data)
    if end is None:
        raise FormatError("it has no PLY header that ends")
    lines = data[found.end() : end.start()].decode("latin-1").split(newline.decode())
    order: str | None = None
    names: list[tuple[str, int]] = []
    properties: list[list[PlyProperty]] = []
    for line in lines:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in _ORDERS:
            order = _ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isdecimal():
            names.append((words[1], int(words[2])))
            properties.append([])
        elif words[0] == "property" and properties:
            properties[-1].append(_property(words, line))
        else:
            raise FormatError(f"its header has the line '{_short(line)}'")
    if order is None:
        raise FormatError("its header doesn't state the format")
    if len({name for name, _ in names}) != len(names):
        raise FormatError("its header declares an element twice")
    elements: list[PlyElement] = []
    for (name, count), columns in zip(names, properties, strict=True):
        if len({c.name for c in columns}) != len(columns) or (count and not columns):
            raise FormatError(
                f"its element '{_short(name)}' has no or equal properties"
            )
        elements.append(PlyElement(name, count, tuple(columns)))
    return order, elements, data[end.end() :]


def _property(words: list[str], line: str) -> PlyProperty:
    if len(words) == 3 and words[1] in _TYPES:
        return PlyProperty(words[2], _TYPES[words[1]], None)
    if len(words) == 5 and words[1] == "list" and words[3] in _TYPES:
        count = _TYPES.get(words[2], "f4")
        if not count.startswith("f"):
            return PlyProperty(words[4], _TYPES[words[3]], count)
    raise FormatError(f"its header has the line '{_short(line)}'")


def _short(text: str) -> str:
    return ascii(text.strip()[:60])[1:-1]


class _Rows(ABC):
    """Takes the rows of one element after the other.

    Lists are tried at the lengths that those of the first row have, all rows at once;
    where they differ, row by row.
    """

    _unit: str

    def fill(self, element: PlyElement) -> None:
        if element.count == 0:
            _store(element, {}, {})
            return
        lengths = self._first_lengths(element)
        columns = self._alike(element, lengths)
        if columns is not None:
            _store(element, columns, lengths)
        elif lengths:
            self._row_by_row(element)
        else:
            raise self._short_of(element)

    @abstractmethod
    def finish(self) -> None:
        """Refuse what is left behind the last element."""

    @abstractmethod
    def _left(self) -> int:
        """How much isn't taken yet."""

    @abstractmethod
    def _first_lengths(self, element: PlyElement) -> dict[str, int]:
        """Lengths of the lists of the first row."""

    @abstractmethod
    def _alike(
        self, element: PlyElement, lengths: dict[str, int]
    ) -> dict[str, NDArray[Any]] | None:
        """Take all rows as columns; None if lists differ or it is too short."""

    @abstractmethod
    def _row_by_row(self, element: PlyElement) -> None:
        """Take rows whose lists differ in length."""

    def _short_of(self, element: PlyElement) -> FormatError:
        return FormatError(
            f"it is cut short: {element.count} rows of '{_short(element.name)}' don't "
            f"fit into the {self._left()} {self._unit} left"
        )


class _BinaryRows(_Rows):
    """Rows of binary data."""

    _unit = "bytes"

    def __init__(self, body: bytes, order: str) -> None:
        self._body = body
        self._order = order
        self._at = 0

    def _alike(
        self, element: PlyElement, lengths: dict[str, int]
    ) -> dict[str, NDArray[Any]] | None:
        dtype = self._dtype(element, lengths)
        if self._left() >= element.count * dtype.itemsize:
            table = np.frombuffer(self._body, dtype, element.count, self._at)
            if all(np.all(table[f"n {k}"] == n) for k, n in lengths.items()):
                self._at += element.count * dtype.itemsize
                return {p.name: table[p.name] for p in element.properties}
        return None

    def finish(self) -> None:
        rest = self._body[self._at :].strip(b" \t\r\n")
        if rest:
            raise FormatError(f"it holds {len(rest)} bytes more than its header says")

    def _left(self) -> int:
        return len(self._body) - self._at

    def _first_lengths(self, element: PlyElement) -> dict[str, int]:
        lengths: dict[str, int] = {}
        at = self._at
        for p in element.properties:
            if p.count_dtype is None:
                at += np.dtype(p.dtype).itemsize
                continue
            lengths[p.name] = self._length(element, p.count_dtype, at)
            at += np.dtype(p.count_dtype).itemsize
            at += lengths[p.name] * np.dtype(p.dtype).itemsize
        return lengths

    def _length(self, element: PlyElement, dtype: str, at: int) -> int:
        if at + np.dtype(dtype).itemsize > len(self._body):
            raise self._short_of(element)
        length = int(np.frombuffer(self._body, self._order + dtype, 1, at)[0])
        if not 0 <= length <= len(self._body) - at:
            raise self._short_of(element)
        return length

    def _dtype(self, element: PlyElement, lengths: dict[str, int]) -> np.dtype:
        columns: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        for p in element.properties:
            if p.count_dtype is None:
                columns.append((p.name, self._order + p.dtype))
            else:
                columns.append((f"n {p.name}", self._order + p.count_dtype))
                columns.append((p.name, self._order + p.dtype, (lengths[p.name],)))
        return np.dtype(columns)

    def _row_by_row(self, element: PlyElement) -> None:
        begin = self._at
        where: dict[str, list[tuple[int, int]]] = {
            p.name: [] for p in element.properties
        }
        sizes = [
            (p, np.dtype(p.dtype).itemsize, np.dtype(p.count_dtype or "i1").itemsize)
            for p in element.properties
        ]
        at = begin
        for _ in range(element.count):
            for p, size, count_size in sizes:
                length = 1
                if p.count_dtype is not None:
                    length = self._length(element, p.count_dtype, at)
                    at += count_size
                where[p.name].append((at, length))
                at += length * size
            if at > len(self._body):
                raise self._short_of(element)
        self._at = at
        for p in element.properties:
            dtype = np.dtype(self._order + p.dtype)
            parts = [self._body[a : a + n * dtype.itemsize] for a, n in where[p.name]]
            values = np.frombuffer(b"".join(parts), dtype)
            if p.count_dtype is None:
                element.scalars[p.name] = values.astype(np.float64)
            else:
                element.lists[p.name] = PlyList(
                    _wide(values), np.array([n for _, n in where[p.name]], np.int64)
                )


class _TextRows(_Rows):
    """Rows of words, wrapped anyhow."""

    _unit = "numbers"

    def __init__(self, body: bytes) -> None:
        self._words = body.decode("latin-1").split()
        self._at = 0

    def _alike(
        self, element: PlyElement, lengths: dict[str, int]
    ) -> dict[str, NDArray[Any]] | None:
        width = sum(1 + lengths.get(p.name, 0) for p in element.properties)
        end = self._at + element.count * width
        if end <= len(self._words):
            table = numbers(self._words[self._at : end]).reshape(-1, width)
            columns: dict[str, NDArray[np.float64]] = {}
            at, even = 0, True
            for p in element.properties:
                if p.count_dtype is None:
                    columns[p.name] = table[:, at]
                    at += 1
                else:
                    n = lengths[p.name]
                    even &= bool(np.all(table[:, at] == n))
                    columns[p.name] = table[:, at + 1 : at + 1 + n]
                    at += 1 + n
            if even:
                self._at = end
                return columns
        return None

    def finish(self) -> None:
        if self._left():
            raise FormatError(
                f"it holds {self._left()} numbers more than its header says"
            )

    def _left(self) -> int:
        return len(self._words) - self._at

    def _first_lengths(self, element: PlyElement) -> dict[str, int]:
        lengths: dict[str, int] = {}
        at = self._at
        for p in element.properties:
            if p.count_dtype is not None:
                lengths[p.name] = self._length(element, at)
                at += lengths[p.name]
            at += 1
        return lengths

    def _length(self, element: PlyElement, at: int) -> int:
        word = self._words[at] if at < len(self._words) else ""
        if not (word.isascii() and word.isdecimal() and len(word) < 10):
            if not word:
                raise self._short_of(element)
            raise FormatError(f"the length of a list is '{_short(word)}'")
        if int(word) > len(self._words) - at - 1:
            raise self._short_of(element)
        return int(word)

    def _row_by_row(self, element: PlyElement) -> None:
        where: dict[str, list[str]] = {p.name: [] for p in element.properties}
        lengths: dict[str, list[int]] = {p.name: [] for p in element.properties}
        at = self._at
        for _ in range(element.count):
            for p in element.properties:
                length = 1
                if p.count_dtype is not None:
                    length = self._length(element, at)
                    lengths[p.name].append(length)
                    at += 1
                where[p.name] += self._words[at : at + length]
                at += length
            if at > len(self._words):
                raise self._short_of(element)
        self._at = at
        for p in element.properties:
            values = numbers(where[p.name])
            if p.count_dtype is None:
                element.scalars[p.name] = values
            else:
                element.lists[p.name] = PlyList(
                    values, np.array(lengths[p.name], np.int64)
                )


def _store(
    element: PlyElement,
    columns: dict[str, NDArray[Any]],
    lengths: dict[str, int],
) -> None:
    """Keep the columns of an element whose lists are equally long."""
    for p in element.properties:
        values = columns.get(p.name, np.empty(0))
        if p.count_dtype is None:
            element.scalars[p.name] = values.astype(np.float64)
        else:
            element.lists[p.name] = PlyList(
                _wide(values).reshape(-1),
                np.full(element.count, lengths.get(p.name, 0), np.int64),
            )


def _wide(values: NDArray[np.generic]) -> NDArray[np.float64] | NDArray[np.int64]:
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    return values.astype(np.int64)
