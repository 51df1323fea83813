"""Entries of an OpenCV FileStorage in XML or YAML, read strictly and by ourselves."""

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from geometry.arrays import Array
from geometry.files.file_content import file_content
from planning.model.errors import InputError
from planning.model.files import reading

# Calibrations take a few kilobytes.
_LARGEST = 1 << 20
# A key at the left margin, then its value or lines that are indented below it.
_ENTRY = re.compile(r"^([A-Za-z_][\w-]*)[ \t]*:([^\n]*)\n((?:[ \t]+[^\n]*\n)*)", re.M)
_INSIDE = re.compile(r"\b(rows|cols)[ \t]*:[ \t]*(\d{1,4})\b")
_DATA = re.compile(r"\bdata[ \t]*:[ \t]*\[([^\]]*)\]")


def opencv_matrices(path: Path, error: type[InputError]) -> dict[str, Array]:
    """Return the matrices that a file holds by their names, shape (rows, cols).

    Raises:
        InputError: Of the kind `error`; it says in one line what is wrong.
    """
    with reading(path, error):
        content = file_content(path)
    try:
        if len(content) > _LARGEST:
            raise ValueError("is no calibration: it is larger than a megabyte")
        text = content.decode()
        found = _xml(text) if text.lstrip().startswith("<") else _yaml(text)
        return {name: _matrix(name, *parts) for name, parts in found.items()}
    except ValueError as fault:
        raise error(f"{path}: {fault}") from None


def _matrix(name: str, rows: int, cols: int, words: str) -> Array:
    try:
        numbers = [float(word) for word in words.replace(",", " ").split()]
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if len(numbers) != rows * cols:
        raise ValueError(
            f"{name} has {len(numbers)} values, rows x cols is {rows * cols}"
        )
    if not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"{name} = {numbers} must be finite")
    return np.array(numbers).reshape(rows, cols)


def _yaml(text: str) -> dict[str, tuple[int, int, str]]:
    text = text.replace("\r\n", "\n") + "\n"
    found: dict[str, tuple[int, int, str]] = {}
    for key, _, below in _ENTRY.findall(text):
        shape, data = dict(_INSIDE.findall(below)), _DATA.search(below)
        if "rows" in shape and "cols" in shape and data:
            _keep(found, key, (int(shape["rows"]), int(shape["cols"]), data[1]))
    return found


def _xml(text: str) -> dict[str, tuple[int, int, str]]:
    if "<!DOCTYPE" in text:
        raise ValueError("has a document type, which no calibration needs")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"not XML ({error}); correct that place") from None
    found: dict[str, tuple[int, int, str]] = {}
    for node in root:
        rows, cols = ((node.findtext(key) or "").strip() for key in ("rows", "cols"))
        if all(n.isascii() and n.isdigit() and len(n) < 5 for n in (rows, cols)):
            _keep(found, node.tag, (int(rows), int(cols), node.findtext("data") or ""))
    return found


def _keep(
    found: dict[str, tuple[int, int, str]], key: str, parts: tuple[int, int, str]
) -> None:
    if key in found:
        raise ValueError(f"says {key} twice; keep one")
    found[key] = parts
