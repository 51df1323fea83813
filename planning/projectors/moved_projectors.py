"""One projector fewer from poses anywhere in the workspace, one moved at a time.

Where the bound over all poses is below the count, either the bound is weak or free
poses need one fewer. Each pose in turn goes to the best of those around it, given what
the others cover, from less and less far, until none is better. A cover so found is
fitted to its samples, so fresh ones must confirm it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.proofs.quotas import Quotas, RegionFloors, missed_shares
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from solvers import solve_max_coverage

from .candidate_set import CandidateSet, CandidateSource
from .fewest_projectors import confirms

_Mask = NDArray[np.bool_]

# How far poses are offered around one, in spacings of a lattice of so many; from the
# first on each is so much nearer, where no pose moved, until the last.
_N_LATTICE = 600
_FARTHEST, _NEARER, _NEAREST = 2.0, 0.6, 0.04
# What is missing after moves from afar, in shares of what is required, with which
# nearer ones are given up: they have been seen to win a third of it.
_FAR, _HOPELESS = 0.5, 0.03
# By how much more than is required is looked for, so that fresh samples confirm it.
_SPARE = 0.02
# Known poses that are looked at in the place of one: those that cover most of the rest.
_KNOWN = 10
# Counted work of choosing where a search begins.
_BUDGET = 1e8
# Draws of fresh samples that no other search comes to.
_FIRST_DRAW = 30


def moved_projectors(
    source: CandidateSource, candidates: CandidateSet, n_projectors: int, starts: int
) -> tuple[PlannedProjector, ...]:
    """Return poses that, with existing ones, light what is required; () if none do.

    Args:
        source: Gives other poses.
        candidates: Those that are known.
        n_projectors: One fewer than of these are needed.
        starts: Searches; each but the first begins where the best so far ended, with
            one of its poses anywhere.
    """
    cover, known = candidates.cover, candidates.projectors
    if not starts or n_projectors <= cover.n_existing:
        return ()
    rng = np.random.default_rng([cover.seed, n_projectors])
    moves = _Moves(source, candidates, rng)
    chosen = solve_max_coverage(
        cover.problem, n_projectors, seed=cover.seed, budget=_BUDGET
    ).selected
    if len(chosen) < n_projectors:
        return ()
    best, found = moves.moved(_Poses(candidates.of(chosen), cover.covers[:, chosen]))
    for _ in range(1, starts):
        if found or moves.missed(best.covered) > _HOPELESS:
            break
        other = int(rng.integers(cover.n_existing, len(known)))
        i = int(rng.integers(cover.n_existing, n_projectors))
        kicked = best.with_pose(i, known[other], cover.covers[:, other])
        poses, found = moves.moved(kicked)
        if moves.missed(poses.covered) <= moves.missed(best.covered):
            best = poses
    return best.devices[cover.n_existing :] if found else ()


@dataclass(frozen=True, eq=False)
class _Poses:
    """Projectors, and which of the samples each lights, (n, k)."""

    devices: tuple[PlannedProjector, ...]
    covers: _Mask

    @property
    def covered(self) -> _Mask:
        return np.any(self.covers, axis=1)

    def with_pose(self, i: int, device: PlannedProjector, covers: _Mask) -> "_Poses":
        devices, columns = list(self.devices), self.covers.copy()
        devices[i], columns[:, i] = device, covers
        return _Poses(tuple(devices), columns)


@dataclass(frozen=True, eq=False)
class _Moves:
    """Moves poses one at a time.

    `rng` says in which order poses move, and how far off others are offered.
    """

    source: CandidateSource
    candidates: CandidateSet
    rng: np.random.Generator

    def moved(self, poses: _Poses) -> tuple[_Poses, bool]:
        """Return poses where none is better near by, and if fresh samples agree."""
        scale, attempt = _FARTHEST, 0
        while scale > _NEAREST:
            before = self.missed(poses.covered, _SPARE)
            for i in self.rng.permutation(len(poses.devices)):
                if i >= self.candidates.n_existing:
                    poses = self._better(poses, int(i), scale)
            missed = self.missed(poses.covered, _SPARE)
            if 0.0 < missed < before:
                continue
            scale, short = scale * _NEARER, self.missed(poses.covered)
            if short <= 0.0:
                attempt += 1
                if confirms(self.candidates, poses.devices, _FIRST_DRAW + attempt):
                    return poses, True
            elif scale < _FAR and short > _HOPELESS:
                break
        return poses, False

    def _better(self, poses: _Poses, i: int, scale: float) -> _Poses:
        """Return the poses with one of them where it leaves least to be covered.

        Around where it is, or where one of the best known poses is.
        """
        candidates, known = self.candidates, self.candidates.lit
        reach = scale * self.rng.uniform(0.5, 1.0)
        around = self.source.around((poses.devices[i],), _N_LATTICE, reach, far=True)
        if not around:
            return poses
        rest = np.any(np.delete(poses.covers, i, axis=1), axis=1)
        lacking = np.flatnonzero(~rest)
        most = np.argsort(-known[lacking].sum(axis=0), kind="stable")[:_KNOWN]
        offered = [*around, *candidates.of(most)]
        covers = np.hstack([self._lit(around, lacking), known[lacking][:, most]])
        missed = []
        for column in covers.T:
            covered = rest.copy()
            covered[lacking[column]] = True
            missed.append(self.missed(covered, _SPARE))
        best = int(np.argmin(missed))
        if missed[best] >= self.missed(poses.covered, _SPARE):
            return poses
        lit = self._lit((offered[best],), np.arange(len(rest)))[:, 0]
        return poses.with_pose(i, offered[best], lit)

    def _lit(
        self, devices: Sequence[PlannedProjector], samples: NDArray[np.int64]
    ) -> _Mask:
        """Return which of some samples (row) each projector (column) lights."""
        some = self.candidates.samples.take(samples)
        return lit_stages(self.candidates.scene, devices, some) == LIT

    def missed(self, covered: _Mask, spare: float = 0.0) -> float:
        """Return the share of what is required, and a little more, that isn't covered.

        What poses cover beside the known ones is required, too.
        """
        cover, reached = self.candidates.cover, self.candidates.reached
        regions = cover.regions or RegionFloors.none(len(covered))
        quotas = Quotas.of(regions, reached | covered, cover.share)
        quotas = replace(quotas, total=int(np.ceil((1.0 + spare) * quotas.total)))
        counts = quotas.regions.counts(covered)[:, None]
        return float(missed_shares(quotas, counts)[0])
