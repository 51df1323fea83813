"""What a plan may claim of each loss, recomputed from its poses on fresh samples.

A device that is lost gives no light or sees nothing; its housing stays where it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.calibration_errors import Survival
from planning.model.document.survival_records import (
    LossRecord,
    SurvivalRecord,
    SurvivingCountRecord,
)
from planning.model.requirements import Requirements
from planning.proofs.surviving_counts import SurvivingCount
from planning.report.claims.claims import Claims
from planning.report.claims.judged import Devices
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import (
    LitSamples,
    measured_fold,
    measuring_pairs,
    reachable_fold,
    without_camera,
    without_projector,
)
from planning.scene.scene import Scene

_Mask = NDArray[np.bool_]
# Equal up to rounding is enough.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class _Left:
    """What a loss leaves of samples, (n,) each."""

    lost: str | None
    lit: _Mask
    measured: _Mask
    by_cameras: _Mask


def survival_record(
    scene: Scene,
    devices: Devices,
    claims: Claims,
    counts: tuple[SurvivingCount, SurvivingCount] | None,
) -> SurvivalRecord | None:
    """Return the plan's `survival`; None where none is asked for."""
    asked = scene.requirements.survival
    if asked is None:
        return None
    numbers: dict[str, SurvivingCountRecord] = {}
    for kind, count in zip(("projectors", "cameras"), counts or (), strict=False):
        n = len(getattr(devices, kind))
        numbers[kind] = SurvivingCountRecord(
            count=n,
            needed=max(count.needed, n) if count.met else count.needed,
            without=count.without,
            lower_bound=count.lower_bound,
            everywhere=count.everywhere,
        )
    losses = _losses(scene, devices, claims, asked)
    return SurvivalRecord(
        samples=len(claims.target_samples),
        losses=tuple(_record(left, scene, claims) for left in losses),
        **numbers,
    )


def _losses(
    scene: Scene, devices: Devices, claims: Claims, asked: Survival
) -> Iterator[_Left]:
    """Yield what is left with all devices there, then without each."""
    target, views = claims.region_samples.target, asked.views
    planned = scene.among((*devices.projectors, *devices.cameras))
    lit = lit_stages(planned, devices.projectors, target) == LIT
    bright = np.flatnonzero(lit.any(axis=1))
    samples = LitSamples.of(devices.projectors, target.take(bright), lit[bright])
    pairs = measuring_pairs(planned, devices.cameras, samples)
    reached = reachable_fold(
        scene.among(devices.projectors),
        devices.reference_cameras,
        samples,
        pairs,
        views,
        survive=bool(asked.survive),
    )

    def everywhere(mask: _Mask) -> _Mask:
        whole = np.zeros(len(target), dtype=bool)
        whole[bright] = mask
        return whole

    any_lit, able = lit.any(axis=1), everywhere(reached[:, 0])
    yield _Left(None, any_lit, everywhere(measured_fold(pairs, views)), able)
    if not asked.survive:
        return
    for p, projector in enumerate(devices.projectors):
        measured = measured_fold(without_projector(pairs, p), views)
        left = np.any(np.delete(lit, p, axis=1), axis=1)
        reach = everywhere(reached[:, 1 + p])
        yield _Left(projector.id, left, everywhere(measured), reach)
    for c, camera in enumerate(devices.cameras):
        measured = measured_fold(without_camera(pairs, c), views)
        yield _Left(camera.id, any_lit, everywhere(measured), able)


def _record(left: _Left, scene: Scene, claims: Claims) -> LossRecord:
    n, weight = len(claims.target_samples), claims.target_samples.samples.weight
    lit, measured, by_cameras = (
        float(weight * mask[:n].sum())
        for mask in (left.lit, left.measured, left.by_cameras)
    )
    return LossRecord(
        lost=left.lost,
        lit_m2=lit,
        reachable_by_projectors_m2=claims.coverage.target.reachable_by_projectors_m2,
        measured_m2=measured,
        reachable_by_cameras_m2=by_cameras,
        floors_missed=tuple(_floors_missed(left, scene, claims)),
    )


def _floors_missed(left: _Left, scene: Scene, claims: Claims) -> Iterator[int]:
    """Yield the large regions of which too little is lit, or measured."""
    floor, samples = scene.requirements.region_coverage, claims.region_samples
    for index in scene.large_regions.tolist() if floor else ():
        inside = samples.region == index
        for done, whole in (
            (left.lit, samples.by_projectors),
            (left.measured, left.by_cameras),
        ):
            n = int((whole & inside).sum())
            if int((done & inside).sum()) < floor * n * (1.0 - _SLACK):
                yield index
                break


def falls_short_after(loss: LossRecord, required: Requirements) -> tuple[bool, bool]:
    """Return whether too little is lit, and too little measured, after a loss.

    Regions below their floor count as too little measured.
    """
    least = 1.0 - _SLACK
    dark = loss.lit_m2 < (
        required.dominant_coverage * loss.reachable_by_projectors_m2 * least
    )
    short = (
        loss.measured_m2 < required.coverage * loss.reachable_by_cameras_m2 * least
        or loss.reachable_by_cameras_m2 < required.min_reachable * loss.lit_m2 * least
        or bool(loss.floors_missed)
        or not loss.measured_m2 > 0.0
    )
    return dark, short
