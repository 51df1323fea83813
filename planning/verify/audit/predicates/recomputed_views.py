"""What cameras alone measure of samples, and what reference cameras could."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from geometry.arrays import Array, Ints, Mask
from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import AuditSamples

from .audit_devices import audit_cameras
from .occlusion import Shadow
from .predicates import LIT, MEASURED, SEEN, Steps, sight_steps
from .recompute import Reachable, Recomputed
from .reference_devices import reference_cameras
from .view_pairs import GOOD, Sighted, pair_passes

_UNSEEN = -1


@dataclass(frozen=True, eq=False)
class RecomputedViews(Recomputed):
    """Cameras alone against one set of samples, of which all count as lit.

    Attributes:
        sight: Limits of *seen* passed, for each camera, shape (n_c, n).
        met: Limits of pairs passed by cameras i and j, -1 where one of them doesn't see
            the sample, symmetric, shape (n_c, n_c, n).
        views: Cameras that must see a sample.
    """

    sight: Steps = field(kw_only=True)
    met: Steps = field(kw_only=True)
    views: int = field(kw_only=True)

    @cached_property
    def lit(self) -> Mask:
        """All samples, shape (n,): texture and light are assumed."""
        return np.ones(len(self.samples), dtype=bool)

    @cached_property
    def measured_by(self) -> Mask:
        """Whether each camera is of a pair that measures a sample, (n_c, n)."""
        return np.any(self.met == GOOD, axis=1) & self._enough

    @cached_property
    def _enough(self) -> Mask:
        return (self.sight == SEEN).sum(axis=0) >= self.views

    @property
    def by_pair(self) -> Array:
        """Share of the samples that each two cameras measure, shape (n_c, n_c)."""
        return np.mean(self.met == GOOD, axis=2)

    def measured_with(self, cameras: list[int]) -> Mask:
        """Return what some of the cameras measure without the others, shape (n,)."""
        if not cameras:
            return np.zeros(len(self.samples), dtype=bool)
        seen = (self.sight[cameras] == SEEN).sum(axis=0)
        pairs = self.met[np.ix_(cameras, cameras)] == GOOD
        return np.any(pairs, axis=(0, 1)) & (seen >= self.views)

    @property
    def steps_of_cameras(self) -> Steps:
        """Limits of *seen* that each camera passes, shape (n_c, n)."""
        return self.sight

    @cached_property
    def cause(self) -> Ints:
        """Index into LIGHT, SIGHT, PAIR and VIEW_CAUSES, one after the other, (n,).

        -1 where measured. That of the camera that came furthest where none sees it,
        then too few of them, then that of the pair that came furthest.
        """
        sight = self.sight.max(axis=0, initial=0).astype(np.int64)
        pair = self.met.max(axis=(0, 1), initial=_UNSEEN).astype(np.int64)
        first = LIT + MEASURED
        furthest = np.where(self._enough, first + 1 + pair, first)
        furthest = np.where(sight == SEEN, furthest, LIT + sight)
        return np.where(self.measured, -1, furthest)


def recompute_views(
    plan: RigPlan, samples: AuditSamples, shadow: Shadow
) -> RecomputedViews:
    """Recompute what each camera sees, and each two of them measure."""
    required, cameras = plan.requirements, audit_cameras(plan)
    n_c, n = len(cameras), len(samples)
    sight = np.array(
        [sight_steps(c, samples, required.camera, shadow) for c in cameras],
        dtype=np.int8,
    ).reshape(n_c, n)
    met = np.full((n_c, n_c, n), _UNSEEN, dtype=np.int8)
    for i in range(n_c):
        for j in range(i):
            both = np.flatnonzero((sight[i] == SEEN) & (sight[j] == SEEN))
            some = samples.take(both)
            met[i, j, both] = met[j, i, both] = pair_passes(
                Sighted.of(cameras[i], some),
                Sighted.of(cameras[j], some),
                some.normals,
                required.triangulation,
            )
    none = np.zeros((0, n_c, n), dtype=np.int8)
    return RecomputedViews(
        samples,
        np.zeros((0, n), dtype=np.int8),
        np.zeros((0, n)),
        none,
        sight=sight,
        met=met,
        views=required.min_views or 2,
    )


def reachable_by_views(
    plan: RigPlan, actual: RecomputedViews, shadow: Shadow, seed: int
) -> Reachable:
    """Recompute which samples reference cameras measure, beside what the plan does.

    Cameras come in a random order. Each is held, on what isn't reached yet and it sees,
    against all that came before.
    """
    required, cameras = plan.requirements, reference_cameras(plan)
    reached = actual.measured.copy()
    waiting = np.flatnonzero(~reached)
    samples = actual.samples.take(waiting)
    seen = np.zeros(len(waiting), dtype=np.int64)
    paired = np.zeros(len(waiting), dtype=bool)
    done = np.zeros(len(waiting), dtype=bool)
    before: list[tuple[Ints, Sighted]] = []
    for index in np.random.default_rng(seed).permutation(len(cameras)):
        open_ones = np.flatnonzero(~done)
        if not len(open_ones):
            break
        some = samples.take(open_ones)
        steps = sight_steps(cameras[index], some, required.camera, shadow)
        rows = open_ones[steps == SEEN]
        view = Sighted.of(cameras[index], samples.take(rows))
        for others, earlier in before:
            place, there = _common(rows, others, ~paired)
            if len(place):
                passes = pair_passes(
                    view.take(place),
                    earlier.take(there),
                    samples.normals[rows[place]],
                    required.triangulation,
                )
                paired[rows[place[passes == GOOD]]] = True
        seen[rows] += 1
        done = paired & (seen >= actual.views)
        before.append((rows, view))
    reached[waiting[done]] = True
    n = len(reached)
    return Reachable(
        np.ones(n, dtype=bool),
        reached,
        np.full(n, LIT, dtype=np.int8),
        np.zeros(n, dtype=np.int8),
    )


def _common(rows: Ints, others: Ints, wanted: Mask) -> tuple[Ints, Ints]:
    """Return the places in two ascending lists of what is wanted and in both."""
    _, place, there = np.intersect1d(
        rows, others, assume_unique=True, return_indices=True
    )
    kept = wanted[rows[place]]
    return place[kept], there[kept]
