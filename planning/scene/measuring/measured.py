"""Which cameras measure which of the samples that projectors light.

A sample is measured K-fold by devices if at least K different pairs among them measure
it. With M the pairs that measure it, the loss of any one device leaves K iff::

    min over devices d of |{(p, c) in M : p != d and c != d}| >= K

For K = 1 that is two pairs that share no device: M is a bipartite graph, and no single
node meets all its edges iff it has a matching of two (Koenig 1931).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import rows_of
from planning.model.devices.planned import PlannedCamera, PlannedProjector, meet
from planning.model.requirements import TriangulationLimits
from planning.scene.codes.patterns import panel_light, pattern_of
from planning.scene.codes.surfaces import Coded
from planning.scene.lighting import light_on, lit_stages
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.limits.pair_limits import MEASURED
from planning.scene.limits.pair_quality import PairQuality
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import LightOnSamples, Target
from planning.scene.scene import Scene

from .camera_views import CameraView, camera_views, view_of
from .measurability import first_pair_failure, pair_quality

# Seen by several cameras and worked on together: many calls on few samples are slow,
# and much more leaves the cache.
_PAIRS = 8192


@dataclass(frozen=True, eq=False)
class LitSamples:
    """Samples with light and code of every projector of the plan on them.

    At least one projector lights each; `lit` says which, shape (n, n_projectors).
    `stations` are where the projectors stand.
    """

    target: Target
    lit: NDArray[np.bool_]
    lights: tuple[LightOnSamples, ...]
    surfaces: tuple[Coded, ...]
    stations: tuple[str, ...]

    @classmethod
    def of(
        cls,
        projectors: Sequence[PlannedProjector],
        target: Target,
        lit: NDArray[np.bool_],
    ) -> "LitSamples":
        """Return samples, lit as stated."""
        points = target.samples.points
        return cls(
            target,
            lit,
            tuple(light_on(projector, target) for projector in projectors),
            tuple(pattern_of(projector).surfaces(points) for projector in projectors),
            tuple(projector.station for projector in projectors),
        )

    def with_code(self, p: int, projector: PlannedProjector) -> "LitSamples":
        """Return the samples with the surfaces of equal code of projector p anew."""
        surfaces = pattern_of(projector).surfaces(self.target.samples.points)
        others = self.surfaces[:p], self.surfaces[p + 1 :]
        return replace(self, surfaces=(*others[0], surfaces, *others[1]))


def lit_samples(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> LitSamples:
    """Return the samples that the projectors light, with their light and rings."""
    lit = lit_stages(scene, projectors, target) == LIT
    chosen = np.flatnonzero(lit.any(axis=1))
    return LitSamples.of(projectors, target.take(chosen), lit[chosen])


def widest_pixel(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> float:
    """Return the largest pixel of a panel on samples that are lit, in [m].

    ``p(z) / (-N.L)``; where nothing is lit, p(z) over all samples stands in.
    """
    lit = lit_stages(scene, projectors, target) == LIT
    widest = 0.0
    for p, projector in enumerate(projectors):
        some = target.take(lit[:, p]) if lit.any() else target
        _, pixel_m, _ = panel_light(projector, some.samples.points)
        squarely = light_on(projector, some).incidence_cos if lit.any() else 1.0
        widest = max(widest, float(np.max(pixel_m / squarely, initial=0.0)))
    return widest


def taken(
    samples: LitSamples, chosen: NDArray[np.int64], lit: NDArray[np.bool_]
) -> LitSamples:
    """Return some of the samples, lit as stated for all."""
    return LitSamples(
        samples.target.take(chosen),
        rows_of(lit, chosen),
        tuple(light.take(chosen) for light in samples.lights),
        tuple(surfaces.take(chosen) for surfaces in samples.surfaces),
        samples.stations,
    )


@dataclass(frozen=True, eq=False)
class Pair:
    """A projector, by its index, and a camera, on samples that one lights and one sees.

    `places` are where they stand in the camera's view, `samples` which of the lit
    samples they are; the first violated limit is an index in `CAUSES`, or `MEASURED`.
    """

    projector: int
    places: NDArray[np.int64]
    samples: NDArray[np.int64]
    quality: PairQuality
    first_violated: NDArray[np.int8]

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Whether no limit fails, shape (k,)."""
        return self.first_violated == MEASURED


def pairs_of(
    limits: TriangulationLimits,
    lit: LitSamples,
    view: ViewedSamples,
    *,
    samples: NDArray[np.int64] | None = None,
    wanted: NDArray[np.bool_] | None = None,
    projectors: Sequence[int] | None = None,
) -> Iterator[Pair]:
    """Yield a camera's pair with each projector that it meets, on samples it sees.

    Args:
        limits: Of pairs.
        lit: Lit samples.
        view: How the camera sees them.
        samples: Which of the lit samples are in view; None: all.
        wanted: Which places of the view to look at; it is read anew for each projector
            and may change in between. None: those that are seen.
        projectors: Their indices; None: all.
    """
    if samples is None:
        samples = np.arange(len(lit.target))
    if wanted is None:
        wanted = view.seen
    for p in range(len(lit.lights)) if projectors is None else projectors:
        if not meet(lit.stations[p], view.station):
            continue
        places = np.flatnonzero(lit.lit[samples, p] & wanted)
        chosen = samples[places]
        quality = pair_quality(
            rows_of(lit.target.samples.normals, chosen),
            lit.lights[p].take(chosen),
            lit.surfaces[p].take(chosen),
            view.take(places),
            limits,
        )
        yield Pair(p, places, chosen, quality, first_pair_failure(quality, limits))


def least_sigma(
    limits: TriangulationLimits,
    samples: LitSamples,
    views: Sequence[ViewedSamples],
    p: int,
) -> NDArray[np.float64]:
    """Return the least s_N of projector p over cameras in [m], (n,); inf for none."""
    least = np.full(len(samples.target), np.inf)
    for seen in views:
        for pair in pairs_of(limits, samples, seen, projectors=[p]):
            good = pair.samples[pair.measured]
            sigma = pair.quality.sigma[pair.measured]
            least[good] = np.minimum(least[good], sigma)
    return least


def measured_by(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    lit: LitSamples,
    views: Sequence[CameraView] | None = None,
) -> NDArray[np.bool_]:
    """Return which camera measures which sample with any projector, (n, n_cameras).

    `views` are those of the cameras on the lit samples, where they are at hand.
    """
    if views is None:
        views = camera_views(scene, cameras, lit.target)
    limits = scene.requirements.triangulation
    measured = np.zeros((len(lit.target), len(cameras)), dtype=bool)
    ends = np.cumsum([len(view.samples) for view in views])
    stations = np.unique([camera.station for camera in cameras], return_inverse=True)[1]
    begins = np.diff(ends // _PAIRS, prepend=-1) != 0
    starts = np.flatnonzero(begins | (np.diff(stations, prepend=-1) != 0))
    for first, last in pairwise([*starts.tolist(), len(views)]):
        scene.check_cancelled()
        column = np.repeat(
            np.arange(first, last), [len(s.samples) for s in views[first:last]]
        )
        seen = CameraView.joined(views[first:last])
        open_places = np.ones(len(seen.samples), dtype=bool)
        for pair in pairs_of(
            limits, lit, seen.view, samples=seen.samples, wanted=open_places
        ):
            open_places[pair.places[pair.measured]] = False
        measured[seen.samples, column] = ~open_places
    return measured


def furthest_failure(
    scene: Scene, cameras: Sequence[PlannedCamera], lit: LitSamples
) -> NDArray[np.int8]:
    """Return how far samples come over all pairs: index in `CAUSES`, or `MEASURED`."""
    furthest = np.zeros(len(lit.target), dtype=np.int8)
    for camera in cameras:
        seen = view_of(scene, camera, lit.target)
        with_it = [meet(station, camera.station) for station in lit.stations]
        first = np.where(lit.lit[:, with_it].any(axis=1), seen.first_violated, 0)
        furthest = np.maximum(furthest, first.astype(np.int8))
        for pair in pairs_of(scene.requirements.triangulation, lit, seen):
            chosen = pair.samples
            furthest[chosen] = np.maximum(furthest[chosen], pair.first_violated)
    return furthest


def measuring_pairs(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    lit: LitSamples,
    views: Sequence[CameraView] | None = None,
) -> NDArray[np.bool_]:
    """Return which pair measures which lit sample, shape (n, n_cameras, n_projectors).

    `views` are those of the cameras on the lit samples, where they are at hand.
    """
    if views is None:
        views = camera_views(scene, cameras, lit.target)
    limits = scene.requirements.triangulation
    pairs = np.zeros((len(lit.target), len(cameras), len(lit.lights)), dtype=bool)
    for c, seen in enumerate(views):
        scene.check_cancelled()
        for pair in pairs_of(limits, lit, seen.view, samples=seen.samples):
            pairs[pair.samples[pair.measured], c, pair.projector] = True
    return pairs


def pair_counts(
    pairs: NDArray[np.bool_], without: int | None = None
) -> NDArray[np.uint8]:
    """Return with how many projectors each camera measures each sample, (n, n_cameras).

    `without` is a projector that is lost.
    """
    counts = pairs.sum(axis=2, dtype=np.uint8)
    return counts if without is None else counts - pairs[:, :, without]


def measured_fold(pairs: NDArray[np.bool_], views: int) -> NDArray[np.bool_]:
    """Return which samples at least so many pairs measure, shape (n,)."""
    return np.asarray(pairs.sum(axis=(1, 2)) >= views)


def without_projector(pairs: NDArray[np.bool_], p: int) -> NDArray[np.bool_]:
    """Return the pairs left without a projector."""
    return np.delete(pairs, p, axis=2)


def without_camera(pairs: NDArray[np.bool_], c: int) -> NDArray[np.bool_]:
    """Return the pairs that are left without a camera."""
    return np.delete(pairs, c, axis=1)


def reachable_fold(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    samples: LitSamples,
    pairs: NDArray[np.bool_],
    views: int,
    *,
    survive: bool,
) -> NDArray[np.bool_]:
    """Return what reference cameras could measure K-fold, shape (n, 1 + n_projectors).

    Of lit samples with the pairs (n, k, n_projectors) that measure them already: with
    all projectors, then without each of them if one may be lost. One reference camera
    after the other is asked for what is still missing.
    """
    n_projectors = pairs.shape[2]
    found = pairs.sum(axis=1, dtype=np.int64)
    lost = np.zeros((1 + n_projectors, n_projectors), dtype=bool)
    lost[1:] = np.eye(n_projectors, dtype=bool)
    lost = lost if survive else lost[:1]

    def reached() -> NDArray[np.bool_]:
        return found @ ~lost.T >= views

    # What no pair can add to isn't asked for: unlit without a projector.
    able = samples.lit @ ~lost.T > 0
    for camera in cameras:
        pending = np.flatnonzero(np.any(able & ~reached(), axis=1))
        if not len(pending):
            break
        others = taken(samples, pending, samples.lit)
        found[pending] += measuring_pairs(scene, [camera], others)[:, 0]
    return np.asarray(reached())
