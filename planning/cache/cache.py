"""What pure functions returned before, by the hash of all that they depend on."""

import io
import os
import pickle
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

from platformdirs import user_cache_path

from planning.model.progress import Report

from .content import code_content, content
from .entries import Entries, FolderEntries, MemoryEntries

# A folder instead of the user's; empty: nothing is kept on disk.
VARIABLE = "RINGRIG_CACHE"
_OURS = ("geometry.", "planning.", "solvers.")
# What numbers and arrays are made from again.
_PLAIN = {
    *(("builtins", name) for name in ("complex", "frozenset", "set", "slice")),
    *(("numpy", name) for name in ("dtype", "ndarray")),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy._core.numeric", "_frombuffer"),
}

_Answer = TypeVar("_Answer")


@dataclass(eq=False)
class Cache:
    """Answers of pure functions, for runs that ask again.

    An answer is the same with a cache and without: its key is a hash of all that it
    depends on, code and libraries included, and what can't be read is computed.

    Attributes:
        entries: Where answers are kept; None: they aren't.
        report: Receives a line where answers can't be kept; nothing else is lost.
    """

    entries: Entries | None = None
    report: Report = field(default=lambda _: None)

    @classmethod
    def on_disk(
        cls, folder: str | Path | None = None, report: Report = lambda _: None
    ) -> "Cache":
        """Return one that lasts, in this folder or in that of the command line."""
        place = cache_folder() if folder is None else Path(folder)
        return cls(None if place is None else FolderEntries(place), report)

    @classmethod
    def in_memory(cls) -> "Cache":
        """Return one that ends with the process."""
        return cls(MemoryEntries())

    def recall(
        self,
        name: str,
        inputs: Sequence[object],
        answer: Callable[[], _Answer],
        *,
        shared: Sequence[object] = (),
    ) -> _Answer:
        """Return what a function answers, from before if it was asked.

        Args:
            name: Of the function.
            inputs: All that its answer depends on, see `content`.
            answer: The function, with these.
            shared: Objects of the caller that are part of the answer and not kept with
                it: the next answer holds the next caller's.
        """
        if (entries := self.entries) is None:
            return answer()
        key = content(name, code_content(), inputs)
        kept = entries.get(key)
        if kept is not None:
            with suppress(pickle.UnpicklingError):
                return _Unpickler(kept, shared).load()
        made = answer()
        data = _pickled(made, shared)
        try:
            entries.put(key, data)
        except OSError as error:
            self.report(
                f"{error.filename}: nothing is kept for later runs ({error.strerror}); "
                f"name another folder in {VARIABLE}, or leave it with --no-cache"
            )
            self.entries = None
        return made


def cache_folder() -> Path | None:
    """Return where answers are kept by default; None: nowhere."""
    named = os.environ.get(VARIABLE)
    if named is None:
        return user_cache_path("ringrig", appauthor=False)
    return Path(named) if named else None


def _pickled(value: object, shared: Sequence[object]) -> bytes:
    file = io.BytesIO()
    _Pickler(file, shared).dump(value)
    return file.getvalue()


class _Pickler(pickle.Pickler):
    """Writes the place of what is shared instead of it."""

    def __init__(self, file: io.BytesIO, shared: Sequence[object]) -> None:
        super().__init__(file, protocol=5)
        self._shared = {id(one): place for place, one in enumerate(shared)}

    def persistent_id(self, obj: object) -> int | None:
        return self._shared.get(id(obj))

    def reducer_override(self, obj: object) -> Any:  # noqa: ANN401
        # What follows from the fields is computed when it is asked for.
        if not is_dataclass(obj) or isinstance(obj, type):
            return NotImplemented
        make, arguments, state, *rest = cast(tuple[Any, ...], obj.__reduce_ex__(5))
        told = {
            name: value
            for name, value in state.items()
            if not isinstance(getattr(type(obj), name, None), cached_property)
        }
        return make, arguments, told, *rest


class _Unpickler(pickle.Unpickler):
    """Reads values of ours and arrays, so that no file runs what others put there."""

    def __init__(self, data: bytes, shared: Sequence[object]) -> None:
        super().__init__(io.BytesIO(data))
        self._shared = shared

    def persistent_load(self, pid: int) -> object:
        return self._shared[pid]

    def find_class(self, module_name: str, global_name: str, /) -> Any:  # noqa: ANN401
        if (module_name, global_name) in _PLAIN:
            return super().find_class(module_name, global_name)
        if module_name.startswith(_OURS):
            found = super().find_class(module_name, global_name)
            if isinstance(found, type):
                return found
        raise pickle.UnpicklingError(f"{module_name}.{global_name} isn't kept here")


# Remembers nothing.
NO_CACHE = Cache()
