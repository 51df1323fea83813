"""Strict readers of OBJ and OFF: a line that can't be understood is an error.

The reader library splits OBJ vertices along texture seams and reads past malformed
lines, which shifts or drops faces without a word; of an OFF file with wrapped lines it
keeps no face at all.
"""

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from .polygons import triangulate

# Free-form geometry that has no triangles to give.
_FREE_FORM = frozenset({"cstype", "curv", "curv2", "surf", "bmat", "bzp", "bsp", "cdc"})
_OFF_HEADER = re.compile(r"(ST|C|N|4|n)*OFF", re.ASCII)


class FormatError(Exception):
    """A file's content breaks the rules of its format; the reader names the file."""


def decode(data: bytes) -> str:
    """Return the text of a UTF-8, UTF-16 or Latin-1 file; its numbers are ASCII."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    return data.removeprefix(b"\xef\xbb\xbf").decode("latin-1")


def read_obj(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (n, 3) in file units and triangles (m, 3) of a Wavefront OBJ.

    Raises:
        FormatError: At the first line that can't be understood.
    """
    vertices: list[list[str]] = []
    polygons: list[list[int]] = []
    for number, words in _obj_lines(decode(data)):
        if words[0] == "v":
            if len(words) < 4:
                raise FormatError(f"line {number}: a vertex needs three numbers")
            vertices.append(words[1:4])
        elif words[0] == "f":
            polygons.append(_obj_polygon(number, words[1:], len(vertices)))
        elif words[0] in _FREE_FORM:
            raise FormatError(
                f"line {number}: free-form geometry ('{words[0]}') isn't triangles"
            )
    points = _numbers(vertices)
    return points, triangulate(points, _in_range(polygons, len(points)))


def _obj_lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield line numbers and words, backslash continuations joined."""
    held = ""
    for number, line in enumerate(text.splitlines(), 1):
        line = held + line.split("#", 1)[0].rstrip()
        if line.endswith("\\"):
            held = line[:-1] + " "
            continue
        held = ""
        words = line.split()
        if words:
            yield number, words


def _obj_polygon(number: int, words: Sequence[str], n_vertices: int) -> list[int]:
    if len(words) < 3:
        raise FormatError(
            f"line {number}: a face needs three corners, has {len(words)}"
        )
    try:
        corners = [int(word.split("/", 1)[0]) for word in words]
    except ValueError:
        raise FormatError(f"line {number}: a face's corner isn't a number") from None
    if 0 in corners:
        raise FormatError(f"line {number}: vertices count from 1, a face names 0")
    return [c - 1 if c > 0 else n_vertices + c for c in corners]


def read_off(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (n, 3) in file units and triangles (m, 3) of an OFF file.

    Lines may be wrapped anywhere if neither vertices nor faces carry extra columns.

    Raises:
        FormatError: If the counts of the header and the content disagree.
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
    lines = [words for line in text.splitlines() if (words := line.split())]
    try:
        n_vertices, n_faces = (int(word) for word in lines[0][:2])
        if not (n_vertices >= 0 and n_faces >= 0):
            raise ValueError
    except (IndexError, ValueError):
        raise FormatError("no line with the numbers of vertices and faces") from None
    found = _off_by_line(lines[1:], n_vertices, n_faces)
    if found is None:
        words = [word for line in lines for word in line]
        words = words[2 if len(lines[0]) == 2 else 3 :]
        found = _off_by_word(words, n_vertices, n_faces)
    if found is None:
        raise FormatError(
            f"the header promises {n_vertices} vertices and {n_faces} faces, "
            "the content holds something else"
        )
    points = _numbers(found[0])
    return points, triangulate(points, _in_range(found[1], len(points)))


_Parts = tuple[list[list[str]], list[list[int]]]


def _off_by_line(
    lines: list[list[str]], n_vertices: int, n_faces: int
) -> _Parts | None:
    """One vertex or face a line, extra columns ignored; None if the lines don't fit."""
    if len(lines) < n_vertices + n_faces:
        return None
    rows = lines[:n_vertices]
    if any(len(row) < 3 for row in rows):
        return None
    polygons: list[list[int]] = []
    for words in lines[n_vertices : n_vertices + n_faces]:
        try:
            count = int(words[0])
            corners = [int(word) for word in words[1 : count + 1]]
        except ValueError:
            return None
        if not (count >= 1 and len(corners) == count):
            return None
        polygons.append(corners)
    return [row[:3] for row in rows], polygons


def _off_by_word(words: list[str], n_vertices: int, n_faces: int) -> _Parts | None:
    """Read as one stream of words that must be used up exactly; else None."""
    rows = [words[i : i + 3] for i in range(0, 3 * n_vertices, 3)]
    at = 3 * n_vertices
    polygons: list[list[int]] = []
    try:
        for _ in range(n_faces):
            count = int(words[at])
            corners = [int(word) for word in words[at + 1 : at + 1 + count]]
            if not (count >= 1 and len(corners) == count):
                return None
            polygons.append(corners)
            at += 1 + count
    except (ValueError, IndexError):
        return None
    return (rows, polygons) if at == len(words) else None


def _numbers(rows: list[list[str]]) -> NDArray[np.float64]:
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise FormatError(f"a vertex isn't three numbers ({error})") from None


def _in_range(polygons: list[list[int]], n_vertices: int) -> list[list[int]]:
    for number, corners in enumerate(polygons, 1):
        if min(corners) < 0 or max(corners) >= n_vertices:
            raise FormatError(
                f"face {number} names a vertex that isn't there, of {n_vertices}"
            )
    return polygons
