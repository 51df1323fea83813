"""Rings for cameras that leave what pairs must measure after a loss."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs.losses import PairDemand
from planning.proofs.quotas import RegionFloors
from planning.scene.draws import DRAWS
from planning.scene.measuring.measured import LitSamples, lit_samples, measuring_pairs
from planning.scene.scene import Scene

from .ring_stage import RingStage, Spacing, space_rings

# Of what pairs must measure after a loss, kept to spare for fresh samples.
_MORE = 1.01


def rings_for_pairs(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    spacing: Spacing,
    proved: LitSamples,
    *,
    margin: float,
) -> RingStage:
    """Return the projectors with the rings of `space_rings`, or else even ones.

    These where finer gaps would lose pairs that a loss may leave alone.
    """
    stage = space_rings(scene, projectors, cameras, spacing, proved, margin=margin)
    if rings_uphold(scene, projectors, stage.projectors, cameras):
        return stage
    even = space_rings(scene, projectors, cameras, "uniform", proved, margin=margin)
    records = tuple(
        record if record.spacing == "kept" else record.changed(kept_even=True)
        for record in even.records
    )
    return replace(even, records=records)


def rings_uphold(
    scene: Scene,
    before: Sequence[PlannedProjector],
    after: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
) -> bool:
    """Return whether other rings of the same projectors leave each loss its share.

    A finer gap measures nothing more, but pairs to spare may be lost by it.
    """
    asked = scene.requirements.survival
    if asked is None:
        return True
    target = scene.target_samples(DRAWS.surviving_rings)
    samples = lit_samples(scene, before, target)
    renewed = samples
    for p, projector in enumerate(after):
        renewed = renewed.with_code(p, projector)
    lit = samples.lit
    left = [np.any(np.delete(lit, p, axis=1), axis=1) for p in range(lit.shape[1])]
    reached = np.stack([lit.any(axis=1), *(left if asked.survive else [])], axis=1)
    regions = RegionFloors.of(scene, samples.target, "camera")
    share = scene.requirements.coverage
    demand = PairDemand.of(asked, regions, reached, _MORE * share, spare=1.0)
    kept = demand.kept(measuring_pairs(scene, cameras, samples))
    return demand.upheld(kept, measuring_pairs(scene, cameras, renewed))
