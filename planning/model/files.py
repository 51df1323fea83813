"""Inputs that can't be read are refused; outputs are written whole, or not at all."""

import json
import os
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, BinaryIO, cast

from geometry.parallel import mapped

from .errors import InputError

# Whole numbers beyond it aren't all floats, and squares of what is larger overflow.
_MOST_WHOLE, _LARGEST = 2**53, 1e100
# Any size will do for these: no figure is computed of them.
_OF_ANY_SIZE = {"seed"}


@contextmanager
def reading(
    path: Path, refused: type[InputError], *, absent: str = ""
) -> Generator[None]:
    """Refuse what can't be read within as this kind of input, `absent` a remedy."""
    if "\0" in str(path):
        raise refused(f"{str(path)!r}: no file's name holds a NUL character")
    try:
        yield
    except FileNotFoundError:
        raise refused(f"{path}: no such file{absent}") from None
    except OSError as error:
        raise refused(
            f"{path}: can't be read ({error.strerror}); check the path and its rights"
        ) from None


def plain_json(text: str | bytes) -> Any:  # noqa: ANN401
    """Return the values of JSON text.

    Raises:
        ValueError: If it isn't any, or says something twice: readers would differ in
            which of both counts.
        RecursionError: If its parts are nested too deeply.
    """
    return json.loads(text, object_pairs_hook=_named_once)


def _named_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict[str, Any]()
    for key, value in pairs:
        if key in values:
            raise ValueError(f"key {key[:60]!r} stands twice")
        values[key] = value
    return values


def unusable_numbers(values: Any) -> Iterator[str]:  # noqa: ANN401
    """Yield what is wrong with each number of JSON values that none can compute with.

    Where it stands, the number, and what it should be.
    """
    parts: list[tuple[str, Any]] = [("", values)]
    while parts:
        key, value = parts.pop()
        below = f"{key}." if key else ""
        if isinstance(value, dict):
            items = cast(dict[str, Any], value).items()
            parts += [(f"{below}{name}", part) for name, part in items]
        elif isinstance(value, list):
            items = enumerate(cast(list[Any], value))
            parts += [(f"{below}{place}", part) for place, part in items]
        elif isinstance(value, int | float) and key not in _OF_ANY_SIZE:
            if fault := _size_fault(value):
                number = repr(value)
                number = number if len(number) <= 60 else f"{number[:57]}..."
                yield f"{key} = {number} {fault}"


def _size_fault(number: float) -> str:
    if isinstance(number, int):
        return "should be 2^53 in size at most" if abs(number) > _MOST_WHOLE else ""
    if not isfinite(number):
        return "should be a finite number"
    return f"should be {_LARGEST:g} in size at most" if abs(number) > _LARGEST else ""


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

    Raises:
        OSError: If a file can't be written.
    """
    if folder := next((path for path in files if path.is_dir()), None):
        raise IsADirectoryError(
            f"{folder} is a folder, and a file is to be there; move it"
        )
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
