"""One part of a batch: the main job in a process of its own, wherever that runs.

Files go in and come out as bytes, so that a worker on another machine needs none of
this one's folders. A process that is killed takes nothing with it, and is begun again.
"""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from planning.model.errors import InputError, PlanningError

from .part_names import one_line

# Times that a part is begun whose process was killed.
_TIMES = 2
_PLAN = (
    "import sys; from planning.cli.batch.orphans import end_with_parent; "
    "end_with_parent(sys.argv.pop(1)); from planning.cli.main import main; main()"
)
# Folders of its own for each, so that no file's name is in another's way.
_MESH, _RIG, _OUT = "part", "rig", "plan"
# Exit code of a part whose files can't be read or written, and of no run's.
NO_FILE = 2


@dataclass(frozen=True)
class PartTask:
    """What is planned, and from what.

    Attributes:
        name: Of the part.
        mesh: Its file, by the name that its plan will have it by; with what it refers
            to, the mesh first.
        rig: Likewise a rig file; nothing of a preset.
        words: Of the command line, without mesh, rig file and output folder.
        threads: Of its process.
    """

    name: str
    mesh: Mapping[str, bytes]
    rig: Mapping[str, bytes]
    words: Sequence[str]
    threads: int


@dataclass(frozen=True)
class PartEnd:
    """How a part ended.

    Attributes:
        name: Of the part.
        code: The exit code of its run; negative: the signal that killed it.
        message: Its last words on standard error, one line.
        seconds: Wall time.
        files: What it wrote, by path below its folder.
    """

    name: str
    code: int
    message: str
    seconds: float
    files: Mapping[str, bytes]


# Processes of parts that run in this one, their folders, and whether no more are begun.
_running: set[subprocess.Popen[str]] = set()
_folders: set[Path] = set()
_stopped = threading.Event()


def stop_parts() -> None:
    """End the parts that run in this process; none is begun after it.

    Their folders go, too: nobody waits for the threads that would remove them.
    """
    _stopped.set()
    for process in tuple(_running):
        process.kill()
        process.wait()
    for folder in tuple(_folders):
        shutil.rmtree(folder, ignore_errors=True)


def plan_part(task: PartTask) -> PartEnd:
    """Plan a part in a process of its own, and return what that wrote."""
    begin = time.monotonic()
    files: dict[str, bytes] = {}
    try:
        with _folder() as place:
            code, message = _planned(task, place)
            out = place / _OUT
            files = {
                path.relative_to(out).as_posix(): path.read_bytes()
                for path in sorted(out.rglob("*"))
                if path.is_file()
            }
    except (PlanningError, OSError) as error:
        code, message = NO_FILE, one_line(str(error))
    return PartEnd(task.name, code, message, time.monotonic() - begin, files)


@contextmanager
def _folder() -> Generator[Path]:
    """Give a folder for one part, which is removed behind it."""
    with TemporaryDirectory(prefix="ringrig-") as name:
        # A part runs elsewhere than this process.
        folder = Path(name).resolve()
        _folders.add(folder)
        try:
            yield folder
        finally:
            _folders.discard(folder)


def _planned(task: PartTask, place: Path) -> tuple[int, str]:
    """Plan a part in a folder that is its own; return its exit code and last words."""
    here = _put(place / _MESH, task.mesh)
    words = [*task.words, "--mesh", next(iter(task.mesh)), "--quiet"]
    words += ["-o", os.path.relpath(place / _OUT, here)]
    beside = os.path.relpath(_put(place / _RIG, task.rig), here) + os.sep
    if task.rig:
        words += ["--rig", beside + next(iter(task.rig))]
    words += ["--threads", str(task.threads)]
    code, message = -int(signal.SIGKILL), ""
    for _ in range(_TIMES):
        code, message = _run([sys.executable, "-c", _PLAN, str(place), *words], here)
        if code >= 0 or _stopped.is_set():
            # Nobody knows the folder that its rig file was in here.
            return code, message.replace(beside, "")
    return code, (
        f"killed by signal {-code}, {_TIMES} times: perhaps it took more memory than "
        f"there is"
    )


def _run(command: Sequence[str], place: Path) -> tuple[int, str]:
    # The package that this is, wherever it was imported from.
    home = str(Path(__file__).parents[3])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    theirs, ours = os.pipe()
    # Where this process is killed, nobody holds it open any more.
    with open(ours, "wb"):
        with open(theirs, "rb") as held:
            process = subprocess.Popen(
                command,
                cwd=place,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
                stdin=held,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
        _running.add(process)
        try:
            _, said = process.communicate()
        finally:
            _running.discard(process)
            # Whatever came in between: no part is left behind.
            process.kill()
            process.wait()
    lines = said.strip().splitlines()
    return process.returncode, lines[-1].removeprefix("plan: ") if lines else ""


def _put(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Write files, and return the folder at or below this one that their names are of.

    However many `..` a name begins with, its file stays in `folder`.

    Raises:
        InputError: If a name is an absolute path, or two are of one place.
    """
    start = folder.joinpath(*["in"] * max(map(_climbs, files), default=0))
    written: dict[str, str] = {}
    for name, content in files.items():
        path = start / name
        place = os.path.normpath(path)
        if not Path(place).is_relative_to(folder):
            raise InputError(f"{name}: must be named from a folder; give no whole path")
        other = written.setdefault(place, name)
        if files[other] != content:
            raise InputError(
                f"{name} and {other}: are two files of one place when they are sent "
                f"along; name them without .. and links"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return start


def _climbs(name: str) -> int:
    """Return how many folders a name leads above where it begins."""
    depth = highest = 0
    for part in PurePosixPath(name).parts:
        depth += -1 if part == ".." else 1
        highest = max(highest, -depth)
    return highest
