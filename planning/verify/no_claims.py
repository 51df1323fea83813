"""What of a plan no reader relies on: how it came about, words, times and advice.

Keys are dotted, `*` stands for any name or number; a key stands for all below it.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

NO_CLAIM = {
    "created": "when the plan was made",
    "command": "how it was asked for, in the user's words",
    "timings_s": "wall time of that run",
    "cost.t4": "processor time of that run; C holds it, and must be its sum",
    "cost.t5": "as t4",
    "cost.t2": "as t4, a pixel",
    "cost.t3": "as t4",
    "cost.C": "a sum of times; that it is their sum is a claim, and audited",
    "cost.C_before": "as C",
    "cost.C_all_rings": "as C",
    "cost.render_s": "processor time of that check",
    "meshes.*.path": "where the file lay",
    "surface.selection.source": "where the file with the faces lay",
    "rig.name": "words of the rig file's author",
    "rig.description": "as rig.name",
    "rig.notes": "as rig.name",
    "rig.*.name": "what a device is called; of which model one is, is a claim",
    "rig.*.sources": "where the author has a figure from, in words",
    "rig.calibration.description": "as rig.name",
    "certificates.*.candidates.proof": "how it was found, in words",
    "coverage.relaxations": "advice",
    "coverage.camera_relaxations": "advice",
    "regions.*.coverage.relaxations": "advice",
    "certificates.*.needed.relaxations": "advice",
    "certificates.*.needed.wider_field": "advice",
    "certificates.*.routes.why": "advice, in words",
}


def is_under(key: str, patterns: Iterable[str]) -> bool:
    """Return whether a key is one of the patterns, or below one."""
    return under(tuple(patterns))(key) is not None


@cache
def under(patterns: tuple[str, ...]) -> Callable[[str], object]:
    """Return what is None of a key that is under none of the patterns.

    Compiled, as keys by the thousand are asked about.
    """
    return re.compile(rf"(?:{_any_of(patterns)})(?:\.|\Z)", re.DOTALL).match


def _any_of(patterns: Iterable[str]) -> str:
    return "|".join(re.escape(one).replace(r"\*", ".*") for one in patterns)


_NO_CLAIM = re.compile(_any_of(NO_CLAIM), re.DOTALL)


def claims_alone(value: Any, key: str = "") -> Any:  # noqa: ANN401
    """Return a document, or the part of it at a key, without what is no claim."""
    if isinstance(value, Mapping):
        named = {name: f"{key}.{name}" if key else str(name) for name in value}
        return {
            name: claims_alone(part, named[name])
            for name, part in value.items()
            if not _NO_CLAIM.fullmatch(named[name])
        }
    if isinstance(value, list):
        return [claims_alone(part, f"{key}.{i}") for i, part in enumerate(value)]
    return value
