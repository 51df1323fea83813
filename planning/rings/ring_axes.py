"""Turn the ring axes so that no blind curve (r.m = 0) crosses the target."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.ring_frame import ring_frame
from planning.scene.camera_views import view_of
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.measured import LitSamples, lit_samples, pairs_of
from planning.scene.patterns.code_surfaces import CodeSurfaces
from planning.scene.patterns.pattern import code_surfaces
from planning.scene.patterns.ring_pattern import inside_rings
from planning.scene.samples import Target
from planning.scene.scene import Scene

_AZIMUTHS = 16
_SWEEPS = 2


def turn_ring_axes(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    rows: LitSamples,
    tilt: float,
) -> tuple[PlannedProjector, ...]:
    """Return the projectors with the ring axes under which the cameras measure most.

    Each projector in turn tries a number of azimuths of its tilted (or shifted) axis;
    among equals the one with the largest mean |r.m| of each sample's best pair wins.
    An axis that leaves a lit sample outside the last ring isn't offered, so what is
    lit stays lit.

    Args:
        scene: Surface and requirements.
        projectors: As planned.
        cameras: As planned.
        rows: Lit samples.
        tilt: Tilt of the axes, or their shift, as `ring_frame` takes it.
    """
    views = [view_of(scene, c, rows.target) for c in cameras]
    turned = list(projectors)
    scores = np.stack(
        [_scores(scene, rows, p, views, rings) for p, rings in enumerate(rows.rings)]
    )
    points = rows.target.samples.points
    for _ in range(_SWEEPS):
        before = list(turned)
        for p in range(len(turned)):
            best = _value(scores)
            for azimuth in np.arange(_AZIMUTHS) * (2.0 * np.pi / _AZIMUTHS):
                offered = _with_axis(turned[p], tilt, float(azimuth))
                if not inside_rings(offered, points[rows.lit[:, p]]):
                    continue
                trial = scores.copy()
                rings = code_surfaces(offered, points)
                trial[p] = _scores(scene, rows, p, views, rings)
                value = _value(trial)
                if value > best:
                    best, scores, turned[p] = value, trial, offered
        if all(a is b for a, b in zip(before, turned, strict=True)):
            break
    return tuple(turned)


def widest_gap(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> float:
    """Return the largest ring spacing h on samples that are lit, in [m].

    It is the distance tau within which a check must find a point. Where nothing is
    lit, the spacing over all samples stands in.
    """
    rows = lit_samples(scene, projectors, target)
    if not len(rows.target):
        rings = [code_surfaces(p, target.samples.points) for p in projectors]
        return float(max(ring.spacing.max() for ring in rings))
    return float(
        max(
            ring.spacing[rows.lit[:, p]].max(initial=0.0)
            for p, ring in enumerate(rows.rings)
        )
    )


def _with_axis(
    projector: PlannedProjector, tilt: float, azimuth: float
) -> PlannedProjector:
    frame = ring_frame(projector.world_from_device, projector.device, tilt, azimuth)
    return replace(projector, world_from_ring=frame)


def _scores(
    scene: Scene,
    rows: LitSamples,
    p: int,
    views: Sequence[ViewedSamples],
    rings: CodeSurfaces,
) -> NDArray[np.float64]:
    """Best |r.m| of projector p at each sample over the cameras; 0 if not measured."""
    limits, score = scene.requirements.triangulation, np.zeros(len(rows.target))
    offered = rows.with_surfaces(p, rings)
    for seen in views:
        for pair in pairs_of(limits, offered, seen, projectors=[p]):
            good = pair.samples[pair.measured]
            found = pair.quality.conditioning[pair.measured]
            score[good] = np.maximum(score[good], found)
    return score


def _value(scores: NDArray[np.float64]) -> tuple[int, float]:
    best = scores.max(axis=0)
    return int(np.count_nonzero(best)), round(float(best.mean()), 9)
