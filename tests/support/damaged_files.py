"""Damaged rig files and plans, each from its seed, and how commands end on them.

Values of the wrong kind or far out of range (one to four at once, of a rig all must be
named), unknown keys, lines lost or doubled, bytes changed, a file cut off.
"""

import json
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from click.testing import CliRunner

from planning.cli.main import commands
from planning.rig.toml.preset_files import preset_names, preset_text

from .handmade import build_plan

_MESH = "v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 50\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@dataclass(frozen=True)
class Case:
    """A damaged file: how it was damaged, and keys that its faults must name."""

    kind: str
    damage: str
    content: bytes
    keys: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """How a command ended on it."""

    code: int
    told: str
    unnamed: tuple[str, ...]

    @property
    def is_bad(self) -> bool:
        """Whether it isn't what a user may expect."""
        traceback = "Traceback" in self.told or "internal error" in self.told
        silent = self.code != 0 and not self.told.strip()
        return self.code not in (0, 3, 4) or traceback or silent or bool(self.unnamed)


def cases(seeds: range) -> Iterator[Case]:
    """Yield a damaged file for each seed: even ones are rigs, odd ones plans."""
    rigs = [preset_text(name) for name in preset_names()]
    plan = build_plan().to_json()
    for seed in seeds:
        random = Random(seed)
        text = plan if seed % 2 else random.choice(rigs)
        wrong = _wrong_plan if seed % 2 else _wrong_rig
        kind = "plan" if seed % 2 else "rig"
        damage, content, keys = _damaged(random, text, wrong)
        yield Case(kind, damage, content, keys)


def _damaged(
    random: Random,
    text: str,
    wrong: Callable[[Random, str, int], tuple[str, tuple[str, ...]]],
) -> tuple[str, bytes, tuple[str, ...]]:
    lines = text.splitlines()
    which = random.randrange(8)
    if which <= 2:
        n = random.randint(1, 4)
        text, keys = wrong(random, text, n)
        return f"{n} wrong values", text.encode(), keys
    if which == 3:
        place = random.randrange(len(lines))
        lines[place:place] = ["no_such_key = 1" if "=" in text else '"no_such": 1,']
        return "unknown key", "\n".join(lines).encode(), ()
    if which == 4:
        del lines[random.randrange(len(lines))]
        return "line lost", "\n".join(lines).encode(), ()
    if which == 5:
        place = random.randrange(len(lines))
        lines.insert(place, lines[place])
        return "line doubled", "\n".join(lines).encode(), ()
    data = bytearray(text.encode())
    if which == 6:
        for _ in range(random.randint(1, 8)):
            data[random.randrange(len(data))] = random.randrange(256)
        return "bytes changed", bytes(data), ()
    return "cut off", bytes(data[: random.randrange(len(data))]), ()


def _wrong_rig(random: Random, text: str, n: int) -> tuple[str, tuple[str, ...]]:
    """Replace values of numeric keys by what can't be any; return the keys."""
    lines = text.splitlines()
    numeric = [
        number
        for number, line in enumerate(lines)
        if " = " in line
        and isinstance(tomllib.loads(line.strip()).popitem()[1], int | float | list)
    ]
    keys: list[str] = []
    for number in random.sample(numeric, min(n, len(numeric))):
        key = lines[number].split(" = ")[0].strip()
        value = random.choice(('"text"', "nan", "inf", "-1e300", "[]", "{}"))
        lines[number] = f"{key} = {value}"
        keys.append(key)
    return "\n".join(lines), tuple(keys)


def _wrong_plan(random: Random, text: str, n: int) -> tuple[str, tuple[str, ...]]:
    """Replace numbers of a plan by what can't be any."""
    document = json.loads(text)
    places = list(_numbers(document))
    keys: list[str] = []
    for holder, key in random.sample(places, n):
        holder[key] = random.choice(("text", None, [], {}, True))
        keys.append(str(key))
    # What a plan leaves open may be null; only the exit is looked at.
    return json.dumps(document), ()


def _numbers(value: Any) -> Iterator[tuple[Any, Any]]:
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in items:
        if isinstance(inner, dict | list):
            yield from _numbers(inner)
        elif isinstance(inner, int | float):
            yield value, key


def outcome(case: Case, folder: Path) -> Outcome:
    """Read a damaged file by the command that a user would."""
    if case.kind == "rig":
        path, mesh = folder / "rig.toml", folder / "mesh.obj"
        mesh.write_text(_MESH)
        words = ["lens", "--mesh", str(mesh), "--rig", str(path)]
    else:
        path = folder / "plan.json"
        build_plan().save(path)
        words = ["show", str(path)]
    path.write_bytes(case.content)
    result = CliRunner().invoke(commands, words)
    told = result.stderr
    if result.exception and not isinstance(result.exception, SystemExit):
        told += f"Traceback: {result.exception!r}"
    unnamed = tuple(key for key in case.keys if result.exit_code and key not in told)
    return Outcome(result.exit_code, told, unnamed)
