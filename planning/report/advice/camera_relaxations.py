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

from planning.cameras.camera_cover import NothingMeasuredError, n_fixed
from planning.cameras.proved_cameras import CameraStage
from planning.model.planned import PlannedCamera
from planning.model.words import percent
from planning.proofs.selection import required_samples
from planning.report.claims import Claims, Devices
from planning.rig.rig import Rig
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.limits import projector_limits
from planning.scene.limits.limit import LimitRelaxation
from planning.scene.limits.pair_limits import CAUSES, MEASURED
from planning.scene.measured import LitSamples, lit_samples, measured_by, taken
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import camera_candidates

from .demands import demands
from .least_changes import Share, covers_enough, least_changes, relaxations_of_cameras

# What covers cover beyond the requirement, so that fresh samples confirm it.
_SPARE = 0.003


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
    samples = lit_samples(planned, devices.projectors, missed)
    table = _Least(relaxations_of_cameras(rig, scene.requirements), len(samples.target))
    for camera in devices.reference_cameras:
        table.add(scene=among, camera=camera, samples=samples)
    out = table.furthest < MEASURED
    n = int(lit.sum())
    share = Share(n, n - int(out.sum()), scene.requirements.min_reachable)
    changes = table.least_changes(share)
    changes |= _whole_shell(among, devices.reference_cameras, samples, out, share)
    weight = target.samples.weight
    counts = np.bincount(table.furthest[out], minlength=MEASURED)
    return OutOfReach(
        {
            cause: float(weight * count)
            for cause, count in zip(CAUSES, counts, strict=True)
            if count
        },
        share.gains(changes),
    )


def nothing_measured(scene: Scene, rig: Rig, error: NothingMeasuredError) -> str:
    """Say the least that makes a part of what is lit measurable.

    Args:
        scene: With the bodies of the projectors.
        rig: As written.
        error: With poses, none of which measures a sample.
    """
    samples = error.samples
    if not len(samples.target):
        return "no limit of a camera helps"
    table = _Least(relaxations_of_cameras(rig, scene.requirements), len(samples.target))
    for camera in error.cameras:
        table.add(scene=scene, camera=camera, samples=samples)
    share = Share(len(samples.target), 0, scene.requirements.min_reachable)
    steps = [
        f"{step['change']} would make {percent(step['reachable_share'])} of what is "
        f"lit measurable"
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
    lit = stage.cover.samples
    samples = taken(lit, np.arange(min(len(lit.target), DRAWS.fewer_devices)), lit.lit)
    relaxations = relaxations_of_cameras(rig, scene.requirements)
    demanded = np.stack(
        [
            demands(scene, camera, samples, relaxations).demanded
            for camera in stage.reference
        ],
        axis=2,
    )
    changes: list[str] = []
    for relaxation, table in zip(relaxations, demanded, strict=True):
        value = _least_enough(relaxation, _Covers(table, scene, count))
        if value is not None:
            changes.append(relaxation.say(value))
    return tuple(changes)


class _Least:
    """The least that samples ask of each limit, and how far they come, over cameras.

    Args:
        relaxations: Limits that may give way.
        n: Samples.
    """

    def __init__(self, relaxations: Sequence[LimitRelaxation], n: int) -> None:
        self._relaxations = relaxations
        self._demanded = np.full((len(relaxations), n), np.inf)
        self.furthest = np.zeros(n, dtype=np.int8)

    def add(self, *, scene: Scene, camera: PlannedCamera, samples: LitSamples) -> None:
        """Look at the samples from one camera more."""
        pending = np.flatnonzero(self.furthest < MEASURED)
        if not len(pending):
            return
        of_camera = demands(
            scene, camera, taken(samples, pending, samples.lit), self._relaxations
        )
        self._demanded[:, pending] = np.minimum(
            self._demanded[:, pending], of_camera.demanded
        )
        self.furthest[pending] = np.maximum(self.furthest[pending], of_camera.furthest)

    def least_changes(self, share: Share) -> dict[str, int]:
        """Return how far each limit alone must give way, and what that gains.

        As far as the share asks, or where it can't be had, as far as it helps.
        """
        out = self.furthest < MEASURED
        return least_changes(self._relaxations, self._demanded[:, out], share.wanted)


@dataclass(frozen=True, eq=False)
class _Covers:
    """What so many candidates cover at the most, as one limit gives way.

    Attributes:
        demanded: What a sample asks of the limit at a candidate, (n, m).
        scene: Requirements and seed.
        count: Cameras.
    """

    demanded: NDArray[np.float64]
    scene: Scene
    count: int

    def enough(self, value: float) -> bool:
        """Whether they cover the required share of what is reachable then."""
        measured = self.demanded <= value
        share = min(self.scene.requirements.coverage + _SPARE, 1.0)
        required = required_samples(np.any(measured, axis=1), share)
        return covers_enough(
            measured,
            required,
            self.count,
            n_existing=n_fixed(self.scene),
            seed=self.scene.seed,
        )


def _least_enough(relaxation: LimitRelaxation, covers: _Covers) -> float | None:
    """Return the least value, rounded, at which a cover is enough."""
    finite = covers.demanded[np.isfinite(covers.demanded)]
    values = np.unique(relaxation.rounded(finite)).tolist()
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
    samples: LitSamples,
    out: NDArray[np.bool_],
    share: Share,
) -> dict[str, int]:
    """What cameras anywhere in the shell would measure, where they may not stand."""
    workspace = scene.requirements.workspace
    whole = workspace.whole_shell
    if whole == workspace or share.wanted <= 0:
        return {}
    site = scene.site("camera", cameras[0].device)
    anywhere = camera_candidates(
        cameras[0],
        whole,
        workspace.n_reference_cameras,
        None if site is None else replace(site, workspace=whole),
    )
    pending = np.flatnonzero(out)
    for camera in anywhere:
        if not len(pending):
            break
        unmeasured = taken(samples, pending, samples.lit)
        pending = pending[~measured_by(scene, [camera], unmeasured)[:, 0]]
    return {"the whole shell as workspace": int(out.sum()) - len(pending)}
