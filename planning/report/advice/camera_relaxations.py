"""Which single limit of the cameras, relaxed by how little, would make a plan pass.

Where too little of what is lit can be measured from anywhere, the reference poses say
what each sample asks of each limit; sorted, these say how far the limit must give way
for the required share. Where too few cameras are allowed, the same table says which
candidates measure what as the limit gives way, and bisection over covers finds the
least that is enough. Light, rings and ring axes stay as they are planned.
"""

from collections.abc import Sequence

import numpy as np

from planning.cameras.camera_cover import NothingMeasuredError, n_fixed
from planning.cameras.proved_cameras import CameraStage
from planning.model.devices.planned import PlannedCamera
from planning.model.document.coverage_records import Relaxation
from planning.model.words import percent
from planning.proofs.quotas import required_samples
from planning.report.claims.claims import Claims
from planning.report.claims.judged import Devices
from planning.report.claims.reach import measured_by_any
from planning.rig.rig import Rig
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.limits.limit import LimitRelaxation, Mask
from planning.scene.limits.pair_limits import CAUSES, MEASURED
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import LitSamples, lit_samples, taken
from planning.scene.scene import Scene
from planning.scene.workspace.model_candidates import one_of_each

from .demands import Demands, demands
from .least_changes import (
    SPARE,
    Share,
    enough,
    larger_workspaces,
    least_changes,
    least_enough,
    relaxations_of_cameras,
)


def out_of_reach(
    scene: Scene, rig: Rig, devices: Devices, claims: Claims
) -> tuple[dict[str, float], tuple[Relaxation, ...]]:
    """Say why cameras reach too little of what is lit, and what would help.

    Returns:
        The area by the limit at which samples come furthest [m²]; and relaxations with
        their share of what is lit, least gain first.
    """
    among, required = scene.among(devices.projectors), scene.requirements
    samples, n_lit = _missed(scene, devices, claims)
    relaxations = relaxations_of_cameras(rig, required)
    asked = least_demands(among, devices.reference_cameras, samples, relaxations)
    out = asked.furthest < MEASURED
    share = Share(n_lit, n_lit - int(out.sum()), required.min_reachable)
    changes = least_changes(relaxations, asked.demanded[:, out], share.wanted)
    unmeasured = taken(samples, np.flatnonzero(out), samples.lit)
    for moved, rest in among.less_one_obstacle():
        gained = measured_by_any(rest, devices.reference_cameras, unmeasured)
        changes[f"{moved} out of the way"] = int(gained.sum())
    mount = required.workspace.camera_mount
    stepped = mount is not None and mount.is_stepped
    larger = larger_workspaces(required.workspace, "camera")
    for change, whole in larger if share.wanted > 0 or stepped else ():
        models = one_of_each(devices.reference_cameras)
        there = scene.candidates(models, whole)
        anywhere = there.over(required.workspace.n_reference_cameras)
        changes[change] = int(measured_by_any(among, anywhere, unmeasured).sum())
    return _by_cause(claims, asked), share.gains(changes)


def unmeasurable_by_cause(
    scene: Scene, devices: Devices, claims: Claims
) -> dict[str, float]:
    """Return the lit area that cameras don't reach, as `out_of_reach` does."""
    samples, _ = _missed(scene, devices, claims)
    among = scene.among(devices.projectors)
    asked = least_demands(among, devices.reference_cameras, samples, ())
    return _by_cause(claims, asked)


def _missed(scene: Scene, devices: Devices, claims: Claims) -> tuple[LitSamples, int]:
    """Return the lit samples that no camera of the plan measures; how many are lit."""
    target = claims.target_samples
    planned = scene.among((*devices.projectors, *devices.cameras))
    lit = np.any(lit_stages(planned, devices.projectors, target) == LIT, axis=1)
    missed = target.take(lit & ~claims.measured_by.any(axis=1))
    return lit_samples(planned, devices.projectors, missed), int(lit.sum())


def _by_cause(claims: Claims, asked: Demands) -> dict[str, float]:
    """Return the area of what isn't measured, by how far samples come [m²]."""
    out = asked.furthest < MEASURED
    counts = np.bincount(asked.furthest[out], minlength=MEASURED)
    weight = claims.target_samples.samples.weight
    return {
        cause: float(weight * count)
        for cause, count in zip(CAUSES, counts, strict=True)
        if count
    }


def nothing_measured(scene: Scene, rig: Rig, error: NothingMeasuredError) -> str:
    """Say the least that makes a part of what is lit measurable."""
    samples = error.samples
    if not len(samples.target):
        return "no limit of a camera helps"
    relaxations = relaxations_of_cameras(rig, scene.requirements)
    asked = least_demands(scene, error.cameras, samples, relaxations)
    share = Share(len(samples.target), 0, scene.requirements.min_reachable)
    steps = [
        f"{step.change} would make {percent(step.reachable_share)} of what is lit "
        f"measurable"
        for step in share.gains(
            least_changes(relaxations, asked.demanded, share.wanted)
        )
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
    """Return each single change with which so many cameras would be enough."""
    lit = stage.cover.samples
    samples = taken(lit, np.arange(min(len(lit.target), DRAWS.fewer_devices)), lit.lit)
    relaxations = relaxations_of_cameras(rig, scene.requirements)
    demanded = np.stack(
        [demands(scene, c, samples, relaxations).demanded for c in stage.reference],
        axis=2,
    )
    share = min(scene.requirements.coverage + SPARE, 1.0)

    def suffices(covered: Mask) -> bool:
        required = required_samples(np.any(covered, axis=1), share)
        return enough(covered, required, count, n_fixed(scene), scene.seed)

    least = (
        least_enough(relaxation, table, suffices)
        for relaxation, table in zip(relaxations, demanded, strict=True)
    )
    return tuple(change for change in least if change is not None)


def least_demands(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    samples: LitSamples,
    relaxations: Sequence[LimitRelaxation],
) -> Demands:
    """Return the least that samples ask of each limit, and how far they come."""
    n = len(samples.target)
    furthest = np.zeros(n, dtype=np.int8)
    demanded = np.full((len(relaxations), n), np.inf)
    for camera in cameras:
        pending = np.flatnonzero(furthest < MEASURED)
        if not len(pending):
            break
        others = taken(samples, pending, samples.lit)
        asked = demands(scene, camera, others, relaxations)
        demanded[:, pending] = np.minimum(demanded[:, pending], asked.demanded)
        furthest[pending] = np.maximum(furthest[pending], asked.furthest)
    return Demands(furthest, demanded)
