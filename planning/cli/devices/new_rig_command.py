"""What `plan rigs new` does: asks, writes a rig file that plans, says what it chose."""

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from planning.cli.console import given
from planning.model.errors import InfeasibleLimitsError, InputError, RigError
from planning.model.words import shell_word
from planning.rig.object_size import ObjectSize
from planning.rig.rig import Rig, load_rig
from planning.rig.toml.catalogue import catalogue, split_camera
from planning.rig.toml.fitting_optics import BALL
from planning.rig.toml.new_rig import Answers, new_rig

_OBJECT_MM = 250.0
_PROJECTOR, _CAMERA = "panasonic/pt-lb386", "basler/acA2040-55um"
_Value = TypeVar("_Value")


def new_rig_command(options: Mapping[str, Any]) -> int:
    """Write a rig file and print what was chosen and what to try; return 0."""
    path: Path = options["output"]
    if path.suffix != ".toml":
        raise click.UsageError(f"-o {path}: a rig file's name ends in .toml")
    if path.exists():
        raise click.UsageError(f"{path} exists; choose another name with -o")
    chosen: list[str] = []
    known = given(options, *_KEYS)
    if options["projector"] and options["throw_ratio"]:
        raise click.UsageError("give --projector or --throw-ratio, not both")
    cameras = [_counted(text) for text in options["camera"]]
    if cameras:
        (known["camera"], known["camera_count"]), *known["more_cameras"] = cameras
    if cameras and options["sensor_px"]:
        raise click.UsageError("give --camera or --sensor-px, not both")
    if options["focal_mm"] and any("+" in name for name, _ in cameras):
        raise click.UsageError("--camera names a lens; leave --focal-mm out")
    for key, needed in _GOES_WITH.items():
        if key in known and needed not in known:
            words = (f"--{name.replace('_', '-')}" for name in (key, needed))
            raise click.UsageError(" goes with ".join(words) + "; write both")
    asks = not known and _is_terminal()
    if not known and not asks:
        raise click.UsageError(
            "give at least --object-mm S, the longest side of what you measure; on a "
            "terminal you are asked"
        )
    answers = _asked() if asks else _assumed(known, chosen)
    answers.name = path.stem
    try:
        text, more = new_rig(answers)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise RigError(str(error).removeprefix("device: ")) from None
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise click.UsageError(f"can't write {path}: {error.strerror}") from None
    lines = [f"wrote {path}; chosen for you, to change there:"]
    lines += [f"  {line}" for line in (*chosen, *more)]
    lines += [*_warnings(path, answers.object_mm), "try"]
    word = shell_word(path)
    lines += [
        f"  plan lens --mesh FILE --rig {word}    does it suit your object?",
        f"  plan --mesh FILE --max-projectors 6 --rig {word}",
    ]
    click.echo("\n".join(lines))
    return 0


_KEYS = (
    *("object_mm", "projector", "throw_ratio", "projector_px", "offset_percent"),
    *("sensor_px", "pixel_um", "focal_mm", "distance_mm"),
)
_GOES_WITH = {
    "projector_px": "throw_ratio",
    "offset_percent": "throw_ratio",
    "pixel_um": "sensor_px",
}


def _counted(text: str) -> tuple[str, int | None]:
    """Return a camera's name, and how many there are of it: NAME:4."""
    name, colon, count = text.rpartition(":")
    if not colon:
        return text, None
    if not (count.isascii() and count.isdigit() and 1 <= int(count[:9]) <= 1000):
        raise click.UsageError(
            f"--camera {text!r}: what follows the colon is how many there are, from 1 "
            f"to 1000"
        )
    return name, int(count)


def _is_terminal() -> bool:
    return sys.stdin.isatty()


def _assumed(known: dict[str, Any], chosen: list[str]) -> Answers:
    if "object_mm" not in known:
        known["object_mm"] = _OBJECT_MM
        chosen.append(f"objects up to {_OBJECT_MM:g} mm (--object-mm)")
    if not {"projector", "throw_ratio"} & set(known):
        known["projector"] = _PROJECTOR
        chosen.append(f"projector {_PROJECTOR} (--projector, or --throw-ratio)")
    if not {"camera", "sensor_px"} & set(known):
        known["camera"] = _CAMERA
        chosen.append(f"camera {_CAMERA} (--camera, or --sensor-px)")
    if "throw_ratio" in known and "projector_px" not in known:
        chosen.append("a projector of 1920 x 1080 px (--projector-px)")
    if "throw_ratio" in known and "offset_percent" not in known:
        chosen.append("a projector's lens without shift (--offset-percent)")
    if "sensor_px" in known and "pixel_um" not in known:
        chosen.append("camera pixels of 3.45 um (--pixel-um)")
    return Answers(**known)


def _asked() -> Answers:
    """Ask; an answer that can't be is asked for again."""
    answers = Answers(_ask("Longest side of the object, in mm", "250", _positive))
    projector = _ask(
        "Projector: a name of `plan rigs devices`, or its throw ratio",
        _PROJECTOR,
        _projector,
    )
    if isinstance(projector, str):
        answers.projector = projector
    else:
        answers.throw_ratio = projector
        answers.projector_px = _ask("  its pixels", "1920x1080", pixels)
        answers.offset_percent = _ask(
            "  percent of half the image height from its middle to the lens", "0", float
        )
    camera = _ask(
        "Camera: a name of `plan rigs devices`, with + and a lens, or its pixels",
        _CAMERA,
        _camera,
    )
    if isinstance(camera, str):
        answers.camera = camera
    else:
        answers.sensor_px = camera
        answers.pixel_um = _ask("  size of a pixel, in um", "3.45", _positive)
    if isinstance(camera, tuple) or "+" not in camera:
        answers.focal_mm = _ask(
            "  focal length of the lens, in mm (0: one that fits)", "0", _maybe
        )
    answers.distance_mm = _ask(
        "Distance from device to surface, in mm (0: one that fits)", "0", _maybe
    )
    return answers


def _ask(question: str, default: str, read: Callable[[str], _Value]) -> _Value:
    def value(text: str) -> _Value:
        try:
            return read(text)
        except ValueError as error:
            raise click.UsageError(str(error)) from None

    return click.prompt(question, default=default, value_proc=value, err=True)


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (number > 0.0 and math.isfinite(number)):
        raise ValueError(f"{text!r} must be a positive number")
    return number


def _maybe(text: str) -> float | None:
    return None if text.strip() in ("0", "") else _positive(text)


def _projector(text: str) -> str | float:
    if text in catalogue("projectors"):
        return text
    try:
        return _positive(text)
    except ValueError:
        names = ", ".join(catalogue("projectors"))
        raise ValueError(f"{text!r} is none of {names}, and no number") from None


def _camera(text: str) -> str | tuple[int, int]:
    if "/" not in text and "x" in text:
        return pixels(text)
    split_camera(text)
    return text


def pixels(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT in pixels.

    Raises:
        ValueError: If it isn't two whole numbers from 2 to 100,000.
    """
    width, _, height = text.partition("x")
    if not all(part.isascii() and part.isdigit() for part in (width, height)):
        raise ValueError(f"{text!r} must be two whole numbers, as 1920x1080")
    size = int(width[:9]), int(height[:9])
    if not all(2 <= side <= 100_000 for side in size):
        raise ValueError(f"{text!r}: sides are from 2 to 100000 px")
    return size


def _warnings(path: Path, object_mm: float) -> Iterator[str]:
    """What the new rig can't do as it is, a line each."""
    try:
        rig: Rig = load_rig(path)
    except InfeasibleLimitsError as error:
        yield f"it doesn't plan yet: {error}"
        return
    size = ObjectSize.ball(1e-3 * BALL * object_mm)
    models = (*rig.projector_models, *rig.camera_models)
    for fit in (rig.fit(model, size) for model in models):
        if not fit.device.holds_ball(fit.radius_m, fit.middle_m):
            yield (
                f"one view of the object takes {fit.images} images of {fit.called} "
                f"side by side; {fit.advice()}"
            )
        elif not fit.is_sharp:
            yield f"not all of it is sharp for {fit.called}; {fit.advice()}"
    yield from (f"  {note}" for note in rig.notes())
