"""One projector fewer from poses anywhere in the workspace, one moved at a time.

Where the bound over all poses is below the count, either the bound is weak or free
poses need one fewer. `one_fewer` chooses among poses offered around all of them at
once; here each pose in turn goes to the best of those around it, given what the others
light, from less and less far, until none is better. A cover so found is fitted to its
samples, so fresh ones must confirm it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.proofs.quotas import Quotas
from planning.proofs.selection import cover_problem
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from solvers import solve_max_coverage

from .candidate_set import CandidateSet, CandidateSource
from .fewest_projectors import confirms
from .one_fewer import missed_shares

# How far poses are offered around one, in spacings of a lattice of so many; from the
# first on each is so much nearer, where no pose moved, until the last.
_N_LATTICE = 600
_FARTHEST, _NEARER, _NEAREST = 2.0, 0.6, 0.04
# What is missing after moves from afar, in shares of what is required, with which
# nearer ones are given up: they have been seen to win a third of it.
_FAR, _HOPELESS = 0.5, 0.03
# By how much more than is required is looked for, so that fresh samples confirm it.
_SPARE = 0.02
# Known poses that are looked at in the place of one: those that light most of the rest.
_KNOWN = 10
# Counted work of choosing where a search begins.
_BUDGET = 1e8
# Draws of fresh samples that no other search for projectors comes to.
_FIRST_DRAW = 30


def free_poses(
    source: CandidateSource, candidates: CandidateSet, n_projectors: int, starts: int
) -> tuple[PlannedProjector, ...]:
    """Return poses that, with existing ones, light what is required; () if none do.

    Args:
        source: Gives poses around others.
        candidates: Known poses: what is required is a share of what they light.
        n_projectors: One fewer than of these are needed.
        starts: Searches; each but the first begins where the best so far ended, with
            one of its poses anywhere.
    """
    if not starts or n_projectors <= candidates.n_existing:
        return ()
    scene = candidates.scene
    rng = np.random.default_rng([scene.seed, n_projectors])
    moves = _Moves(source, candidates, rng)
    problem = cover_problem(
        candidates.lit, candidates.cover.quotas, candidates.n_existing, candidates.stock
    )
    chosen = solve_max_coverage(
        problem, n_projectors, seed=scene.seed, budget=_BUDGET
    ).selected
    if len(chosen) < n_projectors:
        return ()
    best, found = moves.moved(candidates.take(chosen))
    for _ in range(1, starts):
        if found or moves.missed(best.reached) > _HOPELESS:
            break
        other = int(rng.integers(candidates.n_existing, len(candidates.projectors)))
        i = int(rng.integers(candidates.n_existing, n_projectors))
        kicked = best.with_pose(i, candidates.take(np.array([other])))
        poses, found = moves.moved(kicked)
        if moves.missed(poses.reached) <= moves.missed(best.reached):
            best = poses
    return best.projectors[best.n_existing :] if found else ()


@dataclass(frozen=True, eq=False)
class _Moves:
    """Moves poses one at a time.

    Attributes:
        source: Gives poses around others.
        candidates: Known poses, and the samples.
        rng: Says in which order poses move, and how far off others are offered.
    """

    source: CandidateSource
    candidates: CandidateSet
    rng: np.random.Generator

    def moved(self, poses: CandidateSet) -> tuple[CandidateSet, bool]:
        """Return poses where none is better near by, and if fresh samples agree."""
        scale, attempt = _FARTHEST, 0
        while scale > _NEAREST:
            before = self.missed(poses.reached, _SPARE)
            for i in self.rng.permutation(len(poses.projectors)):
                if i >= poses.n_existing:
                    poses = self._better(poses, int(i), scale)
            missed = self.missed(poses.reached, _SPARE)
            if 0.0 < missed < before:
                continue
            scale, short = scale * _NEARER, self.missed(poses.reached)
            if short <= 0.0:
                attempt += 1
                draw = _FIRST_DRAW + attempt
                if confirms(self.candidates, poses.projectors, draw):
                    return poses, True
            elif scale < _FAR and short > _HOPELESS:
                break
        return poses, False

    def _better(self, poses: CandidateSet, i: int, scale: float) -> CandidateSet:
        """Return the poses with one of them where it leaves least to be lit.

        Around where it is, or where one of the best known poses is.
        """
        scene, samples, known = poses.scene, poses.samples, self.candidates
        around = self.source.around(
            (poses.projectors[i],),
            _N_LATTICE,
            scale * self.rng.uniform(0.5, 1.0),
            far=True,
        )
        if not around:
            return poses
        others = np.delete(np.arange(len(poses.projectors)), i)
        rest = np.any(poses.lit[:, others], axis=1)
        dark = np.flatnonzero(~rest)
        stages = lit_stages(scene, around, samples.take(dark))
        most = np.argsort(-known.lit[dark].sum(axis=0), kind="stable")[:_KNOWN]
        offered = [*around, *known.of(most)]
        lit_dark = np.hstack([stages == LIT, known.lit[dark][:, most]])
        missed = []
        for column in lit_dark.T:
            lit = rest.copy()
            lit[dark[column]] = True
            missed.append(self.missed(lit, _SPARE))
        best = int(np.argmin(missed))
        if missed[best] >= self.missed(poses.reached, _SPARE):
            return poses
        return poses.with_pose(i, CandidateSet.over(scene, samples, (offered[best],)))

    def missed(self, lit: NDArray[np.bool_], spare: float = 0.0) -> float:
        """Return the share of what is required, and a little more, that isn't lit."""
        cover = self.candidates.cover
        quotas = Quotas.of(
            cover.quotas.regions, self.candidates.reached | lit, cover.share
        )
        quotas = replace(quotas, total=int(np.ceil((1.0 + spare) * quotas.total)))
        counts = quotas.regions.counts(lit)[:, None]
        return float(missed_shares(quotas, counts)[0])
