"""What poses reach of samples, pose after pose on what is still missing."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, islice
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene import lighting
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import LitSamples, measured_by, taken
from planning.scene.samples import Target
from planning.scene.scene import Scene

# Devices that are asked together for what all before them missed.
_MOST_AT_ONCE = 64
_Device = TypeVar("_Device")


def furthest_lit(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    """Return how far samples come over all projectors: index in `CAUSES`, or `LIT`."""
    limits = scene.requirements.projector
    return scene.in_run.recall(
        "furthest_lit",
        (scene.mesh, scene.bodies, limits, projectors, target),
        lambda: _furthest_lit(scene, projectors, target),
    )


def _furthest_lit(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    furthest = np.zeros(len(target), np.int8)
    for few in _ever_more(projectors):
        scene.check_cancelled()
        pending = np.flatnonzero(furthest < LIT)
        if not len(pending):
            break
        stages = lighting.lit_stages(scene, few, target.take(pending))
        furthest[pending] = np.maximum(furthest[pending], stages.max(axis=1))
    return furthest


def measured_by_any(
    scene: Scene,
    cameras: Iterable[PlannedCamera],
    samples: LitSamples,
    lights: Sequence[PlannedProjector] = (),
) -> NDArray[np.bool_]:
    """Return which lit samples any of the cameras measures, shape (n,).

    Those at a station measure with the lights there, the others with what the samples
    are lit by.
    """
    measured = np.zeros(len(samples.target), dtype=bool)
    for station, few in _batches(cameras):
        pending = np.flatnonzero(~measured)
        if not len(pending):
            break
        if station:
            here = [p for p in lights if p.station == station]
            target = samples.target.take(pending)
            lit = lighting.lit_stages(scene, here, target) == LIT
            bright = np.flatnonzero(lit.any(axis=1))
            pending = pending[bright]
            others = LitSamples.of(here, target.take(bright), lit[bright])
        else:
            others = taken(samples, pending, samples.lit)
        measured[pending] = measured_by(scene, few, others).any(axis=1)
    return measured


def _batches(
    cameras: Iterable[PlannedCamera],
) -> Iterator[tuple[str, Sequence[PlannedCamera]]]:
    """Yield stations with some of the cameras there."""
    for station, group in groupby(cameras, key=lambda camera: camera.station):
        for few in _ever_more(group):
            yield station, few


def _ever_more(devices: Iterable[_Device]) -> Iterator[Sequence[_Device]]:
    """Yield ever more devices at once: the first leave little."""
    left, size = iter(devices), 1
    while few := tuple(islice(left, size)):
        yield few
        size = min(2 * size, _MOST_AT_ONCE)
