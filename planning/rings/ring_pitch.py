"""How fine rings may be before a camera can't separate them where it measures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.poses import inverse
from planning.model.devices.planned import PlannedProjector
from planning.scene.codes.patterns import RingPattern
from planning.scene.lighting import assigned_projectors, lit_margins
from planning.scene.lights import light_of
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.measuring.measured import LitSamples, lit_samples, pairs_of
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .ring_radii import MIN_PROJECTOR_PX

# Rings are planned this much wider than they must be: samples are but samples.
_ROOM = 1.08


def best_pitch(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    views: Sequence[ViewedSamples],
    samples: LitSamples,
) -> NDArray[np.float64]:
    """Return each projector's largest pitch [px] of cameras that measure a sample.

    0 where none does, shape (n, n_projectors). The light of the samples is used; their
    rings are computed anew.
    """
    for p, projector in enumerate(projectors):
        samples = samples.with_code(p, projector)
    best = np.zeros((len(samples.target), len(projectors)))
    for seen in views:
        for pair in pairs_of(scene.requirements.triangulation, samples, seen):
            pitch = np.where(pair.measured, pair.quality.pitch, 0.0)
            table = best[:, pair.projector]
            table[pair.samples] = np.maximum(table[pair.samples], pitch)
    return best


def users(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    samples: LitSamples,
    pitch: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Return the projector that each sample is measured by, -1 for none, shape (n,).

    The one that it is assigned to, if a camera measures it with that, else the one
    whose rings lie widest in some camera's image.
    """
    margins = lit_margins(scene, projectors, samples.target)
    assigned = assigned_projectors(samples.lit, margins)
    measured = pitch[np.arange(len(assigned)), assigned] > 0
    best = np.where(measured, assigned, np.argmax(pitch, axis=1))
    return np.where(pitch.max(axis=1) > 0, best, -1)


def least_gaps(
    coordinates: NDArray[np.float64],
    pitch: NDArray[np.float64],
    gap: float,
    min_pitch: float,
    edges: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the least gap of rings in each cell that leaves every sample its pitch.

    The pitch is proportional to the gap: h_min = h min_pitch / pitch.

    Args:
        coordinates: Ring coordinates of samples, shape (n,).
        pitch: Pitch of each at an even gap in [px], shape (n,).
        gap: That gap.
        min_pitch: Least pitch [px].
        edges: Borders of equal cells of the ring coordinate, shape (n_cells + 1,).

    Returns:
        0 where a cell holds no sample, shape (n_cells,).
    """
    least = np.zeros(len(edges) - 1)
    cells = cells_at(edges, coordinates)
    np.maximum.at(least, cells, _ROOM * gap * min_pitch / pitch)
    return least


def cells_at(
    edges: NDArray[np.float64], coordinates: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return the cell that holds each ring coordinate, shape (n,)."""
    return np.clip(np.searchsorted(edges, coordinates) - 1, 0, len(edges) - 2)


def projector_gaps(
    projector: PlannedProjector, coordinates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the ring gap that is 3 projector pixels wide or more all round, (n,)."""
    frame = inverse(projector.world_from_device) @ projector.world_from_ring
    light = light_of(projector.device)
    return light.drawn_gaps(frame, coordinates, _ROOM * MIN_PROJECTOR_PX)


def widest_gap(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> float:
    """Return the largest ring spacing h on samples that are lit, in [m].

    It is the distance tau within which a check must find a point. Where nothing is
    lit, the spacing over all samples stands in.
    """
    samples = lit_samples(scene, projectors, target)
    gaps = [
        ring.on_average().spacing[samples.lit[:, p]]
        for p, ring in enumerate(samples.surfaces)
    ]
    if not len(samples.target):
        gaps = [
            RingPattern(p).surfaces(target.samples.points).spacing for p in projectors
        ]
    return float(max(gap.max(initial=0.0) for gap in gaps))
