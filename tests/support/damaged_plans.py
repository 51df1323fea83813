"""Damaged plans and surfaces, each from a seed and a number, and how they end.

Even numbers are damaged in `plan.json` (values of another type, missing, NaN, infinite,
huge, negative, lists cut or doubled, bytes changed, cut off), odd ones in `surface.npz`
(arrays of another type or shape, missing, cut, NaN, out of range, objects, bytes
changed, cut off), its digest in the plan made anew.
"""

import hashlib
import json
import warnings
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from planning.model.errors import PlanningError
from planning.model.plan import RigPlan
from planning.verify.audit.audit import audit_plan

from .handmade import build_plan

_VALUES = (
    *(None, True, [], {}, "text", "", -1, 0, 2**70, 1e308, -1e308, 1e-320, 0.5),
    *(float("nan"), float("inf"), [[1.0]], {"x": 1}, [1, 2, 3]),
)
# A line a fault, and so many faults are told.
_MOST_LINES = 21


def outcome(folder: Path, seed: int, number: int) -> tuple[str, str, str]:
    """Return which file was damaged, how, and how reading and the audit ended."""
    random, plan = Random(f"{seed} {number}"), build_plan()
    kind = "surface.npz" if number % 2 else "plan.json"
    document, content = plan.to_document(), plan.surface.content
    if number % 2:
        damage, content = _damaged_surface(random, content)
    document["surface"]["sha256"] = _digest(content)
    text = json.dumps(document)
    if number % 2 == 0:
        damage, text = _damaged_plan(random, document)
    (folder / "plan.json").write_bytes(text.encode(errors="surrogateescape"))
    (folder / "surface.npz").write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded = RigPlan.load(folder / "plan.json")
            false = audit_plan(loaded, n_samples=500, threads=1).failures
    except PlanningError as error:
        lines = len(str(error).splitlines())
        return kind, damage, "refused" if 1 <= lines <= _MOST_LINES else "escaped: long"
    except Exception as error:
        return kind, damage, f"escaped: {type(error).__name__}: {error}"
    return kind, damage, "false" if false else "holds"


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _damaged_plan(random: Random, document: dict[str, Any]) -> tuple[str, str]:
    which, told = random.randrange(8), list[str]()
    if which == 0:
        text = json.dumps(document)
        return "cut off", text[: random.randrange(len(text))]
    if which == 1:
        data = bytearray(json.dumps(document).encode())
        for _ in range(random.randint(1, 8)):
            data[random.randrange(len(data))] = random.randrange(256)
        return "bytes changed", data.decode(errors="surrogateescape")
    for _ in range(random.randint(1, 3)):
        holder, key = random.choice(list(_places(document)))
        where, what = f"{key}", random.randrange(5)
        if what == 0:
            del holder[key]
        elif what == 1 and isinstance(holder[key], list):
            holder[key] = holder[key][:-1] if random.random() < 0.5 else holder[key] * 2
        else:
            holder[key] = random.choice(_VALUES)
            where += f" = {holder[key]!r}"
        told.append(where)
    return "; ".join(told), json.dumps(document)


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Return every place of a document: what holds it, and its key there."""
    keys = list(value) if isinstance(value, dict) else range(len(value))
    places = [(value, key) for key in keys]
    for key in keys:
        if isinstance(value[key], dict | list):
            places += _places(value[key])
    return places


def _damaged_surface(random: Random, content: bytes) -> tuple[str, bytes]:
    which, told = random.randrange(8), list[str]()
    if which == 0:
        return "cut off", content[: random.randrange(len(content))]
    if which == 1:
        data = bytearray(content)
        for _ in range(random.randint(1, 8)):
            data[random.randrange(len(data))] = random.randrange(256)
        return "bytes changed", bytes(data)
    with np.load(BytesIO(content)) as archive:
        arrays: dict[str, Any] = dict(archive)
    for _ in range(random.randint(1, 2)):
        if not arrays:
            break
        name = random.choice(list(arrays))
        what = random.choice(list(_DAMAGES))
        told.append(f"{name} {what}")
        changed = _DAMAGES[what](arrays[name].copy(), random)
        arrays[name] = changed
        if changed is None:
            del arrays[name]
    buffer = BytesIO()
    np.savez_compressed(buffer, **arrays)
    return "; ".join(told), buffer.getvalue()


def _with(array: Any, random: Random, value: Any) -> Any:
    """Return an array with one element replaced, as another type if need be."""
    if array.size:
        if isinstance(value, float) and not np.isfinite(value):
            array = array.astype(np.float64)
        array.ravel()[random.randrange(array.size)] = value
    return array


_DAMAGES: dict[str, Any] = {
    "missing": lambda a, r: None,
    "float32": lambda a, r: a.astype(np.float32),
    "int8": lambda a, r: a.astype(np.int8),
    "complex": lambda a, r: a.astype(complex),
    "words": lambda a, r: a.astype(str),
    "truths": lambda a, r: a.astype(bool),
    "objects": lambda a, r: a.astype(object),
    "dates": lambda a, r: np.array(["2026-01-01"], dtype="datetime64[D]"),
    "number": lambda a, r: np.float64(1.0),
    "empty": lambda a, r: a[:0],
    "flat": lambda a, r: a.ravel(),
    "cut": lambda a, r: a[:-1],
    "doubled": lambda a, r: np.concatenate([a, a]),
    "one axis more": lambda a, r: a[None],
    "turned": lambda a, r: a.T,
    "nan": lambda a, r: _with(a, r, float("nan")),
    "infinite": lambda a, r: _with(a, r, float("inf")),
    "negative": lambda a, r: _with(a, r, -2),
    "huge": lambda a, r: _with(a, r, 2**40),
    "unsigned": lambda a, r: a.astype(np.uint64),
    "all zero": lambda a, r: np.zeros_like(a),
}
