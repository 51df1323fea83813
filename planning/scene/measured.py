"""Which cameras measure which of the samples that projectors light."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import TriangulationLimits
from planning.scene.limits.camera_limits import SEEN, ViewedSamples
from planning.scene.limits.pair_limits import MEASURED, PairQuality
from planning.scene.limits.projector_limits import LIT
from planning.scene.patterns.code_surfaces import CodeSurfaces
from planning.scene.patterns.pattern import code_surfaces

from .camera_views import CameraView, camera_views, joined_view, view_of
from .lighting import lit_stages
from .lights import LightOnSamples, light_on
from .measurability import first_pair_failure, pair_quality
from .samples import Target
from .scene import Scene

# Seen by several cameras and worked on together: many calls on few samples are slow,
# and much more leaves the cache.
_PAIRS = 8192


@dataclass(frozen=True, eq=False)
class LitSamples:
    """Samples with the light of every projector of the plan on them.

    Attributes:
        target: The samples that at least one projector lights.
        lit: Which projector lights which, shape (n, n_projectors).
        lights: Light of each projector.
        rings: Surfaces of equal code of each projector.
    """

    target: Target
    lit: NDArray[np.bool_]
    lights: tuple[LightOnSamples, ...]
    rings: tuple[CodeSurfaces, ...]

    @classmethod
    def of(
        cls,
        projectors: Sequence[PlannedProjector],
        target: Target,
        lit: NDArray[np.bool_],
    ) -> "LitSamples":
        """Return samples, lit as stated, with light and code of every projector."""
        points = target.samples.points
        return cls(
            target,
            lit,
            tuple(light_on(projector, target) for projector in projectors),
            tuple(code_surfaces(projector, points) for projector in projectors),
        )

    def with_surfaces(self, p: int, surfaces: CodeSurfaces) -> "LitSamples":
        """Return the samples with other surfaces of equal code of one projector."""
        return replace(self, rings=(*self.rings[:p], surfaces, *self.rings[p + 1 :]))


def lit_samples(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> LitSamples:
    """Return the samples that the projectors light, with their light and rings."""
    lit = lit_stages(scene, projectors, target) == LIT
    chosen = np.flatnonzero(lit.any(axis=1))
    return LitSamples.of(projectors, target.take(chosen), lit[chosen])


def taken(
    rows: LitSamples, chosen: NDArray[np.int64], lit: NDArray[np.bool_]
) -> LitSamples:
    """Return some of the samples, lit as stated for all."""
    return LitSamples(
        rows.target.take(chosen),
        lit[chosen],
        tuple(light.take(chosen) for light in rows.lights),
        tuple(surfaces.take(chosen) for surfaces in rows.rings),
    )


@dataclass(frozen=True, eq=False)
class Pair:
    """A projector and a camera, on samples that one lights and the other sees.

    Attributes:
        projector: Its index.
        places: Where the samples stand in the camera's view, shape (k,).
        samples: Which of the lit samples they are, shape (k,).
        quality: How well they are triangulated.
        stage: Index in `CAUSES` of the first limit that fails, or `MEASURED`, (k,).
    """

    projector: int
    places: NDArray[np.int64]
    samples: NDArray[np.int64]
    quality: PairQuality
    stage: NDArray[np.int8]

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Whether no limit fails, shape (k,)."""
        return self.stage == MEASURED


def pairs_of(
    limits: TriangulationLimits,
    rows: LitSamples,
    view: ViewedSamples,
    *,
    samples: NDArray[np.int64] | None = None,
    wanted: NDArray[np.bool_] | None = None,
    projectors: Sequence[int] | None = None,
) -> Iterator[Pair]:
    """Yield a camera's pair with each projector, on the samples that it sees.

    Args:
        limits: Of pairs.
        rows: Lit samples.
        view: How the camera sees them, or `samples` of them.
        samples: Which of the lit samples are in view; None: all.
        wanted: Which places of the view to look at; it is read anew for each projector
            and may change in between. None: those that are seen.
        projectors: Their indices; None: all.
    """
    if samples is None:
        samples = np.arange(len(rows.target))
    if wanted is None:
        wanted = view.stage == SEEN
    for p in range(len(rows.lights)) if projectors is None else projectors:
        places = np.flatnonzero(rows.lit[samples, p] & wanted)
        chosen = samples[places]
        quality = pair_quality(
            rows.target.samples.normals[chosen],
            rows.lights[p].take(chosen),
            rows.rings[p].take(chosen),
            view.take(places),
            limits,
        )
        yield Pair(p, places, chosen, quality, first_pair_failure(quality, limits))


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
    limits = scene.requirements.triangulation
    measured = np.zeros((len(rows.target), len(cameras)), dtype=bool)
    for first, last in _chunks(sights):
        scene.check_cancelled()
        column = np.repeat(
            np.arange(first, last), [len(s.rows) for s in sights[first:last]]
        )
        seen = joined_view(sights[first:last])
        open_places = np.ones(len(seen.rows), dtype=bool)
        for pair in pairs_of(
            limits, rows, seen.view, samples=seen.rows, wanted=open_places
        ):
            open_places[pair.places[pair.measured]] = False
        measured[seen.rows, column] = ~open_places
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


def furthest_failure(
    scene: Scene, cameras: Sequence[PlannedCamera], rows: LitSamples
) -> NDArray[np.int8]:
    """Return how far each sample comes over all pairs: an index in `CAUSES`.

    It is `MEASURED` where some pair measures the sample.
    """
    furthest = np.zeros(len(rows.target), dtype=np.int8)
    for camera in cameras:
        scene.check_cancelled()
        seen = view_of(scene, camera, rows.target)
        furthest = np.maximum(furthest, seen.stage)
        for pair in pairs_of(scene.requirements.triangulation, rows, seen):
            chosen = pair.samples
            furthest[chosen] = np.maximum(furthest[chosen], pair.stage)
    return furthest
