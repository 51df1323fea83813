"""Which candidates each point of a front takes, from the matrix alone."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import candidate_cover
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.ring_records import AxisTaken
from planning.model.progress import Stopwatch
from planning.model.words import count_words
from planning.projectors.exposures import with_exposures
from planning.proofs.selection import CandidateCover
from planning.report.partial_plan import Prepared
from planning.rings.axis_moves import move_ring_axes
from planning.rings.centred_axes import centred_axes
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import LitSamples, measured_by, taken

from .best_counts import MOST, BestCount, best_counts, with_more
from .front_matrix import FrontMatrix

# Counted work of each count of projectors and of what cameras see, whose bounds every
# point is told beside; of cameras for given projectors.
_BOUND_BUDGET, _CAMERA_BUDGET = 1e9, 2e8


@dataclass(frozen=True, eq=False)
class Choice:
    """Devices of a point, and the candidates that they are.

    Attributes:
        most: Samples of the matrix that no cameras of this number exceed with these
            projectors; None: these cameras weren't chosen so.
    """

    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]
    lights: tuple[int, ...]
    views: tuple[int, ...]
    axes: AxisTaken | None
    covered: int
    most: int | None


@dataclass(frozen=True, eq=False)
class _Lit:
    """Projectors with their ring axes, and which candidate measures which sample."""

    projectors: tuple[PlannedProjector, ...]
    axes: AxisTaken | None
    samples: LitSamples
    cover: CandidateCover


class Chooser:
    """Chooses the devices of every number of either kind."""

    def __init__(self, ready: Prepared, matrix: FrontMatrix) -> None:
        self.ready, self.matrix = ready, matrix

    @cached_property
    def lit(self) -> dict[int, BestCount]:
        """The projectors of each number that light most."""
        wishes = self.ready.request.wishes
        most = wishes.max_projectors or None
        return best_counts(self._lit_cover, most, _BOUND_BUDGET)

    def seen(self, most: int) -> dict[int, BestCount]:
        """The cameras of each number that see most of what any projector lights.

        Whatever they measure, with whatever projectors, is less than the bound.
        """
        matrix = self.matrix
        seen = matrix.seen & matrix.candidates.reached[:, None]
        return best_counts(self._cameras_cover(seen), most, _BOUND_BUDGET)

    def choices(self, clock: Stopwatch) -> dict[tuple[int, int], Choice]:
        """Return the best found of each number, projectors first and cameras for them.

        As many cameras as wished, or as measure all that the most projectors light.
        """
        found: dict[tuple[int, int], Choice] = {}
        most = self.ready.request.wishes.max_cameras
        for count in sorted(self.lit, reverse=True):
            of_count = self._of(self.lit[count].chosen, most)
            most = most or max(of_count, default=None)
            found |= {(count, n): choice for n, choice in of_count.items()}
            clock.say(f"  {count_words(count, 'projector')}: cameras chosen")
        return found

    def with_projector(self, choice: Choice) -> Choice:
        """Return the same devices and a projector, which lights most that is dark."""
        cover, before = self._lit_cover, np.array(choice.lights, dtype=np.int64)
        after = with_more(cover, before, len(before) + 1)
        more = np.setdiff1d(after, before)
        added = with_exposures(self.matrix.scene, self.matrix.candidates.of(more))
        if choice.axes == "centred":
            scene = self.matrix.scene
            added = centred_axes(scene, added, self.ready.request.ring_margin)
        return replace(
            choice,
            projectors=(*choice.projectors, *added),
            lights=(*choice.lights, *more.tolist()),
            most=None,
        )

    def with_camera(self, choice: Choice) -> Choice:
        """Return the same devices and a camera, which measures most that none does."""
        lit = self._measured(choice.projectors, choice.axes)
        before = np.array(choice.views, dtype=np.int64)
        more = np.setdiff1d(with_more(lit.cover, before, len(before) + 1), before)
        cameras = tuple(self.matrix.cameras[i] for i in more)
        return replace(
            choice,
            cameras=(*choice.cameras, *cameras),
            views=(*choice.views, *more.tolist()),
            most=None,
        )

    @cached_property
    def _lit_cover(self) -> CandidateCover:
        return replace(self.matrix.candidates.cover, max_count=None)

    def _of(self, chosen: NDArray[np.int64], most: int | None) -> dict[int, Choice]:
        """The cameras of each number for projectors, whatever axes let measure most."""
        found: dict[int, Choice] = {}
        exposed = with_exposures(self.matrix.scene, self.matrix.candidates.of(chosen))
        for lit in self._with_axes(exposed, most):
            if not lit.cover.covers.any():
                continue
            counts = best_counts(lit.cover, most, _CAMERA_BUDGET)
            for n, best in counts.items():
                if n in found and best.covered <= found[n].covered:
                    continue
                found[n] = Choice(
                    lit.projectors,
                    tuple(self.matrix.cameras[i] for i in best.chosen),
                    tuple(chosen.tolist()),
                    tuple(best.chosen.tolist()),
                    lit.axes,
                    best.covered,
                    best.bound,
                )
            most = most or max(counts)
        return found

    def _with_axes(
        self, projectors: tuple[PlannedProjector, ...], most: int | None
    ) -> Iterator[_Lit]:
        """Projectors with ring axes as asked, what candidates measure of each."""
        request, scene = self.ready.request, self.matrix.scene
        asked = request.ring_axis
        if asked is None:
            yield self._measured(projectors, None)
            return
        if asked in ("centred", "auto"):
            middle = centred_axes(scene, projectors, request.ring_margin)
            yield self._measured(middle, "centred")
        if asked in ("free", "auto"):
            yield self._freed(self._measured(projectors, "free"), most)

    def _freed(self, lit: _Lit, most: int | None) -> _Lit:
        """The same with axes moved for as many cameras as measure enough."""
        if not lit.cover.covers.any():
            return lit
        cameras = self.enough_cameras(lit.cover, most)
        bright = np.flatnonzero(lit.samples.lit.any(axis=1))
        moved = move_ring_axes(
            self.matrix.scene,
            lit.projectors,
            cameras,
            taken(lit.samples, bright, lit.samples.lit),
        )
        return self._measured(moved, "free")

    def enough_cameras(
        self, cover: CandidateCover, most: int | None
    ) -> tuple[PlannedCamera, ...]:
        """Return the fewest candidates found that measure the share asked for."""
        chosen = np.arange(cover.n_existing)
        for count in range(max(1, cover.n_existing), (most or MOST) + 1):
            chosen = with_more(cover, chosen, count)
            if cover.enough(chosen):
                break
        return tuple(self.matrix.cameras[i] for i in chosen)

    def _measured(
        self, projectors: Sequence[PlannedProjector], axes: AxisTaken | None
    ) -> _Lit:
        matrix = self.matrix
        lit = lit_stages(matrix.scene, projectors, matrix.target) == LIT
        samples = LitSamples.of(projectors, matrix.target, lit)
        measured = measured_by(
            matrix.scene, matrix.cameras, samples, matrix.views.on(matrix.target)
        )
        cover = self._cameras_cover(measured)
        return _Lit(tuple(projectors), axes, samples, cover)

    def _cameras_cover(self, covers: NDArray[np.bool_]) -> CandidateCover:
        matrix = self.matrix
        lit = np.zeros((len(matrix.target), 0), dtype=bool)
        samples = LitSamples.of((), matrix.target, lit)
        cover = candidate_cover(matrix.scene, covers, samples, matrix.cameras)
        return replace(cover, max_count=None)
