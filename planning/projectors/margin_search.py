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
from planning.scene.workspace.candidates import projectors_around

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
    """Return as many projectors at poses of larger margin, as far as some are found.

    Args:
        scene: Surface and requirements.
        projectors: As chosen, without bodies; those that stand already come first.
        margins: Margin of each sample and projector, -inf where unlit, (n, k).
        required: Samples that count.
        n_lattice: Poses of the lattice from which they were chosen.
    """
    given = len(projectors) - len(movable(projectors))
    own, last = margins(projectors), projectors[-1]
    for scale in _SCALES:
        between = projectors_around(
            movable(projectors),
            scene.requirements.workspace,
            n_lattice,
            ring_offset=(0.0, 0.0),
            scale=scale,
            site=scene.site("projector", projectors[0].device),
        )
        if not between:
            break
        offered = (
            *projectors,
            *(moved_to(last, p.world_from_device) for p in between),
        )
        every = np.concatenate([own, margins(offered[len(projectors) :])], axis=1)
        chosen = widest_selection(
            every,
            np.arange(len(projectors)),
            required,
            seed=scene.seed,
            given=given,
        )
        projectors = tuple(offered[i] for i in chosen)
        own = every[:, chosen]
    return projectors
