"""Figures of a plan against those that the code which made it gives again."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from planning.verify.audit.audit_findings import AuditFindings

# Where a part that came out again lacks a key, the plan has no business with it either;
# but for advice, which takes the search to give, for what the audit compares, and for
# parts of parts.
_ELSEWHERE = {"relaxations", "camera_relaxations", "asked"}
_PARTLY = {"meshes", "requirements", "rig", "ring_axes", "surface", "survival"}
# So many figures that differ are told.
_MOST_TOLD = 8


def compare_again(
    document: Mapping[str, Any], again: Mapping[str, Any], *, whole: bool = False
) -> tuple[str, ...]:
    """Return where a plan's document isn't to the last digit what came out again.

    Parts that couldn't be computed are None, and not compared; but where the `whole`
    document came out again, there is nothing that couldn't be.
    """
    if whole:
        differing = list(_differing(document, again, "", "whole"))
    else:
        differing = [
            found
            for key, part in again.items()
            for found in _differing(
                document.get(key), part, key, "part" if key in _PARTLY else "own"
            )
        ]
    findings = AuditFindings()
    for key, sentence in differing[:_MOST_TOLD]:
        findings.fail(key, sentence)
    if len(differing) > _MOST_TOLD:
        findings.fail("", f"{len(differing) - _MOST_TOLD} more figures differ")
    return findings.failures


def _differing(
    claimed: Any,  # noqa: ANN401
    made: Any,  # noqa: ANN401
    key: str,
    scope: Literal["whole", "own", "part"],
) -> Iterator[tuple[str, str]]:
    """Yield where two parts differ, with words; what one lacks goes by the scope."""
    if made is None and isinstance(claimed, Mapping) and scope != "whole":
        return
    if isinstance(made, Mapping) and isinstance(claimed, Mapping):
        for name, part in made.items():
            below = f"{key}.{name}".lstrip(".")
            yield from _differing(claimed.get(name, "nothing"), part, below, scope)
        lacking = set[str]() if scope == "part" else set(claimed) - set(made)
        for name in lacking - _ELSEWHERE if scope == "own" else lacking:
            yield (
                f"{key}.{name}".lstrip("."),
                f"claimed {claimed[name]!r}, no such figure comes out",
            )
    elif isinstance(made, list) and isinstance(claimed, list):
        if len(made) != len(claimed):
            yield key, f"{len(claimed)} are claimed, {len(made)} come out again"
        for place, (one, other) in enumerate(zip(claimed, made, strict=False)):
            yield from _differing(one, other, f"{key}.{place}", scope)
    elif claimed != made:
        yield key, f"claimed {claimed!r}, the same computation again gives {made!r}"
