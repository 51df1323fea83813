"""Whether one projector fewer does, from poses between the candidates.

A lattice of poses may need one projector more than free poses do, by a handful of
samples. So where the best of one projector fewer fall short by little, poses close
around them are offered too, and of all the ones that together light most are taken,
again and again, from less and less far. Where that comes near, it begins anew from
other poses, at last from a finer lattice.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.proofs.selection import cover_problem, required_samples
from planning.scene.clearance import with_clearance
from planning.scene.limits import projector_limits
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import projectors_around
from solvers import solve_max_coverage

# Poses in between have been seen to win a twentieth of what is required.
_SHORT = 0.05
# How far out they are offered, in spacings of the lattice.
_SCALES = (1.0, 1.0, 0.5, 0.5, 0.25, 0.25, 0.125)
# Gains of rounds shrink: what is short by more than so many isn't won any more,
_GAINS = 4
# unless it is short by less than this: then each scale is tried.
_NEAR = 0.015
# Searches that start apart, each of which may end in a place of its own; and how many
# where one of them came so near.
_STARTS, _MOST_STARTS = 2, 4
# Poses kept from round to round.
_KEPT = 800
# Counted work of each choice, of which no proof is asked.
_BUDGET = 1e8
_NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Offer:
    """Poses, and what forbids each of them at each sample.

    Attributes:
        projectors: The poses.
        stages: First failing limit of each sample and pose, shape (n, k).
    """

    projectors: tuple[PlannedProjector, ...]
    stages: NDArray[np.int8]

    def joined(self, more: "Offer") -> "Offer":
        """Return both offers as one."""
        stages = np.concatenate([self.stages, more.stages], axis=1)
        return Offer(self.projectors + more.projectors, stages)

    def take(self, chosen: NDArray[np.int64]) -> "Offer":
        """Return some of the poses."""
        return Offer(tuple(self.projectors[i] for i in chosen), self.stages[:, chosen])


def one_fewer(
    scene: Scene,
    lattice: Offer,
    n_projectors: int,
    *,
    finer: Callable[[], Offer],
    reached: NDArray[np.bool_],
    stages_of: Callable[[tuple[PlannedProjector, ...]], NDArray[np.int8]],
    given: int,
    ring_offset: tuple[float, float],
    thorough: bool = True,
) -> Offer | None:
    """Return poses that light what is required, with those given; None if none do.

    Args:
        scene: Surface and requirements.
        lattice: Poses spread over the workspace. Poses around a larger cover don't
            belong to them: they lead astray.
        n_projectors: One fewer than are known to be enough; at least 1.
        finer: A lattice of more poses, those given first; asked for where it comes
            near.
        reached: Samples that any known pose lights: what is required is a share of
            these and of those that the poses returned light, shape (n,).
        stages_of: The stages of other poses.
        given: First poses of the lattice that are taken whatever they light, and stay.
        ring_offset: As for `projector_candidates`.
        thorough: Whether to begin in more places than one, and to follow near misses
            at every scale.
    """
    near, starts = (_NEAR, _STARTS) if thorough else (0.0, 1)
    site = scene.site("projector", lattice.projectors[0].device)
    n_lattice, nearest = len(lattice.projectors), np.inf
    for start in range(_MOST_STARTS):
        begun = lattice if start < _STARTS else finer()
        offer = _begin(begun, given, scene.seed, start)
        best, short = _NONE, np.inf
        for attempt, scale in enumerate((*_SCALES, None)):
            seed = scene.seed + start * (len(_SCALES) + 1) + attempt
            best, missing, required = _most_lit(
                scene, offer, n_projectors, reached, given, best, seed
            )
            if missing <= 0:
                return offer.take(best[best >= given])
            gain, short = short - missing, missing
            nearest = min(nearest, missing / required)
            hopeful = missing <= min(_SHORT * required, _GAINS * gain)
            if scale is None or not (hopeful or missing <= near * required):
                break
            offer, best = _without_idle(offer, best, given)
            between = projectors_around(
                offer.take(best[best >= given]).projectors,
                scene.requirements.workspace,
                n_lattice,
                ring_offset=ring_offset,
                scale=scale,
                site=site,
            )
            between = with_clearance(scene, between)
            # They join the others: the best may be of both.
            offer = offer.joined(Offer(between, stages_of(between)))
        if nearest > near and start + 1 >= starts:
            break
    return None


def _begin(lattice: Offer, given: int, seed: int, start: int) -> Offer:
    """The whole lattice, or a random half of it: another place to begin."""
    if start % 2 == 0:
        return lattice
    n = len(lattice.projectors)
    half = np.random.default_rng([seed, start]).random(n) < 0.5
    return lattice.take(np.flatnonzero(half | (np.arange(n) < given)))


def _without_idle(
    offer: Offer, best: NDArray[np.int64], given: int
) -> tuple[Offer, NDArray[np.int64]]:
    """Leave out poses that light least in the place of any one of the best."""
    lit = (offer.stages == projector_limits.LIT).astype(np.float32)
    alone = lit[:, best] * (lit[:, best].sum(axis=1, keepdims=True) == 1.0)
    dark = ~lit[:, best].any(axis=1, keepdims=True)
    # What opens where one of the best goes, and what is dark already.
    gains = (lit.T @ (alone + dark)).max(axis=1)
    gains[:given] = gains[best] = np.inf
    kept = np.sort(np.argsort(-gains, kind="stable")[:_KEPT])
    return offer.take(kept), np.searchsorted(kept, best)


def _most_lit(
    scene: Scene,
    offer: Offer,
    n_projectors: int,
    reached: NDArray[np.bool_],
    given: int,
    start: NDArray[np.int64],
    seed: int,
) -> tuple[NDArray[np.int64], int, int]:
    """Return the poses that light most, what they miss, and what is required."""
    lit = offer.stages == projector_limits.LIT
    best = solve_max_coverage(
        cover_problem(lit, 0, given),
        n_projectors,
        warm_start=start,
        seed=seed,
        budget=_BUDGET,
    ).selected
    own = lit[:, best].any(axis=1)
    required = required_samples(reached | own, scene.requirements.dominant_coverage)
    return best, required - int(own.sum()), required
