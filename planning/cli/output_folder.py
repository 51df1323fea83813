"""The folder of a plan, changed as a whole: a kill leaves the old one or the new one.

The new folder is written beside the old one; then both change places in one step of the
file system. What others put into the old folder is moved along.
"""

import ctypes
import os
import shutil
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from glob import escape
from hashlib import sha256
from pathlib import Path
from uuid import uuid4

from planning.report.page.page import PAGE, is_page
from planning.verify.reconstruction.check.cloud_file import is_cloud
from planning.verify.reconstruction.pattern_files import is_patterns

from .console import stop_signals

# What a run writes, and what of an older plan doesn't stay beside a new one.
_CLOUDS = ("cloud.ply", "deviation.ply")
_DATA = ("plan.json", "surface.npz", "proof.npz")
_PICTURE = "rig.png"
OWNED = (*_DATA, "members", _PICTURE, PAGE, "patterns", *_CLOUDS)
# `renameat2` and `renamex_np` exchange two entries under these flags.
_EXCHANGE, _SWAP, _HERE = 2, 2, -100
# What is younger may be what another run is writing just now [s].
_BUSY_S = 600.0
# Of the name of a folder that stands in that of the one written beside it [bytes].
_LONGEST = 200


@contextmanager
def exchanged(folder: Path) -> Generator[Path]:
    """Give an empty folder; what is written into it takes the place of `folder`'s.

    Where a folder can't be moved (the current one, a mount, one in a folder that can't
    be written), its entries are, one after the other, the plan last; readers refuse
    what is left of two plans.

    Args:
        folder: Where the plan is to be; it needn't exist.

    Raises:
        OSError: If nothing can be written, or what must give way is another maker's.
    """
    check_ours(folder)
    folder = folder.resolve()
    movable = _is_movable(folder)
    beside = folder.parent if movable else folder
    if movable:
        _recover(folder)
    fresh = beside / f"{_prefix(folder)}{uuid4().hex}"
    fresh.mkdir()
    try:
        if folder.exists():
            fresh.chmod(folder.stat().st_mode)
        yield fresh
        with uninterrupted():
            if not movable:
                _move_entries(fresh, folder)
            elif not folder.exists():
                fresh.rename(folder)
            else:
                _swap(fresh, folder)
                _bring_others(fresh, folder)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def check_ours(folder: Path) -> None:
    """Refuse a folder in which another's would have to give way to a plan.

    Raises:
        FileExistsError: It names what.
    """
    for name in (*_DATA, _PICTURE, "members", "patterns"):
        if (folder / name).exists() and not _is_ours(folder / name):
            raise FileExistsError(
                f"{folder / name} isn't of a plan; move it, or choose another folder "
                f"with -o"
            )


@contextmanager
def uninterrupted() -> Generator[None]:
    """Put off Ctrl-C and SIGTERM until this is done.

    Raises:
        KeyboardInterrupt: Afterwards, if one came.
    """
    came: list[int] = []
    with stop_signals(lambda number, _: came.append(number)):
        yield
    if came:
        raise KeyboardInterrupt


def _is_movable(folder: Path) -> bool:
    """Whether a folder, or one that is still to be made, may change its place."""
    if Path.cwd().is_relative_to(folder) or folder.is_mount():
        return False
    return not folder.exists() or os.access(folder.parent, os.W_OK | os.X_OK)


def _prefix(folder: Path) -> str:
    """Return how the names begin under which a folder is written beside itself."""
    name = os.fsencode(folder.name)
    # File systems take 255 bytes, of which what stands behind takes 46.
    short = folder.name if len(name) <= _LONGEST else sha256(name).hexdigest()
    return f".{short}.ringrig-"


def _swap(fresh: Path, folder: Path) -> None:
    """Let two folders change places."""
    if not _exchange(fresh, folder):
        # Two steps: a kill between them leaves both, and `_recover` finds them.
        aside = Path(f"{fresh}-old")
        folder.rename(aside)
        fresh.rename(folder)
        aside.rename(fresh)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two entries in one step; say whether this system can."""
    library = ctypes.CDLL(None, use_errno=True)
    paths = os.fsencode(one), os.fsencode(other)
    with suppress(AttributeError):
        if sys.platform == "darwin":
            return library.renamex_np(*paths, _SWAP) == 0
        return library.renameat2(_HERE, paths[0], _HERE, paths[1], _EXCHANGE) == 0
    return False


def _bring_others(old: Path, folder: Path) -> None:
    """Move what others put into the old folder to the new one."""
    for entry in old.iterdir():
        if not _is_ours(entry) and not (folder / entry.name).exists():
            entry.rename(folder / entry.name)


def _is_ours(entry: Path) -> bool:
    """Whether an earlier run wrote an entry of a folder."""
    if entry.name in _CLOUDS:
        return is_cloud(entry)
    if entry.name == PAGE:
        return is_page(entry)
    if entry.name == "patterns":
        return is_patterns(entry)
    if entry.name == "members":
        return entry.is_dir() and all(
            (member / "plan.json").is_file() for member in entry.iterdir()
        )
    return entry.name in OWNED and not entry.is_dir()


def _move_entries(fresh: Path, folder: Path) -> None:
    """Put new entries in the place of old ones; the plan goes first and comes last."""
    for name in OWNED:
        old = folder / name
        if not _is_ours(old):
            continue
        if old.is_dir():
            shutil.rmtree(old)
        else:
            old.unlink(missing_ok=True)
    for name in reversed(OWNED):
        if (fresh / name).exists():
            (fresh / name).rename(folder / name)


def _recover(folder: Path) -> None:
    """Clean up behind a run that was killed while folders changed places."""
    for remnant in folder.parent.glob(f"{escape(_prefix(folder))}*"):
        if time.time() - remnant.stat().st_mtime < _BUSY_S and folder.exists():
            continue
        if folder.exists():
            _bring_others(remnant, folder)
        elif remnant.name.endswith("-old"):
            remnant.rename(folder)
        shutil.rmtree(remnant, ignore_errors=True)
