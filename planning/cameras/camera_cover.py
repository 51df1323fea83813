"""Section VI of the paper: the fewest cameras that measure what is lit."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.model.words import stopped_words
from planning.proofs.conflicts import Interference
from planning.proofs.device_stock import DeviceStock
from planning.proofs.quotas import Quotas, RegionFloors
from planning.proofs.selection import CandidateCover, Selection, select_fewest
from planning.scene.bodies.clearance import candidates_with_clearance
from planning.scene.draws import DRAWS
from planning.scene.limits import pair_limits
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.measuring.measured import (
    LitSamples,
    furthest_failure,
    lit_samples,
    measured_by,
)
from planning.scene.placed_bodies import existing_devices
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene
from solvers.bit_rows import pack_rows, unpack_rows

_ROUNDS = 3
# Samples of a draw that are lit: others, at most so many, join one that has fewer. A
# cover of few samples is denied by any others, and few deny nothing.
_LEAST_LIT, _MOST_JOINED = 1000, 3


class NothingMeasuredError(InfeasibleLimitsError):
    """No candidate, of these cameras, measures any of the lit samples."""

    def __init__(
        self, message: str, cameras: tuple[PlannedCamera, ...], samples: LitSamples
    ) -> None:
        super().__init__(message)
        self.cameras, self.samples = cameras, samples


@dataclass(frozen=True, eq=False)
class CameraCover:
    """Cameras chosen for projectors as they are.

    Attributes:
        candidates: The reference set, and what it sees; existing cameras first.
        samples: Lit samples that the cover was solved on.
        measured: Which candidate measures which sample, shape (n, m).
        selection: Candidates taken, and what was proved of their number.
        interference: The candidates among each other's bodies, where they have any.
        by_count: Candidates for each number of them, where the paper's route passed
            them; None: the best there are.
        stopped: Why the paper's route has no camera fewer.
    """

    candidates: CandidateViews
    samples: LitSamples
    measured: NDArray[np.bool_]
    selection: Selection
    interference: Interference | None = None
    by_count: Mapping[int, NDArray[np.int64]] | None = None
    stopped: str = ""

    @property
    def cameras(self) -> tuple[PlannedCamera, ...]:
        """The cameras taken."""
        return self.among_candidates(self.selection.chosen)

    @property
    def has_bodies(self) -> bool:
        """Whether the body of any candidate may be in the way of another."""
        return self.interference is not None and self.interference.bodied

    def among_candidates(self, chosen: NDArray[np.int64]) -> tuple[PlannedCamera, ...]:
        """Return candidates by their index."""
        return tuple(self.candidates.cameras[i] for i in chosen)


def camera_candidate_views(
    scene: Scene, templates: tuple[PlannedCamera, ...], n_candidates: int
) -> CandidateViews:
    """Return the candidates, existing cameras first: they are in every cover.

    So many of each model.
    """
    offer = scene.candidates(templates)
    every = n_candidates * len(templates)
    free = candidates_with_clearance(scene, every, offer.over)
    standing = existing_devices(scene.requirements, templates)
    return CandidateViews(scene, standing + free)


def plan_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    candidates: CandidateViews,
    known: NDArray[np.int64] | None = None,
) -> CameraCover:
    """Choose the fewest cameras that measure the required share of what is lit.

    `known` candidates may do with fewer than the search finds.

    Raises:
        NothingMeasuredError: If no candidate measures any lit sample.
    """

    def choose(samples: LitSamples, measured: NDArray[np.bool_]) -> CameraCover:
        selection = select_fewest(
            candidate_cover(scene, measured, samples, candidates.cameras), known=known
        )
        return CameraCover(candidates, samples, measured, selection)

    return confirmed_cover(scene, projectors, candidates, choose)


def confirmed_cover(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    candidates: CandidateViews,
    choose: Callable[[LitSamples, NDArray[np.bool_]], CameraCover],
) -> CameraCover:
    """Choose cameras until fresh samples confirm that they measure enough.

    Samples that don't confirm it join those that the next choice is made on.

    Raises:
        NothingMeasuredError: If no candidate measures any lit sample.
    """
    target, stream = first_samples(scene, projectors)
    samples, measured = measured_samples(scene, projectors, candidates, target)
    for _ in range(1, _ROUNDS):
        cover = choose(samples, measured)
        if cover.selection.status == "infeasible":
            return cover
        fresh, stream = fresh_samples(scene, projectors, stream)
        chosen = cover.selection.chosen
        seen = denial(scene, projectors, cover.candidates, chosen, fresh)
        if seen is None:
            return cover
        target = merged(target, fresh)
        samples = lit_samples(scene, projectors, target)
        measured = np.concatenate([measured, seen[:, : len(candidates.cameras)]])
    return choose(samples, measured)


def first_samples(
    scene: Scene, projectors: Sequence[PlannedProjector]
) -> tuple[Target, int]:
    """Return what cameras are first chosen on, and the next stream of fresh draws."""
    return _enough_lit(scene, projectors, scene.target_samples(DRAWS.cameras), 1)


def fresh_samples(
    scene: Scene, projectors: Sequence[PlannedProjector], stream: int
) -> tuple[Target, int]:
    """Return fresh samples from a stream on, and the next stream."""
    fresh = scene.target_samples(DRAWS.fresh_cameras.later(stream))
    return _enough_lit(scene, projectors, fresh, stream + 1)


def _enough_lit(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    target: Target,
    stream: int,
) -> tuple[Target, int]:
    """Join fresh draws to samples until enough are lit; and the next stream."""
    for _ in range(_MOST_JOINED):
        if len(lit_samples(scene, projectors, target).target) >= _LEAST_LIT:
            break
        more = scene.target_samples(DRAWS.fresh_cameras.later(stream))
        target, stream = merged(target, more), stream + 1
    return target, stream


def denial(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    candidates: CandidateViews,
    chosen: NDArray[np.int64],
    fresh: Target,
) -> NDArray[np.bool_] | None:
    """Return which candidate measures which of fresh samples that are lit, (n, m).

    None where the chosen ones measure enough of them. No more is reached than is lit,
    so most often no candidate has to be looked at.
    """
    cameras = tuple(candidates.cameras[i] for i in chosen)
    views = CandidateViews(scene, cameras)
    lit, own = measured_of(scene, projectors, views, fresh)
    covered = np.any(own, axis=1)
    floors = RegionFloors.of(scene, lit.target, "camera")

    def enough(reached: NDArray[np.bool_]) -> bool:
        return Quotas.of(floors, reached, scene.requirements.coverage).enough(covered)

    if enough(np.ones(len(covered), dtype=bool)):
        return None
    # What they measure is reached: candidates are asked for the rest alone.
    missed = np.flatnonzero(~covered)
    rest = measured_of(scene, projectors, candidates, lit.target.take(missed))[1]
    reached = covered.copy()
    reached[missed] = np.any(rest, axis=1)
    if enough(reached):
        return None
    return measured_of(scene, projectors, candidates, fresh)[1]


def measured_samples(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    candidates: CandidateViews,
    target: Target | None = None,
) -> tuple[LitSamples, NDArray[np.bool_]]:
    """Return the samples that are lit, and which candidate measures which.

    Raises:
        NothingMeasuredError: If no candidate measures any; it names the limits that
            stop most samples.
    """
    target = target or first_samples(scene, projectors)[0]
    samples, measured = measured_of(scene, projectors, candidates, target)
    if not measured.any():
        message = _nothing_measured(scene, candidates.cameras, samples)
        raise NothingMeasuredError(message, candidates.cameras, samples)
    return samples, measured


def measured_of(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    candidates: CandidateViews,
    target: Target,
) -> tuple[LitSamples, NDArray[np.bool_]]:
    """Return which of some samples are lit, and which candidate measures which."""
    samples, cameras = lit_samples(scene, projectors, target), candidates.cameras

    def answer() -> NDArray[np.uint64]:
        views = candidates.on(samples.target)
        return pack_rows(measured_by(scene, cameras, samples, views))

    limits = scene.requirements.triangulation
    inputs = candidates, samples, limits
    rows = scene.cache.recall("measured_by", inputs, answer)
    return samples, unpack_rows(rows, len(cameras))


def candidate_cover(
    scene: Scene,
    measured: NDArray[np.bool_],
    samples: LitSamples,
    cameras: Sequence[PlannedCamera],
) -> CandidateCover:
    """Return what candidates measure, with what is required of cameras.

    Its `quotas.enough(covered)` says whether the samples measured, a mask of shape
    (n,), are enough: the share of the target, and the floor of every large region.
    """
    required = scene.requirements
    return CandidateCover(
        measured,
        required.coverage,
        seed=scene.seed,
        max_count=required.max_cameras,
        n_existing=n_fixed(scene),
        regions=RegionFloors.of(scene, samples.target, "camera"),
        stock=DeviceStock.of(cameras, required.stock_of("camera")),
    )


def n_fixed(scene: Scene) -> int:
    """Return how many existing cameras there are."""
    return len(scene.requirements.existing_of("camera"))


def _nothing_measured(
    scene: Scene, candidates: Sequence[PlannedCamera], samples: LitSamples
) -> str:
    causes = furthest_failure(scene, candidates, samples)
    if len(causes) == 0:
        return (
            "the projectors that were chosen light none of the target's fresh samples, "
            "so no camera measures any; the object may be too small for this rig"
        )
    counts = np.bincount(causes, minlength=pair_limits.MEASURED)
    weight = samples.target.samples.weight
    named = stopped_words(counts.tolist(), pair_limits.CAUSES, weight)
    return (
        f"no camera of {len(candidates)} poses measures any lit sample; the limit that "
        f"stops each sample where it comes furthest is {named}"
    )
