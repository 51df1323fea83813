"""Which single limit of the cameras, relaxed by how little, would make a plan pass.

Where too little of what is lit can be measured from anywhere, the reference poses say
what each sample asks of each limit; sorted, these say how far the limit must give way
for the required share. Where too few cameras are allowed, the same table says which
candidates measure what as the limit gives way, and bisection over covers finds the
least that is enough. Light, rings and ring axes stay as they are planned.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import CameraStage, NothingMeasuredError, n_fixed
from planning.model.planned import PlannedCamera
from planning.proofs.selection import cover_problem, required_samples
from planning.report.claims import Claims, Devices
from planning.rig.rig import Rig
from planning.scene.lighting import lit_stages
from planning.scene.limits import projector_limits
from planning.scene.limits.pair_limits import CAUSES, MEASURED
from planning.scene.measured import LitSamples, lit_samples, measured_by, taken
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import camera_candidates
from solvers import solve_max_coverage

from .camera_demands import demands
from .camera_knobs import Relaxation, knobs

_GAIN = 0.01
# Rows that covers are looked for on, and what they cover beyond the requirement, so
# that fresh samples confirm it.
_ROWS = 2000
_SPARE = 0.003
# Counted work of each cover, of which no proof is asked.
_BUDGET = 1e8


@dataclass(frozen=True, eq=False)
class OutOfReach:
    """What of the lit target no reference camera measures.

    Attributes:
        by_cause: Its area by the limit at which it comes furthest [m²].
        relaxations: `change` and `reachable_share`, of what is lit, least gain first.
    """

    by_cause: dict[str, float]
    relaxations: list[dict[str, Any]]


def out_of_reach(
    scene: Scene, rig: Rig, devices: Devices, claims: Claims
) -> OutOfReach:
    """Say why cameras reach too little of what is lit, and what would help.

    Args:
        scene: Surface and requirements.
        rig: As written.
        devices: The plan's and the reference sets.
        claims: Made for these devices; the same samples are looked at.
    """
    among = scene.among(devices.projectors)
    target = claims.target_samples
    planned = scene.among((*devices.projectors, *devices.cameras))
    lit = np.any(
        lit_stages(planned, devices.projectors, target) == projector_limits.LIT, 1
    )
    missed = target.take(lit & ~claims.measured_by.any(axis=1))
    rows = lit_samples(planned, devices.projectors, missed)
    table = _Least(knobs(rig, scene.requirements), len(rows.target))
    for camera in devices.reference_cameras:
        table.add(scene=among, camera=camera, rows=rows)
    out = table.furthest < MEASURED
    n = int(lit.sum())
    share = _Share(n, n - int(out.sum()), scene.requirements.min_reachable)
    found = table.least_changes(share)
    found |= _whole_shell(among, devices.reference_cameras, rows, out, share)
    weight = target.samples.weight
    counts = np.bincount(table.furthest[out], minlength=MEASURED)
    return OutOfReach(
        {
            cause: float(weight * count)
            for cause, count in zip(CAUSES, counts, strict=True)
            if count
        },
        share.gains(found),
    )


def nothing_measured(scene: Scene, rig: Rig, error: NothingMeasuredError) -> str:
    """Say the least that makes a part of what is lit measurable.

    Args:
        scene: With the bodies of the projectors.
        rig: As written.
        error: With poses, none of which measures a sample.
    """
    rows = error.samples
    if not len(rows.target):
        return "no limit of a camera helps"
    table = _Least(knobs(rig, scene.requirements), len(rows.target))
    for camera in error.cameras:
        table.add(scene=scene, camera=camera, rows=rows)
    share = _Share(len(rows.target), 0, scene.requirements.min_reachable)
    steps = [
        f"{step['change']} would make {100.0 * step['reachable_share']:.1f} % of what "
        f"is lit measurable"
        for step in share.gains(table.least_changes(share))
    ]
    if not steps:
        return (
            "no single limit of the cameras, relaxed, makes a part of it measurable "
            "that is worth it: look at the workspace and at the standoff"
        )
    return f"what would help: {'; '.join(steps)}"


def for_so_many(
    scene: Scene, rig: Rig, stage: CameraStage, count: int
) -> tuple[str, ...]:
    """Return each single change with which so many cameras would be enough.

    Args:
        scene: With the bodies of the projectors.
        rig: As written.
        stage: Candidates, and lit samples.
        count: Cameras that are allowed.
    """
    n = min(len(stage.cover.samples.target), _ROWS)
    rows = taken(stage.cover.samples, np.arange(n), stage.cover.samples.lit)
    turned = knobs(rig, scene.requirements)
    asked = np.stack(
        [demands(scene, camera, rows, turned).asked for camera in stage.reference],
        axis=2,
    )
    found: list[str] = []
    for knob, table in zip(turned, asked, strict=True):
        value = _least_enough(knob, _Covers(table, scene, count))
        if value is not None:
            found.append(knob.say(value))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Share:
    """How much of n lit samples is reached now, and how much must be.

    Attributes:
        n: Lit samples.
        reached: Those that some pose measures.
        least: Share that must be.
    """

    n: int
    reached: int
    least: float

    @property
    def wanted(self) -> int:
        """Samples to gain."""
        return int(np.ceil(self.least * self.n - 1e-9)) - self.reached

    def gains(self, gained: dict[str, int]) -> list[dict[str, Any]]:
        """Return the changes that gain at least a percentage point, least first."""
        entries = [
            {"change": change, "reachable_share": (self.reached + more) / self.n}
            for change, more in gained.items()
            if more >= _GAIN * self.n
        ]
        return sorted(entries, key=lambda entry: entry["reachable_share"])


class _Least:
    """The least that samples ask of each knob, and how far they come, over cameras.

    Args:
        turned: The knobs.
        n: Samples.
    """

    def __init__(self, turned: tuple[Relaxation, ...], n: int) -> None:
        self._knobs = turned
        self._asked = np.full((len(turned), n), np.inf)
        self.furthest = np.zeros(n, dtype=np.int8)

    def add(self, *, scene: Scene, camera: PlannedCamera, rows: LitSamples) -> None:
        """Look at the samples from one camera more."""
        left = np.flatnonzero(self.furthest < MEASURED)
        if not len(left):
            return
        found = demands(scene, camera, taken(rows, left, rows.lit), self._knobs)
        self._asked[:, left] = np.minimum(self._asked[:, left], found.asked)
        self.furthest[left] = np.maximum(self.furthest[left], found.furthest)

    def least_changes(self, share: _Share) -> dict[str, int]:
        """Return how far each knob alone must turn, and how many samples that gains.

        As far as the share asks, or where it can't be had, as far as it helps.
        """
        out = self.furthest < MEASURED
        found: dict[str, int] = {}
        for knob, asked in zip(self._knobs, self._asked[:, out], strict=True):
            helped = np.sort(asked[np.isfinite(asked)])
            if helped.size and share.wanted > 0:
                last = min(share.wanted, helped.size) - 1
                value = float(knob.rounded(helped[last]))
                found[knob.say(value)] = int((asked <= value).sum())
        return found


@dataclass(frozen=True, eq=False)
class _Covers:
    """What so many candidates cover at the most, as one knob turns.

    Attributes:
        asked: What a sample asks of the knob at a candidate, (n, m).
        scene: Requirements and seed.
        count: Cameras.
    """

    asked: NDArray[np.float64]
    scene: Scene
    count: int

    def enough(self, value: float) -> bool:
        """Whether they cover the required share of what is reachable then."""
        measured = self.asked <= value
        share = min(self.scene.requirements.coverage + _SPARE, 1.0)
        required = required_samples(np.any(measured, axis=1), share)
        best = solve_max_coverage(
            cover_problem(measured, required, n_fixed(self.scene)),
            self.count,
            seed=self.scene.seed,
            budget=_BUDGET,
        ).selected
        return bool(measured[:, best].any(axis=1).sum() >= required)


def _least_enough(knob: Relaxation, covers: _Covers) -> float | None:
    """Return the least value of a knob, rounded, at which a cover is enough."""
    finite = covers.asked[np.isfinite(covers.asked)]
    values = np.unique(knob.rounded(finite)).tolist()
    if not values or not covers.enough(values[-1]):
        return None
    low, high = 0, len(values) - 1
    while low < high:
        middle = (low + high) // 2
        low, high = (
            (low, middle) if covers.enough(values[middle]) else (middle + 1, high)
        )
    return values[high]


def _whole_shell(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    rows: LitSamples,
    out: NDArray[np.bool_],
    share: _Share,
) -> dict[str, int]:
    """What cameras anywhere in the shell would measure, where they may not stand."""
    workspace = scene.requirements.workspace
    whole = workspace.whole_shell
    if whole == workspace or share.wanted <= 0:
        return {}
    site = scene.site("camera", cameras[0].device)
    anywhere = camera_candidates(
        replace(cameras[0], existing=""),
        whole,
        workspace.n_reference_cameras,
        None if site is None else replace(site, workspace=whole),
    )
    left = np.flatnonzero(out)
    for camera in anywhere:
        if not len(left):
            break
        rest = taken(rows, left, rows.lit)
        left = left[~measured_by(scene, [camera], rest)[:, 0]]
    return {"the whole shell as workspace": int(out.sum()) - len(left)}
