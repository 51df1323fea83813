"""What projectors light of samples: which limit fails first, and with what margin."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.rays.rays import equal_parts
from geometry.rays.visibility_matrix import visibility_matrix
from planning.model.planned import PlannedProjector

from . import lighting
from .open_stages import SampleColumns, open_stages
from .samples import Target
from .scene import Scene

# Projectors that a thread takes on at a time.
_SHARED = 32


def lit_stages(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    """Return the first failing limit of each sample (row) and projector (column)."""
    stages = _in_the_open(scene, projectors, target)
    for light in ("diverging", "parallel"):
        alike = [i for i, p in enumerate(projectors) if p.light == light]
        if alike:
            own = [projectors[i] for i in alike]
            stages[:, alike] = _with_shadows(scene, own, target, stages[:, alike])
    for column, projector in enumerate(projectors):
        lighting.mark_blocked(
            stages[:, column], projector, target.samples.points, scene.standing
        )
    return stages


def _in_the_open(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    """Return the stages of projectors, were nothing in between."""
    samples, limits = SampleColumns.of(target), scene.requirements.projector
    found = np.empty((len(projectors), len(target)), dtype=np.int8)

    def fill(part: slice) -> None:
        scene.check_cancelled()
        for own in range(part.start, part.stop):
            found[own] = open_stages(projectors[own], samples, limits)

    parts = equal_parts(len(projectors), _SHARED)
    scene.visibility.caster.share(fill, parts)
    return np.ascontiguousarray(found.T)


def _with_shadows(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    target: Target,
    stages: NDArray[np.int8],
) -> NDArray[np.int8]:
    """Return the stages of projectors with one kind of light, occlusion included."""
    poses = np.stack([projector.world_from_device for projector in projectors])
    lit = stages == lighting.LIT
    seen = visibility_matrix(
        scene.visibility,
        poses[:, :3, 3],
        target.samples.points,
        target.samples.normals,
        along=poses[:, :3, 2] if projectors[0].light == "parallel" else None,
        candidates=np.ascontiguousarray(lit.T),
    ).dense_transposed()
    return np.where(lit & ~seen, np.int8(lighting.OCCLUDED), stages)


def margins_of(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.float64]:
    """Return the smaller margin of each sample (row) and projector (column) [rad]."""
    margin = np.empty((len(target), len(projectors)))
    limits = scene.requirements.projector
    for column, projector in enumerate(projectors):
        light = lighting.light_on(projector, target)
        margin[:, column] = lighting.margins(light, limits)
    return margin


def lit_margins(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    target: Target,
    lit: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return what `margins_of` does, -inf where a projector doesn't light a sample."""
    margin = np.full(lit.shape, -np.inf)
    for column, projector in enumerate(projectors):
        own = np.flatnonzero(lit[:, column])
        margin[own, column] = margins_of(scene, [projector], target.take(own))[:, 0]
    return margin


def merged(first: Target, second: Target) -> Target:
    """Return both sets of samples as one; every sample stands for the same area."""
    a, b = first.samples, second.samples
    total = len(a) * a.weight
    samples = type(a)(
        np.concatenate([a.points, b.points]),
        np.concatenate([a.normals, b.normals]),
        np.concatenate([a.faces, b.faces]),
        total / (len(a) + len(b)),
    )
    return Target(samples, np.concatenate([first.steep, second.steep]))
