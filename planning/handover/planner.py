"""`plan_rig` and `sweep` as a designer calls them, in scripts and notebooks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from inspect import signature
from itertools import product
from typing import Any, ParamSpec

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning import pipeline
from planning.cache.cache import Cache
from planning.model.errors import InfeasibleLimitsError, InputError
from planning.model.plan import InterruptedPlanError, RequirementError, RigPlan
from planning.model.progress import Report
from planning.rig.rig import Rig
from planning.scene.ranges.ranged_body import RangedBody
from planning.steps.refused import check_values

from .handed_plan import HandedPlan
from .plan_tables import Row, Table, table

_Options = ParamSpec("_Options")
# Keys of rig files are told by it: "placement.standoff_mm".
_DOT = "."


def _handing(planned: Callable[_Options, RigPlan]) -> Callable[_Options, HandedPlan]:
    """Hand on what a function returns, or raises, in the form for designers."""

    @wraps(planned)
    def handed(*args: _Options.args, **options: _Options.kwargs) -> HandedPlan:
        for name, value in options.items():
            options[name] = _plain(value)
        try:
            return HandedPlan.of(planned(*args, **options))
        except RequirementError as error:
            raise RequirementError(
                HandedPlan.of(error.plan), error.shortfalls
            ) from None
        except InterruptedPlanError as error:
            raise InterruptedPlanError(HandedPlan.of(error.plan)) from None

    return handed


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return a number of an array as Python's own: plan and rig files take no other."""
    return value.item() if isinstance(value, np.generic) else value


plan_rig = _handing(pipeline.plan_rig)


@dataclass(frozen=True, eq=False)
class Planner:
    """A mesh and a rig that are planned again and again, from `prepare`."""

    mesh: TriangleMesh | RangedBody
    rig: Rig
    cache: Cache
    asked: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def plan(self, **asked: Any) -> HandedPlan:  # noqa: ANN401
        """Return what `plan_rig` does, with its options beside those of `prepare`.

        What doesn't hang on those that changed is known from before.
        """
        options: dict[str, Any] = {"cache": self.cache, **self.asked, **asked}
        return plan_rig(self.mesh, self.rig, **options)


def prepare(
    mesh: TriangleMesh | RangedBody,
    rig: Rig,
    *,
    cache: Cache | None = None,
    **asked: Any,  # noqa: ANN401
) -> Planner:
    """Return what plans one mesh with one rig for requirements that change.

    Args:
        mesh: As of `plan_rig`.
        rig: The rig.
        cache: What was answered before; None: one in memory. With `Cache.on_disk()`
            what the command line left is used, too, and the other way round.
        asked: Options of `plan_rig` that every plan has unless it is given others:
            `max_projectors=4`, so that there are devices to plan.

    Raises:
        InputError: If that is no mesh, or no rig.
        TypeError: If `plan_rig` has no such option.
    """
    check_values({"mesh": mesh, "rig": rig})
    signature(pipeline.plan_rig).bind_partial(mesh, rig, **asked)
    return Planner(mesh, rig, cache or Cache.in_memory(), asked)


def sweep(
    mesh: TriangleMesh | RangedBody,
    rig: Rig,
    grid: Mapping[str, Sequence[Any]],
    *,
    asked: Mapping[str, Any],
    progress: Report | None = None,
) -> Table:
    """Plan a mesh with every combination of settings; return a row for each.

    Args:
        mesh: As of `plan_rig`.
        rig: The rig that is changed.
        grid: Values of options of `plan_rig` (`coverage`), or of keys of the rig file,
            told by a dot (`placement.standoff_mm`).
        asked: Options of `plan_rig` that all have; `"check": False` makes it quick.
        progress: Receives a line before each plan.

    Returns:
        The settings, numbers of devices with their proved least, covered shares of what
        can be reached, median sigma [mm], and whether all requirements are met, if not
        why: a pandas frame where pandas is there, else a list of rows.

    Raises:
        InputError: If a setting is none of the rig file's, or its values no list.
    """
    _check_sweep(mesh, rig, grid, asked)
    rows: list[Row] = []
    asked = {"cache": Cache.in_memory(), **asked}
    for values in product(*grid.values()):
        settings = dict(zip(grid, map(_plain, values), strict=True))
        options = {k: v for k, v in settings.items() if _DOT not in k}
        changed = rig.replace(**_tables(settings))
        if progress is not None:
            progress(", ".join(f"{key} = {value}" for key, value in settings.items()))
        try:
            plan = plan_rig(mesh, changed, on_miss="return", **{**asked, **options})
            rows.append(settings | _figures(plan))
        except InfeasibleLimitsError as error:
            rows.append(settings | {"met": False, "why": str(error)})
    return table(rows)


def _check_sweep(
    mesh: object, rig: object, grid: Mapping[str, Any], asked: Mapping[str, Any]
) -> None:
    check_values({"mesh": mesh, "rig": rig})
    for name, values in grid.items():
        if isinstance(values, str) or not np.iterable(values):
            raise InputError(
                f"grid[{name!r}] = {values!r} must be a list of values: write "
                f"[{values!r}]"
            )
    for name in ("mesh", "rig", "on_miss"):
        if name in asked or name in grid:
            raise InputError(f"{name} is sweep's own: leave it out of asked and grid")


def _tables(settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return settings with a dot as tables of a rig file."""
    tables: dict[str, dict[str, Any]] = {}
    for setting, value in settings.items():
        name, _, key = setting.partition(_DOT)
        if _DOT in key:
            raise InputError(f"{setting} must be TABLE.KEY of a rig file")
        if key:
            tables.setdefault(name, {})[key] = value
    return tables


def _figures(plan: HandedPlan) -> Row:
    proofs, areas = plan.document.certificates, plan.coverage.target
    sigma, missed = plan.coverage.sigma, plan.missed
    lights = proofs.projectors
    return {
        "projectors": len(plan.projectors),
        "projectors_least": 0 if lights is None else lights.needed.lower_bound,
        "cameras": len(plan.cameras),
        "cameras_least": proofs.cameras.needed.lower_bound,
        "lit": areas.lit_m2 / max(areas.reachable_by_projectors_m2, 1e-12),
        "measured": areas.measured_m2 / max(areas.reachable_by_cameras_m2, 1e-12),
        "sigma_mm": None if sigma is None else 1e3 * sigma.median_m,
        "met": not missed,
        "why": missed[0] if missed else "",
    }
