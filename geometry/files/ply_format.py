"""Strict reader of PLY: every element is walked, every byte or word used up."""

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Ints

from .ply_header import PlyElement, PlyLists, PlyProperty, read_header, shortened
from .polygons import strip_triangles, triangulated
from .reading import FormatError, RawMesh, numbers, whole

_CORNERS = ("vertex_indices", "vertex_index")


def read_ply(data: bytes) -> RawMesh:
    """Return the faces of a PLY file, and the properties of faces and vertices."""
    order, elements, body = read_header(data)
    cursor = _Cursor(body, order)
    for element in elements:
        cursor.fill(element)
    cursor.finish()
    return _surface({element.name: element for element in elements})


def _surface(elements: dict[str, PlyElement]) -> RawMesh:
    if "vertex" not in elements:
        raise FormatError("its header declares no vertices")
    of_vertices = dict(elements["vertex"].scalars)
    if any(axis not in of_vertices for axis in "xyz"):
        raise FormatError("its vertices have no x, y and z")
    points = np.stack([of_vertices.pop(axis) for axis in "xyz"], axis=1)
    face = elements.get("face", PlyElement("face", 0))
    named = [elements[name] for name in elements if name.startswith("tristrip")]
    strips = named[0] if named else PlyElement("tristrips", 0)
    if strips.count and face.count:
        raise FormatError("it stores faces and triangle strips; keep one of them")
    if strips.count:
        faces = strip_triangles(_separated(_corners(strips), len(points)))
        threes = np.full(len(faces), 3, np.int64)
        return triangulated(points, threes, faces.reshape(-1), of_vertices)
    corners = _corners(face)
    if not np.all(corners.lengths >= 3):
        at = int(np.argmin(corners.lengths))
        raise FormatError(
            f"face {at + 1} has {corners.lengths[at]} corners, must have three or more"
        )
    values, lengths = whole(corners.values), corners.lengths
    return triangulated(points, lengths, values, of_vertices, face.scalars)


def _corners(element: PlyElement) -> PlyLists:
    """Return the one list of vertices that faces or strips have; none of no rows."""
    if not element.count:
        return PlyLists(np.empty(0, np.int64), np.empty(0, np.int64))
    named = [element.lists[name] for name in _CORNERS if name in element.lists]
    if len(named) != 1:
        raise FormatError(f"its element '{element.name}' has no list vertex_indices")
    return named[0]


def _separated(strips: PlyLists, n_vertices: int) -> Ints:
    """Return the strips of all rows end to end, -1 between them as within a row."""
    values = whole(strips.values)
    outside = np.flatnonzero((values < -1) | (values >= n_vertices))
    if len(outside):
        raise FormatError(
            f"a triangle strip names vertex {values[outside[0]]}, of {n_vertices}"
        )
    return np.insert(values, np.cumsum(strips.lengths)[:-1], -1)


class _Cursor:
    """Takes the rows of one element after the other; text as if it were float64."""

    def __init__(self, body: bytes, order: str) -> None:
        self._order = order
        self._words = body.decode("latin-1").split() if order == "" else []
        self._body = body if order else numbers(self._words).tobytes()
        self._at = 0

    def fill(self, element: PlyElement) -> None:
        places = self._places(element, self._at)[0] if element.count else {}
        lists = (p.name for p in element.properties if p.count_dtype is not None)
        lengths = {name: places[name][1] for name in lists if places}
        dtype = self._row_type(element, lengths)
        table = np.empty(0, dtype)
        if self._left() >= element.count * dtype.itemsize:
            table = np.frombuffer(self._body, dtype, element.count, self._at)
        elif not lengths:
            raise self._short_of(element)
        if len(table) < element.count or any(
            np.any(table[f"n {name}"] != n) for name, n in lengths.items()
        ):
            self._row_by_row(element)
            return
        self._at += element.count * dtype.itemsize
        for p in element.properties:
            lists = np.full(element.count, lengths.get(p.name, 0), np.int64)
            _store(element, p, table[p.name].reshape(-1), lists)

    def finish(self) -> None:
        rest = self._body[self._at :].strip(b" \t\r\n") if self._order else b""
        extra = len(rest) if self._order else self._left() // 8
        if extra:
            raise FormatError(
                f"it holds {extra} {self._unit} more than its header says"
            )

    @property
    def _unit(self) -> str:
        return "bytes" if self._order else "numbers"

    def _left(self) -> int:
        return len(self._body) - self._at

    def _type(self, code: str) -> np.dtype:
        return np.dtype(self._order + code if self._order else "f8")

    def _row_type(self, element: PlyElement, lengths: dict[str, int]) -> np.dtype:
        columns: list[tuple[str, np.dtype] | tuple[str, np.dtype, tuple[int]]] = []
        for p in element.properties:
            if p.count_dtype is None:
                columns.append((p.name, self._type(p.dtype)))
            else:
                n = lengths.get(p.name, 0)
                columns.append((f"n {p.name}", self._type(p.count_dtype)))
                columns.append((p.name, self._type(p.dtype), (n,)))
        return np.dtype(columns)

    def _places(
        self, element: PlyElement, at: int
    ) -> tuple[dict[str, tuple[int, int]], int]:
        """Where each property of a row begins and how many values it has; the end."""
        places: dict[str, tuple[int, int]] = {}
        for p in element.properties:
            length = 1
            if p.count_dtype is not None:
                length = self._length(element, p.count_dtype, at)
                at += self._type(p.count_dtype).itemsize
            places[p.name] = at, length
            at += length * self._type(p.dtype).itemsize
        return places, at

    def _length(self, element: PlyElement, code: str, at: int) -> int:
        end = at + self._type(code).itemsize
        if end > len(self._body):
            raise self._short_of(element)
        if self._order:
            length = int(np.frombuffer(self._body, self._type(code), 1, at)[0])
        else:
            word = self._words[at // 8]
            if not (word.isascii() and word.isdecimal() and len(word) < 10):
                raise FormatError(f"the length of a list is '{shortened(word)}'")
            length = int(word)
        if not 0 <= length <= len(self._body) - end:
            raise self._short_of(element)
        return length

    def _row_by_row(self, element: PlyElement) -> None:
        at, rows = self._at, list[dict[str, tuple[int, int]]]()
        for _ in range(element.count):
            places, at = self._places(element, at)
            if at > len(self._body):
                raise self._short_of(element)
            rows.append(places)
        self._at = at
        for p in element.properties:
            dtype = self._type(p.dtype)
            begins, lengths = np.array([row[p.name] for row in rows], np.int64).T
            values = [
                self._body[a : a + n * dtype.itemsize]
                for a, n in zip(begins.tolist(), lengths.tolist(), strict=True)
            ]
            _store(element, p, np.frombuffer(b"".join(values), dtype), lengths)

    def _short_of(self, element: PlyElement) -> FormatError:
        rest = self._left() // (1 if self._order else 8)
        return FormatError(
            f"it is cut short: {element.count} rows of '{shortened(element.name)}' "
            f"don't fit into the {rest} {self._unit} left"
        )


def _store(
    element: PlyElement, p: PlyProperty, values: NDArray[np.generic], lengths: Ints
) -> None:
    """Keep a column, in the widest type of its kind."""
    if p.count_dtype is None:
        element.scalars[p.name] = values.astype(np.float64)
    elif values.dtype.kind == "f":
        element.lists[p.name] = PlyLists(values.astype(np.float64), lengths)
    else:
        element.lists[p.name] = PlyLists(values.astype(np.int64), lengths)
