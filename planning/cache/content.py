"""A hash of everything that an answer depends on."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from platform import machine, python_version
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from pydantic import BaseModel

from geometry.mesh.mesh import TriangleMesh
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.installed import sources_hash, versions

_Update = Callable[[bytes | memoryview], None]

# Rooms of `planning` that no remembered function reaches, by the layers of the house.
_ABOVE = ("cli", "experiments", "handover", "verify")
# Values that are asked for again and again, and never change.
_VALUES = TriangleMesh, PlannedProjector, PlannedCamera
_known: WeakKeyDictionary[object, str] = WeakKeyDictionary()


def content(*values: object) -> str:
    """Return a hash of values by what they hold, hexadecimal.

    Plain values, arrays, sequences, mappings and dataclasses of such; a mesh is its
    vertices and faces, wherever it came from. What has a `content` of its own is that.

    Raises:
        TypeError: If a value is none of these: then nothing is known of it.
    """
    hashed = hashlib.blake2b(digest_size=20)
    _feed(hashed.update, values)
    return hashed.hexdigest()


@cache
def code_content() -> str:
    """Return a hash of the code and the libraries that answers come from."""
    return content(sources_hash(_ABOVE), versions(), python_version(), machine())


def _feed(update: _Update, value: Any) -> None:  # noqa: ANN401
    """Add a value, and what tells it from every other one."""
    if value is None or isinstance(value, bool | int | float | str | bytes | Path):
        _plain(update, type(value).__name__, str(value), repr(value))
    elif isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        if array.dtype.hasobject:
            raise TypeError(f"an array of {array.dtype} has no content to hash")
        _plain(update, "array", array.dtype.str, np.shape(value))
        update(array.reshape(-1).view(np.uint8).data)
    elif isinstance(value, _VALUES):
        if value not in _known:
            _known[value] = content(*_parts(value))
        _plain(update, type(value).__qualname__, _known[value])
    elif isinstance(value, BaseModel):
        _plain(update, type(value).__qualname__, value.model_dump_json())
    elif isinstance(own := getattr(value, "content", None), str):
        _plain(update, type(value).__qualname__, own)
    elif is_dataclass(value):
        parts = _parts(value)
        _plain(update, type(value).__qualname__, len(parts))
        for part in parts:
            _feed(update, part)
    elif isinstance(value, Mapping):
        _plain(update, "mapping", len(value))
        for key in sorted(value):
            _feed(update, (key, value[key]))
    elif isinstance(value, Sequence):
        _plain(update, "sequence", len(value))
        for item in value:
            _feed(update, item)
    else:
        raise TypeError(f"a {type(value).__name__} has no content to hash")


def _parts(value: Any) -> tuple[object, ...]:  # noqa: ANN401
    if isinstance(value, TriangleMesh):
        return value.vertices, value.faces
    return tuple(getattr(value, field.name) for field in fields(value))


def _plain(update: _Update, *words: object) -> None:
    text = repr(words).encode()
    update(len(text).to_bytes(8, "little"))
    update(text)
