"""`patterns/`: what each projector of a plan shows, ready to be projected."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from PIL import Image

from planning.model.files import write_together
from planning.verify.reconstruction.patterns.pattern_images import PatternCanvas, canvas
from planning.verify.reconstruction.patterns.ring_patterns import Frame

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


def write_patterns(scanner: Scanner, folder: Path) -> Path:
    """Write `patterns/` into a plan's folder: PNG images and `sequence.json`.

    No file is moved into place before all are complete, and the manifest is the last.
    Files that an earlier manifest lists and this one doesn't are removed. Returns the
    folder of the patterns.

    Raises:
        OSError: If it can't be written.
    """
    place = folder / FOLDER
    before = _listed(place)
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
    manifest = {"format": _SECTION, "version": 1, **_NOTES, "projectors": entries}
    text = json.dumps(manifest, indent=1, allow_nan=False) + "\n"
    files[place / _MANIFEST] = lambda file: file.write(text.encode())
    write_together(files)
    _remove(before - set(files))
    return place


def remove_patterns(folder: Path) -> None:
    """Remove the patterns of an earlier plan: those that its manifest lists."""
    place = folder / FOLDER
    listed = _listed(place)
    _remove(listed | ({place / _MANIFEST} if listed else set()))


def _png_writer(drawn: PatternCanvas, frame: Frame) -> Callable[[BinaryIO], object]:
    # Frames are large and flat: the fastest packing is small enough.
    return lambda file: Image.fromarray(drawn.image(frame)).save(
        file, format="PNG", compress_level=1
    )


def _listed(place: Path) -> set[Path]:
    """Files that the manifest in a folder lists; none without a manifest of ours."""
    try:
        manifest = json.loads((place / _MANIFEST).read_text(encoding="utf-8"))
        if manifest["format"] != _SECTION:
            return set()
        names = [
            frame["png"]
            for projector in manifest["projectors"]
            for frame in projector["frames"]
        ]
    except (OSError, ValueError, KeyError, TypeError):
        return set()
    inside = (Path(name) for name in names if isinstance(name, str))
    return {
        place / path
        for path in inside
        if len(path.parts) == 2 and ".." not in path.parts and not path.is_absolute()
    }


def _remove(files: set[Path]) -> None:
    for path in files:
        path.unlink(missing_ok=True)
    for folder in {path.parent for path in files}:
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
