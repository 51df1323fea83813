"""`patterns/`: what each projector of a plan shows, ready to be projected.

Edges are anti-aliased, in light: `patterns/panel.py` says how, and grey levels follow
by the projector's response.
"""

import json
import zlib
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from geometry.files.file_content import file_content
from planning.model.errors import CapturesError
from planning.model.files import write_together
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.patterns.panel import PanelCanvas, frame_levels
from planning.verify.reconstruction.patterns.ring_patterns import Frame

from .scanner import Scanner

FOLDER = "patterns"
_Made = TypeVar("_Made")
_MANIFEST = "sequence.json"
_SECTION = "ringrig-patterns"
_NOTES = {
    "order": "projector by projector as listed, all others dark; each in its frames' "
    "order; every camera records every frame but another camera's root frames",
    "exposure": "one exposure and gain for all frames of a projector and a camera, so "
    "that white isn't saturated: the decoder compares (I - inverse) / (white - black)",
    "grey": "levels whose light, by each projector's response (light of levels 0 to "
    "255), is the share of white that a pixel is meant to get; an edge lies where a "
    "frame and its inverse are equally bright. One image pixel to one projector pixel: "
    "no scaling, no keystone correction, no sharpening",
    "index": "annulus k lies between ring_radii[k - 1] and ring_radii[k]; its code is "
    "k ^ (k >> 1), of which bit b is bright in the frame with that bit",
    "flipping_bit": "bit whose frames change across each ring edge",
    "root": "bright where r.m > 0, with the viewing ray r of that camera and the ring "
    "normal m: which of two points of a ring it sees",
}
_DENSE_NOTES = {
    **{key: _NOTES[key] for key in ("exposure", "grey")},
    "order": "projector by projector as listed, all others dark; each in its frames' "
    "order, that of OpenCV's GrayCodePattern with white, black and sinusoids behind "
    "it; every camera records every frame",
    "index": "stripe g holds the columns (or rows) finest_px g to finest_px (g + 1) - "
    "1; its code is g ^ (g >> 1), of which bit b is bright in the frame with that bit",
    "phase": "share k of white at column (or row) u is 1/2 + 1/2 cos(2 pi (u / "
    "period_px - k / shifts))",
}


def drawn_by(
    projector: ProjectorCalibration, cameras: Sequence[CameraCalibration]
) -> Callable[[Frame], NDArray[np.uint8]]:
    """Return what gives the grey levels (h, w) of a projector's frames for cameras."""
    dense = projector.dense
    if dense is not None:
        return lambda frame: dense.levels(
            dense.frames[frame.number], projector.response
        )
    seen = {camera.id: projector.pattern_for(camera) for camera in cameras}
    canvas = PanelCanvas.of(projector, projector.pattern, seen)
    return lambda frame: frame_levels(
        canvas, projector.pattern, frame, projector.response
    )


def pattern_contents(
    scanner: Scanner,
) -> dict[str, Callable[[BinaryIO], object]]:
    """Return what writes each file of `patterns/`: PNG images, then `sequence.json`."""
    files: dict[str, Callable[[BinaryIO], object]] = {}
    entries: list[dict[str, Any]] = []
    for p, projector in enumerate(scanner.projectors):
        frames = scanner.frames(p)
        drawer = _once(partial(drawn_by, projector, scanner.cameras))
        for frame in frames:
            path = f"{projector.id}/{frame.name}.png"
            files[path] = _png_writer(drawer, frame)
        entries.append(
            {
                "id": projector.id,
                "light": projector.light.name,
                "resolution": list(projector.resolution),
                "response": projector.response.light.tolist(),
                **(projector.dense or projector.pattern).entry(),
                "frames": [
                    {"png": f"{projector.id}/{frame.name}.png", **vars(frame)}
                    for frame in frames
                ],
            }
        )
    manifest = {
        "format": _SECTION,
        "version": 1,
        "plan": scanner.digest,
        **(_DENSE_NOTES if scanner.is_dense else {}),
        **({} if all(one.dense for one in scanner.projectors) else _NOTES),
        "projectors": entries,
    }
    text = json.dumps(manifest, indent=1, allow_nan=False) + "\n"
    files[_MANIFEST] = lambda file: file.write(text.encode())
    return files


def write_patterns(scanner: Scanner, folder: Path) -> Path:
    """Write `patterns/` into a plan's folder.

    Returns the folder of the patterns.

    Raises:
        OSError: If it can't be written.
    """
    place = folder / FOLDER
    files = {place / name: write for name, write in pattern_contents(scanner).items()}
    for path in files:
        path.parent.mkdir(parents=True, exist_ok=True)
    write_together(files)
    return place


def is_patterns(folder: Path) -> bool:
    """Return whether a folder holds patterns that were written here."""
    return _manifest(folder).get("format") == _SECTION


def check_patterns(scanner: Scanner, folder: Path) -> None:
    """Refuse patterns of another plan: what was projected isn't what is decoded.

    Args:
        scanner: Devices as planned.
        folder: Holds `patterns/`, or the manifest itself; neither is needed.

    Raises:
        CapturesError: If they carry another plan's digest.
    """
    for place in (folder / FOLDER, folder):
        if _manifest(place).get("plan", scanner.digest) != scanner.digest:
            raise CapturesError(
                f"{place}: the patterns of another plan; project those of this one, or "
                f"give the plan whose patterns were projected"
            )


def _manifest(folder: Path) -> dict[str, Any]:
    """Return what the manifest in a folder says; nothing without one."""
    try:
        manifest = json.loads(file_content(folder / _MANIFEST))
    except (OSError, ValueError):
        return {}
    return manifest if isinstance(manifest, dict) else {}


def _once(make: Callable[[], _Made]) -> Callable[[], _Made]:
    """Return what makes something when it is first asked, for all threads once."""
    lock, made = Lock(), cache(make)

    def answer() -> _Made:
        with lock:
            return made()

    return answer


def _png_writer(
    drawer: Callable[[], Callable[[Frame], NDArray[np.uint8]]], frame: Frame
) -> Callable[[BinaryIO], object]:
    # Frames are large and flat: the fastest packing of runs is small enough.
    return lambda file: Image.fromarray(drawer()(frame)).save(
        file, format="PNG", compress_level=1, compress_type=zlib.Z_RLE
    )
