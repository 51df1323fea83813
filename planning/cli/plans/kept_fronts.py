"""The folder of a front, and which of its points `plan --take` goes on from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from planning.model.front import Front
from planning.model.words import count_words, shell_word
from planning.steps.front.kept_front import FRONT_FILE, KeptFront, read_front
from planning.steps.front.taken_point import TakenPoint


def front_folder(options: Mapping[str, Any], path: Path) -> Path:
    """Return the folder that a front is kept in."""
    return options["output"] or Path(f"{path.name.split('.')[0]}-front")


def taken_point(count: tuple[int, int], folder: Path) -> TakenPoint:
    """Return the point of the front that a folder keeps.

    Raises:
        click.UsageError: If there is no front, or it has no such point.
        PlanFileError: If its file is damaged.
    """
    if not (folder / FRONT_FILE).exists():
        raise click.UsageError(
            f"--take {count[0]},{count[1]}: {folder} keeps no front ({FRONT_FILE}); "
            f"make it with --pareto -o {shell_word(folder)}, or name its folder with -o"
        )
    kept = read_front(folder)
    point = kept.front.point(*count)
    if point is None:
        raise click.UsageError(
            f"--take {count[0]},{count[1]}: the front in {folder} has "
            f"{_extent(kept.front)}; take one of these{_remedy(count, kept)}"
        )
    return TakenPoint(kept, point)


def _extent(front: Front) -> str:
    """Say which points there are."""
    p, c = (sorted({one.count[k] for one in front.points}) for k in (0, 1))
    return f"{p[0]} to {p[-1]} projectors and {c[0]} to {c[-1]} cameras"


def _remedy(count: tuple[int, int], kept: KeptFront) -> str:
    """Say why there are no fewer devices, or how to get more."""
    stand, points = kept.standing, kept.front.points
    if count[0] < stand[0] or count[1] < stand[1]:
        return (
            f": {count_words(stand[0], 'projector')} and "
            f"{count_words(stand[1], 'camera')} stand already, and are in each"
        )
    p, c = (max(one.count[k] for one in points) for k in (0, 1))
    if count[0] > p or count[1] > c:
        return (
            f", or make it larger with --pareto --max-projectors {max(p, count[0])} "
            f"--max-cameras {max(c, count[1])}"
        )
    return ""
