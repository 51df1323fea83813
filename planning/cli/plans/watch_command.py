"""What `plan --watch` does: plan whenever the rig file or a mesh is saved."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from geometry.mesh.mesh import MeshError
from planning.cache.cache import Cache
from planning.cli.console import tell
from planning.cli.lines.comparison import compared
from planning.model.errors import PlanningError
from planning.model.plan import InterruptedPlanError, RigPlan

from .plan_command import cache_of, planned_once

# How often files are looked at, and how long one stays as it is before it is read: what
# an editor writes in pieces is then whole [s].
_LOOK_S, _SETTLED_S = 0.2, 0.3

_Stamps = tuple[tuple[int, int] | None, ...]


def watch_command(options: Mapping[str, Any], command: Sequence[str]) -> int:
    """Plan again and again until Ctrl-C; return the exit code of the last plan."""
    # With ranges there is no mesh.
    of_objects = options["meshes"] or (options["ranges"],)
    paths = tuple(Path(file) for file in (options["watch"], *of_objects))
    several = f"one of {len(of_objects)} meshes"
    objects = of_objects[0] if len(of_objects) == 1 else several
    cache = cache_of(options)
    if cache.entries is None:
        cache = Cache.in_memory()
    last: tuple[int, RigPlan] | None = None
    while True:
        before = _stamps(paths)
        try:
            last = _replanned(options, command, cache, last and last[1])
        except (PlanningError, MeshError, OSError) as error:
            # Half saved, or a slip: the next save mends it.
            tell(str(error))
        if last is not None and last[0] == InterruptedPlanError.exit_code:
            return last[0]
        try:
            tell(f"waiting for {paths[0]} or {objects} to be saved; Ctrl-C ends")
            _wait(paths, before)
        except KeyboardInterrupt:
            if last is None:
                raise
            return last[0]


def _replanned(
    options: Mapping[str, Any],
    command: Sequence[str],
    cache: Cache,
    last: RigPlan | None,
) -> tuple[int, RigPlan]:
    def news(plan: RigPlan) -> Iterator[str]:
        """Tell what is another than in the plan before."""
        if last is not None:
            unchecked = replace(
                last, document=last.document.changed(reconstruction=None)
            )
            differ = [row for row in compared(unchecked, plan) if row.differs]
            for row in differ:
                yield f"changed: {row.what} {row.first} -> {row.second}"
            if not differ:
                yield "changed: nothing"

    return planned_once(options, command, cache, news=news)


def _wait(paths: Sequence[Path], before: _Stamps) -> None:
    """Return when a file is another than before, and has been for a moment."""
    while (now := _stamps(paths)) == before or None in now:
        time.sleep(_LOOK_S)
    while True:
        time.sleep(_SETTLED_S)
        if (later := _stamps(paths)) == now:
            return
        now = later


def _stamps(paths: Sequence[Path]) -> _Stamps:
    """When each file was written, and its size; None: there is none just now."""
    stamps: list[tuple[int, int] | None] = []
    for path in paths:
        try:
            told = path.stat()
            stamps.append((told.st_mtime_ns, told.st_size))
        except OSError:
            stamps.append(None)
    return tuple(stamps)
