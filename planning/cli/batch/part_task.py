"""One part of a batch: the main job in a process of its own, wherever that runs.

Files go in and come out as bytes, so that a worker on another machine needs none of
this one's folders. A process that is killed takes nothing with it, and is begun again.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

# Times that a part is begun whose process was killed.
_TIMES = 2
_PLAN = "from planning.cli.main import main; main()"
# In the folder where it runs.
_OUT, _RIG = "plan", "rig"


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


# Processes of parts that run in this one, and whether no more are begun.
_running: set[subprocess.Popen[str]] = set()
_stopped = threading.Event()


def stop_parts() -> None:
    """End the parts that run in this process; none is begun after it."""
    _stopped.set()
    for process in tuple(_running):
        process.kill()


def plan_part(task: PartTask) -> PartEnd:
    """Plan a part in a process of its own, and return what that wrote."""
    begin = time.monotonic()
    with TemporaryDirectory(prefix="ringrig-") as place:
        _put(Path(place), task.mesh)
        _put(Path(place) / _RIG, task.rig)
        code, message = -int(signal.SIGKILL), ""
        for _ in range(_TIMES):
            code, message = _run(_command(task), place)
            if code >= 0 or _stopped.is_set():
                break
        if code < 0:
            message = f"killed by signal {-code}, {_TIMES} times: perhaps it took more "
            message += "memory than there is"
        out = Path(place) / _OUT
        files = {
            path.relative_to(out).as_posix(): path.read_bytes()
            for path in sorted(out.rglob("*"))
            if path.is_file()
        }
    return PartEnd(task.name, code, message, time.monotonic() - begin, files)


def _command(task: PartTask) -> list[str]:
    words = [*task.words, "--mesh", next(iter(task.mesh)), "-o", _OUT, "--quiet"]
    if task.rig:
        words += ["--rig", f"{_RIG}/{next(iter(task.rig))}"]
    return [sys.executable, "-c", _PLAN, *words, "--threads", str(task.threads)]


def _run(command: Sequence[str], place: str) -> tuple[int, str]:
    # The package that this is, wherever it was imported from.
    home = str(Path(__file__).parents[3])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    process = subprocess.Popen(
        command,
        cwd=place,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        stdin=subprocess.DEVNULL,
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


def _put(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
