"""Strict readers of OBJ and OFF: a line that can't be understood is an error."""

import re
from collections.abc import Iterator, Sequence

from geometry.arrays import Array

from .polygons import end_to_end, triangulated
from .reading import FormatError, RawMesh, decode, numbers

# Free-form geometry that has no triangles to give.
_FREE_FORM = frozenset({"cstype", "curv", "curv2", "surf", "bmat", "bzp", "bsp", "cdc"})
# An unknown word may be a damaged v or f, and leaving out one shifts all that follow.
_NO_GEOMETRY = frozenset(
    "vt vn vp vc p l g o s mg usemtl mtllib usemap maplib lod bevel c_interp d_interp "
    "shadow_obj trace_obj ctech stech deg step parm trim hole scrv sp end con".split()
)
# What these bring in can't be known here.
_ELSEWHERE = frozenset({"call", "csh"})
# Names of files and groups; of these a backslash at the end is part.
_NAMES = frozenset({"mtllib", "usemtl", "maplib", "usemap", "g", "o"})
# "v" and x y z, with a weight, a colour, or both.
_VERTEX_COLUMNS = (4, 5, 7, 8)
_MOST = 1 << 60
_OFF_HEADER = re.compile(r"(ST|C|N|4|n)*OFF", re.ASCII)


def _whole(word: str) -> int:
    """Return a whole number; ValueError if it isn't written in plain digits."""
    if not (word.isascii() and word.lstrip("+-").isdecimal()):
        raise ValueError(word)
    # More than any file counts to, and an array still holds it.
    return min(max(int(word), -_MOST), _MOST)


def _lines(text: str) -> list[str]:
    # str.splitlines also breaks at bytes that are part of a UTF-8 letter.
    return re.split(r"\r\n|\r|\n", text)


def read_obj(data: bytes) -> RawMesh:
    """Return the surface that a Wavefront OBJ stores."""
    vertices: list[list[str]] = []
    polygons: list[list[int]] = []
    for number, words in _obj_lines(decode(data)):
        if words[0] == "v":
            if len(words) not in _VERTEX_COLUMNS:
                least = "needs three" if len(words) < 4 else f"has {len(words) - 1}"
                raise FormatError(f"line {number}: a vertex {least} numbers")
            numbers(words[4:])
            vertices.append(words[1:4])
        elif words[0] == "f":
            polygons.append(_obj_polygon(number, words[1:], len(vertices)))
        elif words[0] not in _NO_GEOMETRY:
            raise FormatError(f"line {number}: {_refusal(words[0])}")
    return triangulated(_points(vertices), *end_to_end(polygons))


def _refusal(word: str) -> str:
    if word in _FREE_FORM:
        return f"free-form geometry ('{word}') isn't triangles"
    if word in _ELSEWHERE:
        return (
            f"'{word}' brings in another file or program's output; export the mesh "
            "as one file"
        )
    return f"'{ascii(word[:20])[1:-1]}' isn't known in OBJ"


def _obj_lines(text: str) -> Iterator[tuple[int, list[str]]]:
    held = ""
    lines = _lines(text)
    for number, line in enumerate(lines, 1):
        line = held + line.split("#", 1)[0].rstrip()
        words = line.split()
        held = ""
        if line.endswith("\\") and words[0] not in _NAMES:
            # At the end of the file there is nothing to go on with.
            if number < len(lines):
                held = line[:-1] + " "
                continue
            words = line[:-1].split()
        if words:
            yield number, words


def _obj_polygon(number: int, words: Sequence[str], n_vertices: int) -> list[int]:
    if len(words) < 3:
        raise FormatError(
            f"line {number}: a face needs three corners, has {len(words)}"
        )
    try:
        corners = [_whole(word.split("/", 1)[0]) for word in words]
    except ValueError:
        raise FormatError(f"line {number}: a face's corner isn't a number") from None
    if 0 in corners:
        raise FormatError(f"line {number}: vertices count from 1, a face names 0")
    return [c - 1 if c > 0 else n_vertices + c for c in corners]


def read_off(data: bytes) -> RawMesh:
    """Return the surface that an OFF file stores.

    Lines may be wrapped anywhere if neither vertices nor faces carry extra columns.
    """
    text = re.sub(r"#[^\r\n]*", "", decode(data)).strip()
    header = _OFF_HEADER.match(text)
    if header is None or header[0].startswith(("4", "n")):
        raise FormatError(
            "the header must be OFF, COFF, NOFF or STOFF in three dimensions"
        )
    text = text[header.end() :]
    if re.match(r"\s*BINARY", text):
        raise FormatError("binary OFF isn't supported")
    lines = [words for line in _lines(text) if (words := line.split())]
    try:
        n_vertices, n_faces = (_whole(word) for word in lines[0][:2])
        if not (n_vertices >= 0 and n_faces >= 0):
            raise ValueError
    except (IndexError, ValueError):
        raise FormatError("no line with the numbers of vertices and faces") from None
    header_words = lines[0][2 if len(lines[0]) == 2 else 3 :]
    whole_text = [word for line in [header_words, *lines[1:]] for word in line]
    by_line = _without_extras(lines[1:], n_vertices, n_faces)
    for stream in (by_line, whole_text):
        stored = None if stream is None else _off_stream(stream, n_vertices, n_faces)
        if stored is not None:
            return triangulated(_points(stored[0]), *end_to_end(stored[1]))
    raise FormatError(
        f"the header promises {n_vertices} vertices and {n_faces} faces, "
        "the content holds something else"
    )


def _without_extras(
    lines: list[list[str]], n_vertices: int, n_faces: int
) -> list[str] | None:
    """Words of one vertex or face a line; None if the lines don't fit."""
    vertices, faces = lines[:n_vertices], lines[n_vertices:]
    # Colours and normals stand behind every vertex or behind none.
    widths = {len(line) for line in vertices}
    if (
        len(lines) != n_vertices + n_faces
        or len(widths) > 1
        or min(widths, default=3) < 3
    ):
        return None
    words = [word for line in vertices for word in line[:3]]
    for line in faces:
        end = 1 + int(line[0]) if line[0].lstrip("+").isdecimal() else 0
        if not 3 < end <= len(line):
            return None
        words += line[:end]
    return words


def _off_stream(
    words: list[str], n_vertices: int, n_faces: int
) -> tuple[list[list[str]], list[list[int]]] | None:
    """Points and polygons of words that must be used up exactly; else None."""
    if 3 * n_vertices + 4 * n_faces > len(words):
        return None
    points = [words[i : i + 3] for i in range(0, 3 * n_vertices, 3)]
    at = 3 * n_vertices
    polygons: list[list[int]] = []
    try:
        for _ in range(n_faces):
            count = _whole(words[at])
            corners = [_whole(word) for word in words[at + 1 : at + 1 + count]]
            if not (count >= 3 and len(corners) == count):
                return None
            polygons.append(corners)
            at += 1 + count
    except (ValueError, IndexError):
        return None
    return (points, polygons) if at == len(words) else None


def _points(rows: list[list[str]]) -> Array:
    return numbers([word for row in rows for word in row]).reshape(-1, 3)
