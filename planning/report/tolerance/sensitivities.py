"""What each device does in each direction: to coverage if it stands so, and is known
to; to the errors if it does and nobody knows.
"""  # noqa: D205 - one sentence of two lines

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.parallel import mapped
from planning.model.devices.calibration_errors import AS_PLANNED, Mounting
from planning.model.progress import Report

from .built_case import BuiltCase
from .drawn_rigs import N_MOUNTED, N_UNKNOWN, bounds_of

# In the order of `drawn_rigs`: y is down, x across.
DIRECTIONS: tuple[str, ...] = ("across", "up", "along", "tilt", "pan", "roll", "focal")
# What a figure is told for: 1 mm, 0.1 degree, 0.1 %.
UNITS = bounds_of(Mounting(1e-3, float(np.radians(0.1)), 1e-3))
UNIT_WORDS = ("mm",) * 3 + ("0.1 deg",) * 3 + ("0.1 %",)
# Of these units is an unknown error stepped: what is measured stays the same.
_SMALL = 0.05


@dataclass(frozen=True)
class Sensitivity:
    """One device in one direction, a figure for each unit of `UNITS`.

    Attributes:
        device: Its id.
        direction: One of `DIRECTIONS`, in the device's axes.
        coverage: Largest loss of coverage of both signs; None: an existing device,
            which isn't mounted anew.
        rms_m: Of the errors of all points if nobody knows [m].
        slope: Central difference of the coverage.
        bend: Second difference of the coverage, by the unit's square.
        turned: Share of the target that begins or ceases to be measured.
    """

    device: str
    direction: str
    coverage: float | None
    rms_m: float
    slope: float = 0.0
    bend: float = 0.0
    turned: float = 0.0


@dataclass(frozen=True)
class FirstOrder:
    """What one direction at a time lets expect of all at once.

    Attributes:
        coverage_shift: Mean change of coverage, by second differences.
        coverage_deviation: Standard deviation of it, by slopes.
        near_limits: Sum over the directions of what each alone turns: an upper bound
            of the share of samples that are near a limit.
        rms_m: Root mean square of the plan's deviations, of first order [m].
    """

    coverage_shift: float
    coverage_deviation: float
    near_limits: float
    rms_m: float | None


def sensitivities(
    case: BuiltCase,
    mounting: Mounting = AS_PLANNED,
    *,
    threads: int | None = None,
    report: Report = lambda line: None,
) -> tuple[Sensitivity, ...]:
    """Return those of every device and direction.

    Of the mounting's bounds, or of a unit where it leaves a direction as planned.
    """
    report("devices and directions, one at a time")
    steps = bounds_of(mounting)
    steps = np.where(steps > 0.0, steps, UNITS)
    every = [
        (row, column)
        for row in range(len(case.rig.devices))
        for column in range(N_MOUNTED)
    ]
    _ = case.planned
    return tuple(mapped(lambda at: _of_one(case, steps, *at), every, threads))


def first_order(
    case: BuiltCase, found: Sequence[Sensitivity], mounting: Mounting
) -> FirstOrder:
    """Return what slopes and bends say of a mounting."""
    each = dict(zip(DIRECTIONS, bounds_of(mounting) / UNITS, strict=True))
    # The variance of a uniform deviate is a third of its bound's square.
    squares = np.array([each[one.direction] ** 2 / 3.0 for one in found])
    slopes, bends = np.array([(one.slope, one.bend) for one in found]).T
    moved = [one.turned for one in found if each[one.direction] > 0.0]
    return FirstOrder(
        float(0.5 * (bends * squares).sum()),
        float(np.sqrt((slopes**2 * squares).sum())),
        float(min(sum(moved), 1.0)),
        case.predicted_rms_m(),
    )


def _of_one(case: BuiltCase, steps: np.ndarray, row: int, column: int) -> Sensitivity:
    device, n = case.rig.devices[row], len(case.rig.devices)
    unknown = np.zeros((n, N_UNKNOWN))
    unknown[row, column] = _SMALL * UNITS[column]
    nothing = np.zeros((len(case.target), 3))
    errors = case.errors(case.planned, case.rig, unknown, nothing)
    rms = case.figures(case.planned, errors).rms_m or 0.0
    name = DIRECTIONS[column]
    if device.existing:
        return Sensitivity(device.id, name, None, rms / _SMALL)
    by, step = np.zeros((n, N_MOUNTED)), steps[column] / UNITS[column]
    by[row, column] = steps[column]
    own = slice(0, case.n_target)
    masks = [case.outcome(case.rig.moved(sign * by)).measured[own] for sign in (1, -1)]
    before, whole = case.planned.measured[own], max(int(case.by_cameras[own].sum()), 1)
    up, down = ((int(mask.sum()) - int(before.sum())) / whole for mask in masks)
    turned = (masks[0] != before) | (masks[1] != before)
    return Sensitivity(
        device.id,
        name,
        max(0.0, -up, -down) / step,
        rms / _SMALL,
        (up - down) / (2.0 * step),
        (up + down) / step**2,
        float(turned.mean()),
    )
