"""Which cameras measure which of the samples that projectors light."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedCamera, PlannedProjector

from . import lighting, measurability
from .camera_views import CameraView, camera_views, joined_view, view_of
from .lighting import LightOnSamples
from .lit import lit_stages
from .measurability import Rings
from .samples import Target
from .scene import Scene

# Seen by several cameras and worked on together: many calls on few rows are slow, and
# much more leaves the cache.
_PAIRS = 8192


@dataclass(frozen=True, eq=False)
class LitSamples:
    """Samples with the light of every projector of the plan on them.

    Attributes:
        target: The samples that at least one projector lights.
        lit: Which projector lights which, shape (n, n_projectors).
        lights: Light of each projector.
        rings: Ring surfaces of each projector.
    """

    target: Target
    lit: NDArray[np.bool_]
    lights: tuple[LightOnSamples, ...]
    rings: tuple[Rings, ...]


def lit_samples(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> LitSamples:
    """Return the samples that the projectors light, with their light and rings."""
    lit = lit_stages(scene, projectors, target) == lighting.LIT
    some = np.flatnonzero(lit.any(axis=1))
    kept = target.take(some)
    return LitSamples(
        kept,
        lit[some],
        tuple(lighting.light_on(projector, kept) for projector in projectors),
        rings_of(projectors, kept),
    )


def rings_of(
    projectors: Sequence[PlannedProjector], target: Target
) -> tuple[Rings, ...]:
    """Return the ring surfaces of every projector at samples."""
    points = target.samples.points
    return tuple(measurability.rings_at(projector, points) for projector in projectors)


def measured_by(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    rows: LitSamples,
    sights: Sequence[CameraView] | None = None,
) -> NDArray[np.bool_]:
    """Return which camera measures which sample with any projector, (n, n_cameras).

    Args:
        scene: Surface and requirements.
        cameras: As they stand.
        rows: Lit samples.
        sights: Of these cameras on these samples, where they are at hand.
    """
    if sights is None:
        sights = camera_views(scene, cameras, rows.target)
    measured = np.zeros((len(rows.target), len(cameras)), dtype=bool)
    for first, last in _chunks(sights):
        scene.check_cancelled()
        column = np.repeat(
            np.arange(first, last), [len(s.rows) for s in sights[first:last]]
        )
        seen = joined_view(sights[first:last])
        measured[seen.rows, column] = _measured(scene, seen, rows)
    return measured


def _chunks(sights: Sequence[CameraView]) -> Iterator[tuple[int, int]]:
    """Ranges of cameras that together see about `_PAIRS` samples, or of one."""
    ends = np.cumsum([len(sight.rows) for sight in sights])
    first = 0
    while first < len(sights):
        before = ends[first - 1] if first else 0
        last = int(np.searchsorted(ends, before + _PAIRS, side="right"))
        last = max(last, first + 1)
        yield first, last
        first = last


def _measured(scene: Scene, sight: CameraView, rows: LitSamples) -> NDArray[np.bool_]:
    """Return which of the samples that are seen, by whatever cameras, are measured."""
    limits = scene.requirements.triangulation
    normals = rows.target.samples.normals
    measured = np.zeros(len(sight.rows), dtype=bool)
    for p, (light, rings) in enumerate(zip(rows.lights, rows.rings, strict=True)):
        pairs = np.flatnonzero(rows.lit[sight.rows, p] & ~measured)
        own = sight.rows[pairs]
        quality = measurability.pair_quality(
            normals[own],
            light.take(own),
            rings.take(own),
            sight.view.take(pairs),
            limits,
        )
        stage = measurability.first_pair_failure(quality, limits)
        measured[pairs[stage == measurability.MEASURED]] = True
    return measured


def furthest_failure(
    scene: Scene, cameras: Sequence[PlannedCamera], rows: LitSamples
) -> NDArray[np.int8]:
    """Return how far each sample comes over all pairs: an index in `CAUSES`.

    It is `MEASURED` where some pair measures the sample.
    """
    furthest = np.zeros(len(rows.target), dtype=np.int8)
    required = scene.requirements
    for camera in cameras:
        scene.check_cancelled()
        seen = view_of(scene, camera, rows.target)
        furthest = np.maximum(furthest, seen.stage)
        clear = np.flatnonzero(seen.stage == measurability.SEEN)
        for p, (light, rings) in enumerate(zip(rows.lights, rows.rings, strict=True)):
            pairs = clear[rows.lit[clear, p]]
            quality = measurability.pair_quality(
                rows.target.samples.normals[pairs],
                light.take(pairs),
                rings.take(pairs),
                seen.take(pairs),
                required.triangulation,
            )
            stage = measurability.first_pair_failure(quality, required.triangulation)
            furthest[pairs] = np.maximum(furthest[pairs], stage)
    return furthest


def taken(
    rows: LitSamples, chosen: NDArray[np.int64], lit: NDArray[np.bool_]
) -> LitSamples:
    """Return some of the samples, lit as stated for all."""
    return LitSamples(
        rows.target.take(chosen),
        lit[chosen],
        tuple(light.take(chosen) for light in rows.lights),
        tuple(rings.take(chosen) for rings in rows.rings),
    )
