"""What `plan play` does: a projector's frames in order, and a capture of each.

A capture writes the folder that `plan reconstruct --captures` reads:
``FOLDER/CAMERA/PROJECTOR/FRAME.png``, docs/use/captures.md.
"""

import json
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from geometry.files.file_content import file_content
from planning.cli.console import reporter
from planning.model.errors import CapturesError, InputError
from planning.model.files import reading
from planning.model.progress import Report
from planning.model.words import shell_word

_MANIFEST = "sequence.json"
_INTERRUPTED = 130


@dataclass(frozen=True)
class _Frame:
    name: str
    path: Path
    camera: str | None


@dataclass(frozen=True)
class _Sequence:
    projector: str
    size: tuple[int, int]
    frames: tuple[_Frame, ...]

    @property
    def cameras(self) -> tuple[str, ...]:
        """Cameras for which a root disc is drawn: all of the plan."""
        named = (frame.camera for frame in self.frames)
        return tuple(dict.fromkeys(name for name in named if name is not None))


@dataclass(frozen=True)
class _Capture:
    """A command that takes one image, `{file}` and so on to be filled in."""

    words: tuple[str, ...]
    folder: Path
    cameras: tuple[str, ...]
    projector: str
    report: Report

    def place(self, camera: str, frame: _Frame) -> Path:
        return self.folder / camera / self.projector / f"{frame.name}.png"

    def take(self, frame: _Frame) -> None:
        """Take an image of a frame by each camera that needs one.

        Raises:
            CapturesError: If a command fails, or writes nothing.
        """
        for camera in self.cameras:
            if frame.camera not in (None, camera):
                continue
            file = self.place(camera, frame)
            filled = {
                "{file}": str(file),
                "{camera}": camera,
                "{projector}": self.projector,
                "{frame}": frame.name,
            }
            words = [_filled(word, filled) for word in self.words]
            try:
                file.parent.mkdir(parents=True, exist_ok=True)
                run = subprocess.run(words, capture_output=True, text=True, check=False)
            except OSError as error:
                raise CapturesError(
                    f"--capture {words[0]}: {error.strerror} ({error.filename}); "
                    f"correct the command, or --folder"
                ) from None
            if run.returncode or not file.is_file():
                said = " ".join(run.stderr.split())[-300:]
                what = (
                    f"ended with {run.returncode}"
                    if run.returncode
                    else f"wrote no {file}"
                )
                raise CapturesError(
                    f"--capture {shlex.join(words)}: {what} ({said or 'no message'}); "
                    f"correct the command, remove {file.parent} and play again"
                )
            self.report(f"  {file}")


def play_command(options: Mapping[str, Any]) -> int:
    """Show every frame of a projector; return 0, or 130 if Escape was pressed."""
    try:
        from .frame_window import FrameWindow, StoppedError
    except ImportError as error:
        raise InputError(
            f"plan play needs Tk, which this Python lacks ({error}); install it "
            f"(Debian: python3-tk), or show the files of patterns/ by other means"
        ) from None
    report = reporter(quiet=options["quiet"])
    sequence = _sequence(options["directory"], options["projector"])
    capture = _capture(options, sequence, report)
    hold: float | None = options["hold"]
    if capture is not None:
        hold = 0.3 if hold is None else hold
    window = FrameWindow(options["at"], sequence.size)
    try:
        for number, frame in enumerate(sequence.frames, 1):
            report(f"{frame.name} ({number} of {len(sequence.frames)})")
            window.show(frame.path)
            window.wait(hold)
            if capture is not None:
                capture.take(frame)
    except StoppedError:
        report("stopped by Escape")
        return _INTERRUPTED
    finally:
        window.close()
    if capture is not None:
        plan, images = shell_word(options["directory"]), shell_word(capture.folder)
        click.echo(
            f"{capture.folder}: {len(sequence.frames)} frames of {sequence.projector}; "
            f"after the other projectors: plan reconstruct {plan} --captures {images}"
        )
    return 0


def _sequence(directory: Path, projector: str) -> _Sequence:
    """Read what a projector shows from the manifest of the patterns.

    Raises:
        CapturesError: If there are none, or none of this projector.
    """
    folder = directory / "patterns"
    folder = folder if folder.is_dir() else directory
    path = folder / _MANIFEST
    with reading(path, CapturesError, absent="; give the folder of a plan"):
        content = file_content(path)
    try:
        entries = {
            entry["id"]: _Sequence(
                entry["id"],
                (int(entry["resolution"][0]), int(entry["resolution"][1])),
                tuple(
                    _Frame(Path(f["png"]).stem, folder / f["png"], f["camera"])
                    for f in entry["frames"]
                ),
            )
            for entry in json.loads(content)["projectors"]
        }
    except (ValueError, KeyError, TypeError, IndexError, AttributeError):
        raise CapturesError(
            f"{path}: not as `plan` writes it; plan again, or copy it again"
        ) from None
    if projector not in entries:
        raise CapturesError(
            f"{path}: no projector {projector!r}; the plan has {', '.join(entries)}"
        )
    return entries[projector]


def _capture(
    options: Mapping[str, Any], sequence: _Sequence, report: Report
) -> _Capture | None:
    command, folder = options["capture"], options["folder"]
    if (command is None) != (folder is None):
        raise click.UsageError("give --capture COMMAND and --folder F together")
    if command is None:
        return None
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise click.UsageError(f"--capture {command!r}: {error}") from None
    if not any("{file}" in word for word in words):
        raise click.UsageError(
            f"--capture {command!r}: {{file}} must stand where the image goes"
        )
    cameras = _cameras(options["cameras"], sequence.cameras)
    several = len(cameras) > 1 and not any("{camera}" in word for word in words)
    if several:
        raise click.UsageError(
            f"--capture {command!r}: {{camera}} must say which of {', '.join(cameras)} "
            f"takes the image; or name one with --cameras"
        )
    capture = _Capture(tuple(words), folder, cameras, sequence.projector, report)
    for camera in cameras:
        place = capture.place(camera, sequence.frames[0]).parent
        if place.exists() and any(place.iterdir()):
            raise click.UsageError(
                f"{place} holds images already; remove it, or give another --folder"
            )
    return capture


def _cameras(asked: str | None, known: Sequence[str]) -> tuple[str, ...]:
    if asked is None:
        return tuple(known)
    names = tuple(dict.fromkeys(name.strip() for name in asked.split(",")))
    for name in names:
        if name not in known:
            raise click.UsageError(
                f"--cameras {asked}: the plan has {', '.join(known)}, no {name!r}"
            )
    return names


def _filled(word: str, values: Mapping[str, str]) -> str:
    for key, value in values.items():
        word = word.replace(key, value)
    return word
