"""Which single limit, relaxed by how little, would let a plan's devices meet a floor.

Devices stay where the plan has them. Of the samples of the region that they leave dark
or unmeasured, each asks a value of a limit; sorted, these say how far it must give way.
"""

from dataclasses import replace
from functools import reduce

import numpy as np

from planning.model.document.coverage_records import RegionRecord
from planning.model.words import count_words
from planning.projectors.candidate_set import CandidateSet
from planning.proofs.selection import fewest_of
from planning.report.claims.judged import Devices
from planning.report.claims.region_claims import RegionSamples
from planning.rig.rig import Rig
from planning.scene.measuring.measured import lit_samples
from solvers.status import SolveStatus

from .camera_relaxations import least_demands
from .demands import light_demands
from .least_changes import (
    least_changes,
    relaxations_of_cameras,
    relaxations_of_projectors,
)

# Shares are told in parts of so much, rounded down.
_SHARES = 10_000
# Counted work for how many projectors a floor takes: it is advice.
_ADVICE = 3e8


def with_floor_relaxations(
    regions: tuple[RegionRecord, ...],
    samples: RegionSamples,
    rig: Rig,
    devices: Devices,
) -> tuple[RegionRecord, ...]:
    """Return regions with what would let those that miss their floor meet it.

    Where too little is lit, limits of the projectors; else of the cameras and pairs.
    Changes that alone aren't enough aren't told.
    """
    return tuple(
        region.changed(
            coverage=areas.changed(
                relaxations=_enough(samples, region.id, rig, devices)
            )
        )
        if (areas := region.coverage) is not None and areas.floor == "missed"
        else region
        for region in regions
    )


def with_small_floor(
    regions: tuple[RegionRecord, ...], candidates: CandidateSet
) -> tuple[RegionRecord, ...]:
    """Return regions with what a floor costs of the largest too small for one.

    Of those of which less is lit than of a large region must be: so many projectors of
    the candidates.
    """
    scene = candidates.scene
    floor, areas = scene.requirements.region_coverage, scene.mesh.face_areas
    dark = [
        region
        for region in regions
        if (lit := region.coverage) is not None
        and lit.floor is None
        and lit.lit_m2 < floor * lit.reachable_by_projectors_m2
    ]
    if not dark:
        return regions
    largest = max(dark, key=lambda region: region.area_m2)
    share = float(largest.area_m2 / areas[scene.target_faces].sum())
    share = np.floor(_SHARES * share) / _SHARES
    required = replace(scene.requirements, region_share=share)
    asked = replace(candidates, scene=replace(scene, requirements=required))
    few = fewest_of(asked.cover, _ADVICE)
    most = "" if few.status is SolveStatus.OPTIMAL else "at most "
    told = (
        f"[requirements] region_share = {share:g} gives it a floor and takes {most}"
        f"{count_words(len(few.selected), 'projector')} of the candidates",
    )
    return tuple(
        region.changed(coverage=region.coverage.changed(relaxations=told))
        if region is largest and region.coverage is not None
        else region
        for region in regions
    )


def _enough(
    samples: RegionSamples, index: int, rig: Rig, devices: Devices
) -> tuple[str, ...]:
    scene, inside = samples.scene, samples.region == index
    required = scene.requirements
    scene = scene.among((*devices.projectors, *devices.cameras))

    def wanted(covered: np.ndarray, reached: np.ndarray) -> int:
        least = required.region_coverage * int(reached[inside].sum())
        return int(np.ceil(least - 1e-9)) - int(covered[inside].sum())

    if (lack := wanted(samples.lit, samples.by_projectors)) > 0:
        dark = samples.target.take(inside & ~samples.lit)
        relaxations = relaxations_of_projectors(required, devices.projectors)
        asked = reduce(
            np.minimum,
            (light_demands(scene, p, dark, relaxations) for p in devices.projectors),
        )
    else:
        lack = wanted(samples.measured, samples.by_cameras)
        lit = samples.target.take(inside & samples.lit & ~samples.measured)
        relaxations = relaxations_of_cameras(rig, required)
        light = lit_samples(scene, devices.projectors, lit)
        asked = least_demands(scene, devices.cameras, light, relaxations).demanded
    gained = least_changes(relaxations, asked, lack)
    return tuple(change for change, gain in gained.items() if gain >= lack)
