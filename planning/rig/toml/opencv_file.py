"""Intrinsics as OpenCV writes them: FileStorage in YAML or XML, or ROS camera_info.

Read strictly and by ourselves: of a file two matrices and the image's size count.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from geometry.files.file_content import file_content
from planning.model.errors import RigError
from planning.model.files import reading

# Calibrations take a few kilobytes.
_LARGEST = 1 << 20
_MATRIX, _DISTORTION = "cameramatrix", "distortioncoefficients"
_WIDTH, _HEIGHT = "imagewidth", "imageheight"
_OTHER_NAMES = {"distcoeffs": _DISTORTION, "distortion": _DISTORTION}
_SHOWN = {_MATRIX: "camera_matrix", _DISTORTION: "distortion_coefficients"}
_PLAIN_MODELS = ("", "plumb_bob", "radtan")
# A key at the left margin, then its value or lines that are indented below it.
_ENTRY = re.compile(r"^([A-Za-z_][\w-]*)[ \t]*:([^\n]*)\n((?:[ \t]+[^\n]*\n)*)", re.M)
_INSIDE = re.compile(r"\b(rows|cols)[ \t]*:[ \t]*(\d{1,4})\b")
_DATA = re.compile(r"\bdata[ \t]*:[ \t]*\[([^\]]*)\]")
_Matrix = tuple[int, int, list[float]]


@dataclass(frozen=True)
class Intrinsics:
    """K, lens and size of a calibrated image, and what else its file says.

    Attributes:
        focal_px: f_x, f_y [px].
        principal_point_px: c_x, c_y [px].
        distortion: k1, k2, p1, p2, k3.
        resolution_px: Width and height.
        source: Where it was read, for the rig's sources.
    """

    focal_px: list[float]
    principal_point_px: list[float]
    distortion: list[float]
    resolution_px: list[int]
    source: str

    def figures(self) -> dict[str, Any]:
        """Return them as a rig file's device table has them, each with its source."""
        figures: dict[str, Any] = {
            key: value for key, value in vars(self).items() if key != "source"
        }
        return {**figures, "sources": dict.fromkeys(figures, self.source)}


def read_intrinsics(path: Path) -> Intrinsics:
    """Read a camera's calibration.

    Raises:
        RigError: It says in one line what the file lacks or holds instead.
    """
    with reading(path, RigError, absent="; it is looked for beside the rig file"):
        content = file_content(path)
    try:
        if len(content) > _LARGEST:
            raise ValueError("is no calibration: it is larger than a megabyte")
        text = content.decode()
        entries = _xml(text) if text.lstrip().startswith("<") else _yaml(text)
        return _intrinsics(entries, path.name)
    except ValueError as error:
        raise RigError(f"{path}: {error}") from None


def _intrinsics(entries: Mapping[str, object], name: str) -> Intrinsics:
    lacking = [_SHOWN[key] for key in _SHOWN if key not in entries]
    size = [_whole(entries.get(key)) for key in (_WIDTH, _HEIGHT)]
    if None in size:
        lacking.append("image_width and image_height")
    if lacking:
        raise ValueError(
            f"lacks {', '.join(lacking)}; save what OpenCV's calibrateCamera gave, as "
            f"its calibration sample does"
        )
    model = str(entries.get("distortionmodel", "")).strip("\"' ")
    fisheye = entries.get("fisheyemodel", "0")
    if model not in _PLAIN_MODELS or _whole(fisheye) != 0:
        raise ValueError(
            f"is of the lens model {model or 'fisheye'!r}; only k1, k2, p1, p2, k3 of "
            f"calibrateCamera (plumb_bob) are known here, calibrate with these"
        )
    focal, centre = _pinhole(_matrix(entries, _MATRIX))
    words = [f"read: {name}, OpenCV calibration"]
    when, error = entries.get("calibrationtime"), entries.get("avgreprojectionerror")
    if isinstance(when, str):
        words.append("of " + when.strip("\"' "))
    if isinstance(error, str):
        words.append(f"with a reprojection error of {error.strip()} px")
    return Intrinsics(
        focal,
        centre,
        _five(_matrix(entries, _DISTORTION)),
        [side for side in size if side is not None],
        " ".join(words),
    )


def _pinhole(matrix: _Matrix) -> tuple[list[float], list[float]]:
    rows, cols, k = matrix
    if (rows, cols) != (3, 3):
        raise ValueError(f"camera_matrix is {rows} x {cols}, must be 3 x 3")
    plain = [k[1], k[3], k[6], k[7], k[8]] == [0.0, 0.0, 0.0, 0.0, 1.0]
    if not (plain and k[0] > 0.0 and k[4] > 0.0):
        raise ValueError(
            f"camera_matrix = {k} must be fx, 0, cx, 0, fy, cy, 0, 0, 1 in px, without "
            f"skew"
        )
    return [k[0], k[4]], [k[2], k[5]]


def _five(matrix: _Matrix) -> list[float]:
    values = matrix[2]
    if len(values) not in (4, 5) and (len(values) < 4 or any(values[5:])):
        raise ValueError(
            f"distortion_coefficients has {len(values)} values; only 4 or 5 (k1, k2, "
            f"p1, p2, k3) are known here: rational, thin-prism and tilted models bend "
            f"rays otherwise. Calibrate without CALIB_RATIONAL_MODEL and its like"
        )
    return [*values, 0.0][:5]


def _matrix(entries: Mapping[str, object], key: str) -> _Matrix:
    value = entries[key]
    if not isinstance(value, tuple):
        raise ValueError(f"{_SHOWN[key]} must be a matrix with rows, cols and data")
    rows, cols, words = value
    try:
        numbers = [float(word) for word in words.replace(",", " ").split()]
    except ValueError as error:
        raise ValueError(f"{_SHOWN[key]}: {error}") from None
    if not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"{_SHOWN[key]} = {numbers} must be finite")
    if len(numbers) != rows * cols:
        raise ValueError(
            f"{_SHOWN[key]} has {len(numbers)} values, rows x cols is {rows * cols}"
        )
    return rows, cols, numbers


def _whole(value: object) -> int | None:
    text = value.strip() if isinstance(value, str) else ""
    return int(text) if text.isascii() and text.isdigit() and len(text) < 7 else None


def _yaml(text: str) -> dict[str, object]:
    text = text.replace("\r\n", "\n") + "\n"
    entries: dict[str, object] = {}
    for key, value, below in _ENTRY.findall(text):
        shape, data = dict(_INSIDE.findall(below)), _DATA.search(below)
        if "rows" in shape and "cols" in shape and data:
            found: object = int(shape["rows"]), int(shape["cols"]), data[1]
        else:
            found = value.strip()
        _keep(entries, key, found)
    return entries


def _xml(text: str) -> dict[str, object]:
    if "<!DOCTYPE" in text:
        raise ValueError("has a document type, which no calibration needs")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"not XML ({error}); correct that place") from None
    entries: dict[str, object] = {}
    for node in root:
        rows, cols = (_whole(node.findtext(key)) for key in ("rows", "cols"))
        found: object = (node.text or "").strip()
        if rows is not None and cols is not None:
            found = rows, cols, node.findtext("data") or ""
        _keep(entries, node.tag, found)
    return entries


def _keep(entries: dict[str, object], key: str, found: object) -> None:
    name = key.replace("_", "").replace("-", "").lower()
    name = _OTHER_NAMES.get(name, name)
    if name in entries and name in (_MATRIX, _DISTORTION, _WIDTH, _HEIGHT):
        raise ValueError(f"says {key} twice; keep one")
    entries[name] = found
