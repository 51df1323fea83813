"""Positions spread over the workspace: along rays from its centre, or on planes.

Along a ray x = r u every limit holds on intervals of r, so the admissible radius
nearest to one that is wanted is that one itself or an end of an interval. Only those
are tried.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.poses import fibonacci_cap
from planning.model.devices.bodies import Box
from planning.model.requirements import Workspace

from .admissible import admissible, is_zoned

_Array = NDArray[np.float64]
Range = tuple[float, float]

# Radii are tried this far on either side of an end.
_NUDGE_M = 1e-4
# Positions offered for each wanted, at most, and how many are looked at in one go.
_MOST_OFFERED = 200
_BATCH = 20_000
_LEVEL = 1e-12
# Powers of the root of x^4 = x + 1: steps that fill a box evenly, whatever their number
# (Roberts 2018, the golden ratio's successors).
_STEPS: _Array = np.array([1.2207440846057596**-k for k in (1, 2, 3)])


def shell_positions(workspace: Workspace, radius_m: Range, n: int) -> _Array:
    """Return at least n admissible positions if there are as many, shape (m, 3).

    In the middle of the shell; where zones cut it, as near to the middle as they allow,
    or on the mounting planes. The lattice is refined until n positions are left, so
    that a small workspace is searched as densely as a large one is.
    """
    offered = n
    while True:
        if workspace.mounting:
            laid = np.concatenate(_laid(workspace.mounting, offered))
            offsets = laid[admissible(workspace, radius_m, laid)]
        else:
            start = None if workspace.bearing is None else np.array(workspace.bearing)
            axis, half_angle = np.array(workspace.axis), workspace.half_angle
            cone = fibonacci_cap(offered, axis, half_angle, start=start)
            offsets = towards(workspace, radius_m, cone)
        if len(offsets) >= n or offered >= _MOST_OFFERED * n:
            return np.array(workspace.centre) + offsets
        wanted = np.ceil(1.1 * offered * n / max(len(offsets), 1))
        offered = int(min(wanted, _MOST_OFFERED * n))


def towards(
    workspace: Workspace,
    radius_m: Range,
    directions: _Array,
    wanted_m: float | None = None,
) -> _Array:
    """Return admissible offsets from the centre in directions (n, 3), shape (m, 3).

    At the radius wanted, by default the shell's middle, or as near as zones allow.
    """
    radius = 0.5 * sum(radius_m) if wanted_m is None else wanted_m
    if is_zoned(workspace):
        return along_rays(workspace, radius_m, directions, radius)
    offsets = radius * directions
    return offsets[admissible(workspace, (radius, radius), offsets)]


def along_rays(
    workspace: Workspace, radius_m: Range, directions: _Array, wanted_m: float
) -> _Array:
    """Return a position on each ray that has one, nearest to the radius wanted.

    Of unit directions (n, 3): offsets from the centre, in their order, shape (m, 3).
    """
    parts = [
        _on_rays(workspace, radius_m, directions[start : start + _BATCH], wanted_m)
        for start in range(0, len(directions), _BATCH)
    ]
    return np.concatenate([np.empty((0, 3)), *parts])


def _laid(planes: tuple[Box, ...], n: int) -> list[_Array]:
    """About n places on all planes together, by area."""
    areas = np.array([4.0 * plane.half_m[0] * plane.half_m[1] for plane in planes])
    counts = np.ceil(n * areas / areas.sum()).astype(np.int64)
    places: list[_Array] = []
    for plane, count in zip(planes, counts, strict=True):
        share = (0.5 + np.arange(count)[:, None] * _STEPS) % 1.0
        local = (2.0 * share - 1.0) * np.array(plane.half_m)
        places.append(np.array(plane.centre_m) + local @ np.array(plane.axes))
    return places


def _on_rays(
    workspace: Workspace, radius_m: Range, directions: _Array, wanted_m: float
) -> _Array:
    radii = _trials(workspace, radius_m, directions, wanted_m)
    trials = radii[..., None] * directions[:, None]
    good = admissible(workspace, radius_m, trials.reshape(-1, 3)).reshape(radii.shape)
    off = np.where(good, np.abs(radii - wanted_m), np.inf)
    best = np.argmin(off, axis=1)
    return trials[np.arange(len(best)), best][good.any(axis=1)]


def _trials(
    workspace: Workspace, radius_m: Range, directions: _Array, wanted_m: float
) -> _Array:
    """Radii at which a limit begins or ends to hold on each ray, shape (n, k)."""
    low, high = radius_m
    n = len(directions)
    ends = [np.full(n, r) for r in (wanted_m, low, high)]
    if workspace.floor_m is not None:
        rise = directions @ np.array(workspace.up)
        level = workspace.floor_m / _off_zero(rise)
        ends += [level - _NUDGE_M, level + _NUDGE_M]
    held = workspace.mounting + (() if workspace.box is None else (workspace.box,))
    for box in held + workspace.keep_out:
        enter, leave = _interval(box, directions)
        ends += [enter - _NUDGE_M, enter + _NUDGE_M, leave - _NUDGE_M]
        ends += [leave + _NUDGE_M, 0.5 * (enter + leave)]
    # A ray that misses a box has an end nowhere: the one wanted again.
    radii = np.column_stack(ends)
    return np.where((radii >= low) & (radii <= high), radii, wanted_m)


def _interval(box: Box, directions: _Array) -> tuple[_Array, _Array]:
    """Radii at which rays from the centre enter and leave a box, each (n,)."""
    axes, half = np.array(box.axes), np.array(box.half_m)
    along = _off_zero(directions @ axes.T)
    middle = axes @ np.array(box.centre_m)
    a, b = (middle - half) / along, (middle + half) / along
    return np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)


def _off_zero(values: _Array) -> _Array:
    return np.where(np.abs(values) < _LEVEL, _LEVEL, values)
