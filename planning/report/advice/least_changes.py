"""How limits of a rig may give way, and by how little, by what samples ask."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.model.devices.planned import PlannedProjector
from planning.model.document.coverage_records import Relaxation
from planning.model.requirements import Requirements, Workspace
from planning.proofs.selection import cover_problem
from planning.rig import optics
from planning.rig.rig import Rig
from planning.rig.rig_tables import PinholeTable
from planning.rings.ring_radii import widest_ring_gap
from planning.scene.limits.limit import Array, Focus, LimitRelaxation, Mask, RigFacts
from planning.scene.limits.pair_limits import MEASURED_LIMITS
from planning.scene.limits.projector_limits import PROJECTOR_LIMITS
from solvers import solve_max_coverage

ANYWHERE = "the whole shell as workspace"
ANY_SETTING = "a mount of any roll, pan, tilt and place"
# What is aimed at beyond the requirement, so that fresh samples confirm it.
SPARE = 0.003
# Less isn't worth telling.
_GAIN = 0.01
# Counted work of each cover, of which no proof is asked.
_BUDGET = 1e8
# Two ends of a range agree if they were computed from the same focus [m].
_SAME_M = 1e-6


@dataclass(frozen=True)
class Share:
    """Of n samples so many are `reached` by some pose; a `least` share must be.

    As much to spare is wanted as lets fresh samples confirm it.
    """

    n: int
    reached: int
    least: float

    @property
    def wanted(self) -> int:
        """Samples to gain."""
        aim = min(self.least + SPARE, 1.0)
        return int(np.ceil(aim * self.n - 1e-9)) - self.reached

    def gains(self, gained: dict[str, int]) -> tuple[Relaxation, ...]:
        """Return the changes that gain at least a percentage point, least first."""
        ranked = sorted(gained.items(), key=lambda pair: pair[1])
        return tuple(
            Relaxation(change=change, reachable_share=(self.reached + gain) / self.n)
            for change, gain in ranked
            if gain >= _GAIN * self.n
        )


def larger_workspaces(
    workspace: Workspace, kind: str
) -> Iterator[tuple[str, Workspace]]:
    """Yield changes of the workspace of a `projector` or a `camera`, and what it is."""
    if workspace.whole_shell != workspace:
        yield ANYWHERE, workspace.whole_shell
    mount = workspace.mount_of(kind)
    if mount is not None and mount.is_stepped:
        yield ANY_SETTING, workspace.free_mounts


def least_changes(
    relaxations: Sequence[LimitRelaxation], demanded: NDArray[np.float64], wanted: int
) -> dict[str, int]:
    """Return how far each limit alone must give way, and how many samples that gains.

    As far as is wanted, or where that can't be had, as far as it helps.

    Args:
        relaxations: Limits that may give way.
        demanded: The least that samples out of reach ask of each, (n_relaxations, n).
        wanted: Samples to gain.
    """
    changes: dict[str, int] = {}
    for relaxation, asks in zip(relaxations, demanded, strict=True):
        helped = np.sort(asks[np.isfinite(asks)])
        if helped.size and wanted > 0:
            last = min(wanted, helped.size) - 1
            value = float(relaxation.rounded(helped[last]))
            changes[relaxation.say(value)] = int((asks <= value).sum())
    return changes


def enough(
    covered: Mask, required: int, count: int, n_existing: int, seed: int
) -> bool:
    """Return whether so many candidates cover the required number of samples.

    What each covers is (n, m); the first ones exist and are taken in any case.
    """
    problem = cover_problem(covered, required, n_existing)
    best = solve_max_coverage(problem, count, seed=seed, budget=_BUDGET)
    return bool(covered[:, best.selected].any(axis=1).sum() >= required)


def least_enough(
    relaxation: LimitRelaxation,
    demanded: NDArray[np.float64],
    suffices: Callable[[Mask], bool],
) -> str | None:
    """Return the least change of a limit with which candidates are enough.

    Args:
        relaxation: Of the limit.
        demanded: What a sample asks of it at a candidate, shape (n, m).
        suffices: Whether what each candidate covers then is, shape (n, m).
    """
    asked = relaxation.rounded(demanded[np.isfinite(demanded)])
    values = np.unique(asked).tolist()
    least = bisect_left(values, True, key=lambda value: suffices(demanded <= value))
    return relaxation.say(values[least]) if least < len(values) else None


def relaxations_of_projectors(
    required: Requirements, projectors: Sequence[PlannedProjector]
) -> tuple[LimitRelaxation, ...]:
    """Return every way in which a limit of projectors such as these may give way."""
    several = len({projector.model for projector in projectors}) > 1
    facts = RigFacts(required, projectors[0].device, several_models=several)
    return tuple(r for limit in PROJECTOR_LIMITS for r in limit.relaxations(facts))


def relaxations_of_cameras(
    rig: Rig, required: Requirements
) -> tuple[LimitRelaxation, ...]:
    """Return every way in which a limit of the cameras or of pairs may give way."""
    device, gap = rig.camera_device(), rig.ring_gap_m
    if gap is None:
        gap = widest_ring_gap(*rig.optics, required.triangulation, rig.standoff_m)
    facts = RigFacts(
        required,
        device,
        _focus(rig.table.camera, device),
        gap,
        rig.ring_gap_m is None,
        len(rig.camera_models) > 1,
    )
    return tuple(r for limit in MEASURED_LIMITS for r in limit.relaxations(facts))


def _focus(table: PinholeTable, device: PinholeModel) -> Focus | None:
    """The blur that counts as sharp, where the range follows from it."""
    if table.focus is None or table.pixel_um is None:
        return None
    pixel, at = 1e-6 * table.pixel_um, 1e-3 * table.focus.distance_mm
    number, blur = table.focus.f_number, table.focus.blur_px
    focal = device.focal_px * pixel
    low, high = table.range_mm or (0.0, np.inf)
    allowed = 1e-3 * low, 1e-3 * high
    near, far = optics.depth_of_field(focal, number, blur * pixel, at)
    sharp = max(near, allowed[0]), min(far, allowed[1])
    if not np.allclose(sharp, device.range_m, rtol=0.0, atol=_SAME_M):
        return None

    def circle(distances: Array) -> Array:
        return optics.blur_diameter(focal, number, at, distances) / pixel

    return Focus(blur, number, allowed, circle)
