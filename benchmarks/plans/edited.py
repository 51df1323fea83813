"""How a plan is edited: every leaf in six ways or more, poses by a little."""

import copy
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

KeyPath = tuple[str | int, ...]
_MOVES_M, _TURNS_DEG = (2e-5, 1e-4, 1e-3), (0.002, 0.02, 0.2)
_GONE = object()


def leaves(value: object, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    """Yield the place and the value of every leaf."""
    if isinstance(value, dict) and value:
        for key, part in value.items():
            yield from leaves(part, (*path, key))
    elif isinstance(value, list) and value:
        for k, part in enumerate(value):
            yield from leaves(part, (*path, k))
    else:
        yield path, value


def edits(value: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Yield other values for a leaf, each with its name."""
    yield "left out", _GONE
    if value is not None:
        yield "null", None
    if isinstance(value, bool):
        yield "other truth", not value
        yield "number", 2
        yield "word", "true"
        yield "list", []
        return
    if isinstance(value, int | float):
        edits = {
            "per mille": value * 1.001 if isinstance(value, float) else value + 1,
            "tenth": value * 1.1 if isinstance(value, float) else value - 1,
            "times 500": value * 500,
            "zero": value * 0,
            "negative": -value,
            "a little": value + 1e-3 if isinstance(value, float) else value + 2,
        }
        yield from ((key, v) for key, v in edits.items() if v != value)
        yield "word", "much"
        yield "list", [value]
    elif isinstance(value, str):
        yield "other word", value + "x"
        yield "empty", ""
        yield "number", 1
        yield "list", [value]
    else:
        yield "word", "x"
        yield "number", 7
        yield "object", {"x": 1}
        yield "list of two", [1, 2]


def moved(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield plans of which one device, or a ring frame, stands a little elsewhere."""
    for kind in ("projectors", "cameras"):
        frames = [("world_from_device",)]
        if kind == "projectors":
            both = "world_from_device", "world_from_ring"
            frames += [("world_from_ring",), both]
        for names in frames:
            for words, change in (*_shifts(), *_turns()):
                edited = copy.deepcopy(document)
                for name in names:
                    pose = np.array(edited[kind][0][name])
                    edited[kind][0][name] = change(pose).tolist()
                yield f"{kind}.*.{' and '.join(names)}", words, edited


def _shifts() -> Iterator[tuple[str, Callable[[np.ndarray], np.ndarray]]]:
    for length in _MOVES_M:
        step = np.zeros((4, 4))
        step[0, 3] = length
        yield f"moved by {1e3 * length:g} mm", lambda pose, step=step: pose + step


def _turns() -> Iterator[tuple[str, Callable[[np.ndarray], np.ndarray]]]:
    for angle in _TURNS_DEG:
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        turn = np.eye(4)
        turn[1:3, 1:3] = [[c, -s], [s, c]]
        yield f"turned by {angle:g} degrees", lambda pose, turn=turn: pose @ turn


def put(document: dict[str, Any], path: KeyPath, value: object) -> None:
    """Set a leaf to another value, or leave it out."""
    place: Any = document
    for key in path[:-1]:
        place = place[key]
    if value is _GONE:
        del place[path[-1]]
    else:
        place[path[-1]] = copy.deepcopy(value)
