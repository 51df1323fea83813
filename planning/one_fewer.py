"""Whether one projector fewer does, from poses between the candidates.

A lattice of poses may need one projector more than free poses do, by a handful of
samples. So where the best of one projector fewer fall short by little, poses close
around them are offered too, and of all the ones that together light most are taken,
again and again, from less and less far.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers import solve_max_coverage

from . import lighting
from .body_room import with_room
from .candidates import projectors_around
from .plan import PlannedProjector
from .scene import Scene
from .selection import cover_problem, required_rows

# Poses in between have been seen to win a twentieth of what is required.
_SHORT = 0.05
# How far out they are offered, in spacings of the lattice.
_SCALES = (1.0, 1.0, 0.5, 0.5, 0.25, 0.25)
# Gains of rounds shrink: what is short by more than so many isn't won any more.
_GAINS = 4
# Searches that start apart; each may end in a place of its own.
_STARTS = 2
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
    stages_of: Callable[[tuple[PlannedProjector, ...]], NDArray[np.int8]],
    given: int,
    ring_offset: tuple[float, float],
) -> Offer | None:
    """Return poses that light what is required, with those given; None if none do.

    Args:
        scene: Surface and requirements.
        lattice: Poses spread over the workspace. Poses around a larger cover don't
            belong to them: they lead astray.
        n_projectors: One fewer than are known to be enough; at least 1.
        stages_of: The stages of other poses.
        given: First poses of the lattice that are taken whatever they light, and stay.
        ring_offset: As for `projector_candidates`.
    """
    begun: list[list[int]] = []
    site = scene.site("projector", lattice.projectors[0].device)
    for start in range(_STARTS):
        offer, best, short = lattice, _NONE, np.inf
        for attempt, scale in enumerate((*_SCALES, None)):
            seed = scene.seed + start * (len(_SCALES) + 1) + attempt
            best, missing, required = _most_lit(
                scene, offer, n_projectors, given, best, seed
            )
            if missing <= 0:
                return offer.take(best[best >= given])
            if attempt == 0:
                if best.tolist() in begun:
                    break
                begun.append(best.tolist())
            gain, short = short - missing, missing
            if scale is None or missing > min(_SHORT * required, _GAINS * gain):
                break
            between = projectors_around(
                offer.take(best[best >= given]).projectors,
                scene.requirements.workspace,
                len(lattice.projectors),
                ring_offset=ring_offset,
                scale=scale,
                site=site,
            )
            between = with_room(scene, between)
            # They join the others: the best may be of both.
            offer = offer.joined(Offer(between, stages_of(between)))
    return None


def _most_lit(
    scene: Scene,
    offer: Offer,
    n_projectors: int,
    given: int,
    start: NDArray[np.int64],
    seed: int,
) -> tuple[NDArray[np.int64], int, int]:
    """Return the poses that light most, what they miss, and what is required."""
    lit = offer.stages == lighting.LIT
    required = required_rows(lit.any(axis=1), scene.requirements.dominant_coverage)
    best = solve_max_coverage(
        cover_problem(lit, required, given),
        n_projectors,
        warm_start=start,
        seed=seed,
        budget=_BUDGET,
    ).selected
    return best, required - int(lit[:, best].any(axis=1).sum()), required
