"""Options that accept what a plan misses: one alone, or all that it takes."""

import re
from collections.abc import Sequence

# The option that accepts one requirement that a plan misses.
_ACCEPTS = re.compile(r"(--\S+) ([\d.]+) accepts (?:this plan|what there is)$")


def accepting_all(every: Sequence[Sequence[str]]) -> list[tuple[str, ...]]:
    """Return what helps each shortfall, with options that accept all of them.

    Where several are missed, what accepts one doesn't accept the plan: all such options
    do, if each shortfall has one. Members of a family ask for the least of theirs.
    """
    if len(every) == 1:
        return [tuple(every[0])]
    found = [[m for m in map(_ACCEPTS.search, helps) if m] for helps in every]
    least: dict[str, str] = {}
    for option, share in (m.groups() for some in found for m in some):
        least[option] = min(least.get(option, share), share, key=float)
    options = " ".join(f"{option} {share}" for option, share in least.items())
    verb = "accepts" if len(least) == 1 else "together accept"

    def instead(one: re.Match[str]) -> str:
        if all(found):
            return f"{options} {verb} this plan"
        return f"{one[1]} {least[one[1]]} asks for no more"

    return [tuple(_ACCEPTS.sub(instead, text) for text in helps) for helps in every]
