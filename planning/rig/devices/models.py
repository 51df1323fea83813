"""The models of a kind of device: one, or a list of which a stock holds so many."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from geometry.devices import DeviceModel
from planning.model.devices.bodies import Body
from planning.model.errors import RigError
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.requirements import Stock
from planning.rig.rig_tables import ParallelTable, PinholeTable, RigTable

from .rig_devices import device_of, drawn_edges

# Relative: makers' f-numbers have two or three digits.
_ALIKE = 5e-3


@dataclass(frozen=True, eq=False)
class Model:
    """One model of a kind of device.

    Attributes:
        role: Its table in the rig file: `camera`, or of a list `camera 2`.
        table: As written.
        device: Its optics.
        name: What tells it from the others; empty where there is no other.
    """

    role: str
    table: PinholeTable | ParallelTable
    device: DeviceModel
    name: str

    @property
    def body(self) -> Body | None:
        """Its housing, if it has one."""
        return Body.of(self.table.body)


def models_of(
    table: RigTable, key: str, first: PinholeTable | ParallelTable
) -> tuple[Model, ...]:
    """Return the models of `camera`, `projector` or `parallel_projector`.

    Raises:
        RigError: If optics are none, or a list's models can't be told apart or differ
            in what all of a kind have in common.
    """
    tables = [first, *getattr(table, f"more_{key}s")]
    many = len(tables) > 1
    roles = [f"{key} {n}" if many else key for n in range(1, len(tables) + 1)]
    devices = [device_of(t, role) for t, role in zip(tables, roles, strict=True)]
    if faults := [*_faults(key, tables, devices), *_of_light(table, key, many)]:
        raise RigError("\n".join(f"rig {table.name}: {fault}" for fault in faults))
    return tuple(
        Model(role, each, device, each.name if many else "")
        for role, each, device in zip(roles, tables, devices, strict=True)
    )


def named(models: Sequence[Model], name: str | None) -> Model | None:
    """Return the model that a device names; the first of no name, None of another."""
    if not name:
        return models[0]
    return next((model for model in models if model.table.name == name), None)


def stock_of(kind: str, models: Sequence[Model]) -> Iterator[Stock]:
    """Yield how many there are of each of several models that are counted."""
    for model in models:
        if model.name and model.table.count is not None:
            yield Stock(kind, model.name, model.table.count)


def most_of(models: Sequence[Model], most: int | None) -> int | None:
    """Return how many devices are allowed: as many as there are, where one is counted.

    Of several models covers count each for itself.
    """
    count = models[0].table.count if len(models) == 1 else None
    return min((n for n in (most, count) if n is not None), default=None)


def _faults(
    key: str,
    tables: Sequence[PinholeTable | ParallelTable],
    devices: Sequence[DeviceModel],
) -> Iterator[str]:
    repeated = [name for name, n in Counter(t.name for t in tables).items() if n > 1]
    for name in repeated:
        yield (
            f"[[{key}]] has {name!r} more than once; raise its count, or give each "
            f"a name of its own"
        )
    if any(t.mount != tables[0].mount for t in tables):
        yield (
            f"[[{key}]] have different mounts, and a list has one for all: write the "
            f"same [{key}.mount] for each, or none"
        )
    first, *others = (drawn_edges(t, d) for t, d in zip(tables, devices, strict=True))
    for place, other in enumerate(others, 2):
        if key == "projector" and not _focused_alike(first, other):
            yield (
                f"[[projector]] {place} is {_focused(other)}, the first is "
                f"{_focused(first)}; the blur of drawn edges is one for all: write a "
                f"distance_mm and an f_number that give the same to "
                f"{100.0 * _ALIKE:g} %, or range_mm and no [projector.focus] for each"
            )


def _focused_alike(first: DrawnEdges, other: DrawnEdges) -> bool:
    if first.focus_m is None or other.focus_m is None:
        return first == other
    return math.isclose(first.focus_m, other.focus_m, rel_tol=_ALIKE) and math.isclose(
        first.aperture_m, other.aperture_m, rel_tol=_ALIKE
    )


def _focused(drawn: DrawnEdges) -> str:
    if drawn.focus_m is None:
        return "without [projector.focus]"
    at, pupil = 1e3 * drawn.focus_m, 1e3 * drawn.aperture_m
    return f"focused at {at:g} mm through a pupil of {pupil:.4g} mm (f / f_number)"


def _of_light(table: RigTable, key: str, many: bool) -> Iterator[str]:
    if many and table.photometry is not None:
        yield (
            f"[photometry] is of one projector and one camera, and there are several "
            f"[[{key}]]; take it out, or plan with one model"
        )
