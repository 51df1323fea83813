"""Quantities as a person reads them, and paths as a shell does."""

import math
import shlex
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

# Areas below this are told in mm² [m²].
_SMALL_M2 = 1e-4


def area_words(area_m2: float) -> str:
    """Return an area in cm², or a small one in mm²."""
    if area_m2 < _SMALL_M2:
        return f"{1e6 * area_m2:.3g} mm²"
    return f"{1e4 * area_m2:.1f} cm²"


def count_words(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless it is 1."""
    return f"{count} {noun}{'s' * (count != 1)}"


def printable(line: str, is_shown: Callable[[str], bool] = str.isprintable) -> str:
    """Return a line with characters that aren't shown written out.

    As a control sequence in words of a stranger's file they could wipe out other lines.
    """
    return "".join(
        character
        if is_shown(character)
        else character.encode("unicode_escape").decode()
        for character in line
    )


def shell_word(path: Path | str) -> str:
    """Return a path to paste into a command, which takes it for no option of its."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def tenths(numbers: Iterable[float]) -> list[float]:
    """Return numbers as one decimal shows them, halves as a format rounds, no -0.0."""
    return [round(float(number), 1) + 0.0 for number in numbers]


def percent(
    share: float, *, decimals: int = 1, asked: float = 0.0, most: float = math.inf
) -> str:
    """Return a share in percent; one that misses what is asked is rounded away from it.

    Args:
        share: It.
        decimals: Of the percents.
        asked: What must be reached; what is less is rounded down.
        most: What must not be exceeded; what is more is rounded up.
    """
    # What falls short must not look as if it were enough.
    steps = 10.0 ** (decimals + 2)
    if share < asked:
        share = math.floor(steps * share) / steps
    elif share > most:
        share = math.ceil(steps * share) / steps
    return f"{100.0 * share:.{decimals}f} %"


def share_words(
    part: float, whole: float, asked: float = 0.0, *, of_nothing: str = "none"
) -> str:
    """Return which share of a whole a part is, as `percent` does."""
    return percent(part / whole, asked=asked) if whole > 0.0 else of_nothing


def labelled(label: str, lines: Sequence[str]) -> list[str]:
    """Return lines of a block of the summary: its label stands before the first."""
    return [f"{'' if k else label:<9}{line}" for k, line in enumerate(lines)]


def percent_as_share(value: object) -> object:
    """Return 0.95 for "95 %", and anything else as it is.

    Raises:
        ValueError: If what stands before the sign isn't a number.
    """
    if isinstance(value, str) and value.endswith("%"):
        return float(value[:-1]) / 100.0
    return value


def stopped_words(
    counts: Sequence[int], causes: Sequence[str], weight_m2: float
) -> str:
    """Return which cause stops how many samples, the most first.

    Those that stop 1 % or more, in percent and as areas.
    """
    total = sum(counts)
    order = sorted(range(len(counts)), key=lambda i: -counts[i])
    return ", ".join(
        f"{causes[i]} {100.0 * counts[i] / total:.0f} % "
        f"({area_words(weight_m2 * counts[i])})"
        for i in order
        if counts[i] >= 0.01 * total
    )
