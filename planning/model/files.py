"""Inputs that can't be read are refused; outputs are written whole, or not at all."""

import os
import tempfile
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

from geometry.parallel import mapped

from .errors import InputError


@contextmanager
def reading(
    path: Path, refused: type[InputError], *, absent: str = ""
) -> Generator[None]:
    """Refuse what can't be read within as this kind of input, `absent` a remedy."""
    try:
        yield
    except FileNotFoundError:
        raise refused(f"{path}: no such file{absent}") from None
    except OSError as error:
        raise refused(
            f"{path}: can't be read ({error.strerror}); check the path and its rights"
        ) from None


def write_atomically(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a file so that its old content stays whole until the new one is complete.

    Args:
        path: Where the file goes; its folder must exist.
        write: Receives the open binary file.
    """
    write_together({path: write})


def write_together(files: Mapping[Path, Callable[[BinaryIO], object]]) -> None:
    """Write files that belong to each other; none is moved before all are complete.

    Args:
        files: For each path what receives the open binary file, several at a time;
            folders must exist.
    """
    umask = os.umask(0)
    os.umask(umask)
    with ExitStack() as undo:
        names: dict[Path, str] = {}
        for path in files:
            handle, names[path] = tempfile.mkstemp(
                dir=path.parent, prefix=f".{path.name}."
            )
            os.close(handle)
            undo.callback(Path(names[path]).unlink, missing_ok=True)

        def fill(path: Path) -> None:
            with open(names[path], "wb") as file:
                files[path](file)
            # mkstemp lets only the owner read; give what a plain open would have given.
            os.chmod(names[path], 0o666 & ~umask)

        mapped(fill, files)
        for path, name in names.items():
            os.replace(name, path)
