"""Edit every leaf of a plan file: what `plan verify` refuses, finds and lets by.

Usage: python -m benchmarks.plans.edits [--share 0.1] [--seed 0] [PLAN]   (ringrig
    installed, from a checkout)

Plans a sample head with few candidates (or takes PLAN, a folder), checked from pixels.
Then every leaf of `plan.json` (a share of them, drawn) is edited in six ways or more:
numbers by a per mille, by a tenth, by one, times 500, to 0, to their negative; words,
truths and lists to others; and any of them to null, to another type, or left out. Each
edited plan is read and audited, and its recorded check is compared with that of the
plan as made: pixels are rendered once, since no edit of these figures moves a device.
Prints for each section of the plan how many edits were refused when read (exit 3),
found by the audit (exit 1), passed, or crashed; then the leaves at which one passed.
Those of `NO_CLAIM` are no claims, each with its reason. Returns 1 where another passes,
or anything crashes.
"""

import argparse
import copy
import json
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from planning import RigPlan
from planning.cli.other_commands import write_sample
from planning.model.errors import PlanningError
from planning.verify.verification import hold_figures, verify_plan

from .speed import RUN

_RIG = """
base = "default"
name = "few candidates"
[placement]
n_candidate_projectors = 60
n_candidate_cameras = 60
n_reference_projectors = 600
n_reference_cameras = 400
"""
# What isn't a claim about the rig or what it measures, by the path's beginning.
NO_CLAIM = {
    "created": "when the plan was made",
    "command": "how it was asked for, in the user's words",
    "timings_s": "wall time of that run",
    "cost.t": "wall time of that run",
    "meshes.0.path": "where the file lay",
}
_Path = tuple[str | int, ...]
_GONE = object()


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("plan", nargs="?", type=Path)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = asked.plan or _made(Path(name))
        document = json.loads((folder / "plan.json").read_text())
        plan = RigPlan.load(folder / "plan.json")
        pixels = verify_plan(plan).reconstruction
        assert pixels is not None
        ended: dict[str, Counter[str]] = defaultdict(Counter)
        let_by: dict[str, list[str]] = defaultdict(list)
        for path, value in _leaves(document):
            if rng.random() >= asked.share:
                continue
            for what, other in _edits(value):
                edited = _with(document, path, other)
                how = _judged(edited, plan, pixels.record())
                told = ".".join(map(str, path))
                if how == "passed" and any(told.startswith(key) for key in NO_CLAIM):
                    how = "no claim"
                ended[str(path[0])][how.split(":")[0]] += 1
                if how not in ("refused", "found", "no claim"):
                    let_by[told].append(f"{what}: {how}")
    _print(ended, let_by)
    return int(bool(let_by))


def _made(folder: Path) -> Path:
    (folder / "few.toml").write_text(_RIG)
    write_sample(folder / "head.obj", n_faces=1500)
    words = ["--mesh", str(folder / "head.obj"), "--rig", str(folder / "few.toml")]
    words += ["--max-projectors", "6", "-o", str(folder / "plan"), "--quiet"]
    subprocess.run([*RUN, *words, "--no-report", "--no-patterns"], check=False)
    return folder / "plan"


def _leaves(value: object, path: _Path = ()) -> Iterator[tuple[_Path, Any]]:
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _leaves(part, (*path, key))
    elif isinstance(value, list) and value:
        for k, part in enumerate(value):
            yield from _leaves(part, (*path, k))
    else:
        yield path, value


def _edits(value: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
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


def _with(document: dict[str, Any], path: _Path, value: object) -> dict[str, Any]:
    edited = copy.deepcopy(document)
    place: Any = edited
    for key in path[:-1]:
        place = place[key]
    if value is _GONE:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return edited


def _judged(edited: dict[str, Any], plan: RigPlan, fresh: Any) -> str:  # noqa: ANN401
    """How a plan file ends: refused, found, passed, or the exception that it raises."""
    try:
        other = RigPlan.from_document(edited, plan.surface)
        if other.document.surface.sha256 != plan.document.surface.sha256:
            return "refused"
        found = verify_plan(other, check_pixels=False).failures
        found += tuple(hold_figures(other, fresh, plan.document.seed)[0])
    except PlanningError:
        return "refused"
    except Exception as error:
        return f"crashed: {type(error).__name__}: {error}"
    if found or other.document.reconstruction is None:
        return "found"
    return "passed"


def _print(ended: dict[str, Counter[str]], let_by: dict[str, list[str]]) -> None:
    kinds = "refused", "found", "no claim", "passed", "crashed"
    print(f"| section | {' | '.join(kinds)} |\n{(len(kinds) + 1) * '|---'}|")
    total = Counter[str]()
    for section, counts in ended.items():
        total += counts
        print(f"| {section} | {' | '.join(str(counts[kind]) for kind in kinds)} |")
    print(f"| all | {' | '.join(str(total[kind]) for kind in kinds)} |\n")
    for path, edits in let_by.items():
        print(f"{path}: {'; '.join(edits)}")


if __name__ == "__main__":
    sys.exit(main())
