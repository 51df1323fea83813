"""Poses of larger margin between the candidates, before the pose program takes over.

The pose program moves one projector at a time and stays near where it starts. A cover
of the most margin stands between the poses of a lattice, several of them moved at once;
so poses around the chosen ones are offered, and of all the ones of largest margin at
the share are taken (`share_margin`), from less and less far.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.model.ring_frame import moved_to
from planning.scene.existing import movable
from planning.scene.scene import Scene

from .candidate_set import CandidateSource
from .share_margin import widest_selection

# How far out poses are offered, in spacings of the lattice.
_SCALES = (1.0, 0.5, 0.25)
Margins = Callable[[tuple[PlannedProjector, ...]], NDArray[np.float64]]


def widest_between(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    margins: Margins,
    required: int,
    n_lattice: int,
) -> tuple[PlannedProjector, ...]:
    """Return as many projectors at poses of larger margin, where there are any.

    Args:
        scene: Surface and requirements.
        projectors: As chosen, without bodies; existing ones come first.
        margins: Margin of each sample and projector, -inf where unlit, (n, k).
        required: Samples that count.
        n_lattice: Poses of the lattice from which they were chosen.
    """
    n_existing = len(projectors) - len(movable(projectors))
    margin, last = margins(projectors), projectors[-1]
    source = CandidateSource(scene, last)
    for scale in _SCALES:
        between = source.around(projectors, n_lattice, scale)
        if not between:
            break
        moved = tuple(moved_to(last, p.world_from_device) for p in between)
        margin = np.concatenate([margin, margins(moved)], axis=1)
        chosen = widest_selection(
            margin,
            np.arange(len(projectors)),
            required,
            seed=scene.seed,
            n_existing=n_existing,
        )
        candidates = (*projectors, *moved)
        projectors = tuple(candidates[i] for i in chosen)
        margin = margin[:, chosen]
    return projectors
