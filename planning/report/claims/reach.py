"""What poses reach of samples, pose after pose on what is still missing."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, islice

import numpy as np
from numpy.typing import NDArray

from geometry.rays.rays import equal_parts
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene import lighting
from planning.scene.limits.projector_limits import INCIDENCE, LIT
from planning.scene.measuring.measured import LitSamples, measured_by, taken
from planning.scene.samples import Target
from planning.scene.scene import Scene

# Dark samples that a thread takes on together.
_TOGETHER = 4000
# Cameras that are asked together for what all before them missed.
_MOST_AT_ONCE = 64


def furthest_lit(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    """Return how far samples come over all projectors: index in `CAUSES`, or `LIT`."""
    limits = scene.requirements.projector
    return scene.cache.recall(
        "furthest_lit",
        (scene.mesh, scene.bodies, limits, projectors, target),
        lambda: _furthest_lit(scene, projectors, target),
    )


def _furthest_lit(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    furthest, limits = np.zeros(len(target), np.int8), scene.requirements.projector

    def search(part: slice) -> None:
        for projector in projectors:
            scene.check_cancelled()
            pending = part.start + np.flatnonzero(furthest[part] < LIT)
            if not len(pending):
                break
            dark = target.take(pending)
            # What shows its back comes no further than it did before.
            idle = furthest[pending] >= INCIDENCE
            idle &= lighting.shows_back(projector, dark)
            pending, dark = pending[~idle], dark.take(~idle)
            stage = lighting.first_failure(
                projector, dark, limits, scene.occlusion, bodies=scene.bodies
            )
            furthest[pending] = np.maximum(furthest[pending], stage)

    # Each sample is looked at by itself: no result depends on the parts.
    scene.occlusion.share(search, equal_parts(len(target), _TOGETHER))
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
    """Yield stations with cameras there, ever more at once: the first leave little."""
    for station, group in groupby(cameras, key=lambda camera: camera.station):
        size = 1
        while few := tuple(islice(group, size)):
            yield station, few
            size = min(2 * size, _MOST_AT_ONCE)
