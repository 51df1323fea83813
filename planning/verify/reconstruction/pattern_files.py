"""`patterns/`: what each projector of a plan shows, ready to be projected.

Edges are anti-aliased: a pixel that a ring edge crosses gets the share of it that is
bright, (rho - R) / |grad rho| + 1/2 held within [0, 1], with rho the ring coordinate of
its centre. Half way between, frame and inverse are equally bright, whatever the
projector's gamma.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from geometry.files.file_content import file_content
from planning.model.errors import CapturesError
from planning.model.files import write_together
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings, Frame

from .scanner import Scanner

FOLDER = "patterns"
_MANIFEST = "sequence.json"
_SECTION = "ringrig-patterns"
_NOTES = {
    "order": "projector by projector as listed, all others dark; each in its frames' "
    "order; every camera records every frame but another camera's root frames",
    "exposure": "one exposure and gain for all frames of a projector and a camera, so "
    "that white isn't saturated: the decoder compares (I - inverse) / (white - black)",
    "grey": "shares of a pixel in linear light; an edge lies where a frame and its "
    "inverse are equally bright, whatever the projector's gamma. One image pixel to "
    "one projector pixel: no scaling, no keystone correction, no sharpening",
    "index": "annulus k lies between ring_radii[k - 1] and ring_radii[k]; its code is "
    "k ^ (k >> 1), of which bit b is bright in the frame with that bit",
    "flipping_bit": "bit whose frames change across each ring edge",
    "root": "bright where r.m > 0, with the viewing ray r of that camera and the ring "
    "normal m: which of two points of a ring it sees",
}
_WHITE = 255.0


@dataclass(frozen=True, eq=False)
class PatternCanvas:
    """Where a projector's pixels lie among the rings, shape (h, w) each.

    Attributes:
        pattern: What is drawn.
        edge: Ring edge that is nearest in the ring coordinate.
        within: Grey level of the part of the pixel that lies inside that edge.
        beyond: Of the part outside it; both together are the pixel in white.
        outside: Of the part outside a camera's root disc, by its id: r.m > 0.
    """

    pattern: DrawnRings
    edge: NDArray[np.intp]
    within: NDArray[np.uint8]
    beyond: NDArray[np.uint8]
    outside: dict[str, NDArray[np.uint8]]

    def image(self, frame: Frame) -> NDArray[np.uint8]:
        """Return a frame's grey levels, 0 to 255, shape (h, w)."""
        if frame.kind == "root":
            assert frame.camera is not None
            outside = self.outside[frame.camera]
            return self.within + self.beyond - outside if frame.inverse else outside
        bright = self.pattern.bright(frame).astype(np.uint8)
        inside = self.within * bright[:-1].take(self.edge)
        return inside + self.beyond * bright[1:].take(self.edge)


def canvas(
    projector: ProjectorCalibration, cameras: Sequence[CameraCalibration]
) -> PatternCanvas:
    """Return where a projector's pixels lie among its rings, for a rig's cameras."""
    patterns = projector.pattern
    width, height = projector.resolution
    v, u = np.indices((height, width), dtype=np.float64)
    pixels = np.column_stack([u.ravel(), v.ravel()])
    x, y = (axis.reshape(height, width) for axis in projector.ring_plane(pixels).T)
    rho = np.hypot(x, y)
    slope = _slope(rho)
    radii = patterns.radii
    edge = np.searchsorted(0.5 * (radii[1:] + radii[:-1]), rho)
    drawn = _share(patterns.outer_radius - rho, slope)
    if projector.beam_radius is not None:
        flat = projector.panel_coordinates(pixels)
        away = np.hypot(flat[:, 0], flat[:, 1]).reshape(height, width)
        drawn = drawn * _share(projector.beam_radius - away, _slope(away))
    white = np.rint(_WHITE * drawn).astype(np.uint8)
    beyond = np.rint(white * _share(rho - radii[edge], slope)).astype(np.uint8)
    outside: dict[str, NDArray[np.uint8]] = {}
    for camera in cameras:
        level = projector.pattern_for(camera).root_level(x, y)
        share = _share(level, _slope(level)).astype(np.float32)
        outside[camera.id] = np.rint(white * share).astype(np.uint8)
    return PatternCanvas(patterns, edge, white - beyond, beyond, outside)


def _slope(values: Array) -> Array:
    """Return |grad| in units a pixel, never 0."""
    down, across = np.gradient(values)
    return np.maximum(np.hypot(across, down), np.finfo(float).tiny)


def _share(signed: Array, slope: Array) -> Array:
    """Return the share of a pixel beyond the border where a quantity is zero."""
    return np.clip(signed / slope + 0.5, 0.0, 1.0)


def write_patterns(scanner: Scanner, folder: Path) -> Path:
    """Write `patterns/` into a plan's folder: PNG images and `sequence.json`.

    Returns the folder of the patterns.

    Raises:
        OSError: If it can't be written.
    """
    place = folder / FOLDER
    files: dict[Path, Callable[[BinaryIO], object]] = {}
    entries: list[dict[str, Any]] = []
    for p, projector in enumerate(scanner.projectors):
        frames, drawn = scanner.frames(p), canvas(projector, scanner.cameras)
        (place / projector.id).mkdir(parents=True, exist_ok=True)
        for frame in frames:
            path = place / projector.id / f"{frame.name}.png"
            files[path] = _png_writer(drawn, frame)
        entries.append(
            {
                "id": projector.id,
                "light": projector.light.name,
                "resolution": list(projector.resolution),
                **projector.pattern.entry(),
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
        **_NOTES,
        "projectors": entries,
    }
    text = json.dumps(manifest, indent=1, allow_nan=False) + "\n"
    files[place / _MANIFEST] = lambda file: file.write(text.encode())
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


def _png_writer(drawn: PatternCanvas, frame: Frame) -> Callable[[BinaryIO], object]:
    # Frames are large and flat: the fastest packing is small enough.
    return lambda file: Image.fromarray(drawn.image(frame)).save(
        file, format="PNG", compress_level=1
    )
