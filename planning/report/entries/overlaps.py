"""Which projectors put light on the same surface, and which may fire together.

A ring code is read from how bright a pixel is in a sequence of images. Where a second
projector shines while it runs, the images hold the sum of two codes, and neither can be
read. So it counts where light *falls*, not where it is good enough to measure with: an
incidence of 80 degrees or a blurred ring spoils another's code as well. Light falls on
a point that lies inside the image (or beam), no more than one gap beyond the outermost
ring (the annulus around it is drawn, too), faces the projector and isn't in shadow.
Light that grazes it at over 89 degrees is left out.

Two projectors overlap if any sample, of the target or of the whole surface, gets light
from both. Those that don't may fire in one go. The fewest goes are the fewest colours
of the graph of overlaps.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.model.document.coverage_records import ExposureSchedule, Overlap
from planning.model.requirements import ProjectorLimits
from planning.scene import lighting
from planning.scene.codes.patterns import pattern_of
from planning.scene.draws import DRAWS
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers.colouring import fewest_colours

# Rays and rounding can't tell on which side light passes that runs along a face.
_ANY_LIGHT = ProjectorLimits(float(np.radians(89.0)), 0.0)


def overlap_records(
    scene: Scene, projectors: Sequence[PlannedProjector], *, moved: bool = False
) -> tuple[tuple[Overlap, ...], ExposureSchedule]:
    """Return the plan's `overlaps` and `firing_schedule`, from fresh samples.

    Projectors at different stations are one that is `moved`, or else stand apart.
    """
    target = scene.target_samples(DRAWS.overlaps)
    surface = scene.surface_samples(DRAWS.overlaps)
    on_target = shared_areas(scene, projectors, target)
    on_surface = shared_areas(scene, projectors, surface)
    names = [projector.id for projector in projectors]
    overlaps = tuple(
        Overlap(
            projectors=(names[i], names[j]),
            target_m2=on_target[i, j],
            surface_m2=on_surface[i, j],
        )
        for i, j in combinations(range(len(names)), 2)
    )
    conflicts = (on_target > 0.0) | (on_surface > 0.0)
    if moved:
        at = np.array([projector.station for projector in projectors])
        conflicts |= at[:, None] != at
    np.fill_diagonal(conflicts, val=False)
    colouring = fewest_colours(conflicts)
    return overlaps, ExposureSchedule(
        groups=tuple(tuple(names[i] for i in group) for group in colouring.groups),
        n_groups=colouring.n_colours,
        lower_bound=colouring.lower_bound,
        proof=colouring.proof,
        clique=tuple(names[i] for i in colouring.clique),
    )


def shared_areas(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.float64]:
    """Return the area that each two projectors put light on [m²], shape (k, k).

    On the diagonal stands what each puts light on.
    """
    falls = np.zeros((len(target), len(projectors)))
    for column, projector in enumerate(projectors):
        scene.check_cancelled()
        falls[:, column] = light_falls(scene, projector, target)
    return target.samples.weight * (falls.T @ falls)


def light_falls(
    scene: Scene, projector: PlannedProjector, target: Target
) -> NDArray[np.bool_]:
    """Return on which samples any light of a projector falls, shape (n,)."""
    anywhere = replace(projector.device, range_m=(0.0, np.inf))
    # No steep direction: along it, light is poor, but it is light.
    plain = replace(target, steep=np.zeros_like(target.steep))
    stages = lighting.first_failure(
        replace(pattern_of(projector).with_border(), device=anywhere),
        plain,
        _ANY_LIGHT,
        scene.occlusion,
        bodies=scene.bodies,
    )
    return stages == LIT
