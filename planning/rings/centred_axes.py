"""Ring axes through the middle of what each projector lights, as the paper draws them.

In diverging light that is the axis of the narrowest cone about all that is lit, in
parallel light that of the narrowest cylinder: no other axis has fewer rings.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.mesh.extent import enclosing_ball
from geometry.poses import inverse, transform
from planning.model.devices.planned import PlannedProjector
from planning.scene.codes.patterns import RingPattern
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.lights import Light, light_of
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import merged
from planning.scene.scene import Scene

# Rings about an axis in the middle may hold more than those about the one before, whose
# middle is another: so often it is sought at most. Twice is mostly enough.
_ROUNDS = 8


def centred_axes(
    scene: Scene, projectors: Sequence[PlannedProjector], margin: float
) -> tuple[PlannedProjector, ...]:
    """Return projectors with centred ring axes, and the rings that reach so far.

    Of the evenly spaced rings those stay that hold what is lit with a margin beside it,
    in the unit of radii. One that keeps its rings, or lights nothing, keeps the axis.
    """
    both = merged(scene.target_samples(DRAWS.axes), scene.surface_samples(DRAWS.axes))
    points, turned = both.samples.points, tuple(projectors)
    lit = lit_stages(scene, turned, both) == LIT
    for _ in range(_ROUNDS):
        turned = tuple(map(_turned, turned, (points[column] for column in lit.T)))
        before, lit = lit, lit_stages(scene, turned, both) == LIT
        if np.array_equal(lit, before):
            break
    return tuple(
        one
        if one.keeps_rings or not column.any()
        else _cut(one, points[column], margin)
        for one, column in zip(turned, lit.T, strict=True)
    )


def _turned(projector: PlannedProjector, lit: NDArray[np.float64]) -> PlannedProjector:
    """Return the projector with its ring axis in the middle of lit points, (n, 3)."""
    if projector.keeps_rings or not len(lit):
        return projector
    light, pose = light_of(projector.device), projector.world_from_device
    axis = light.axis_of(_middle(light, transform(inverse(pose), lit)))
    return replace(projector, world_from_ring=pose @ light.ring_frame(axis))


def _cut(
    projector: PlannedProjector, lit: NDArray[np.float64], margin: float
) -> PlannedProjector:
    """Return the projector with the rings that reach so far beyond lit points."""
    radii, reach = projector.ring_radii, RingPattern(projector).coordinate(lit).max()
    count = max(2, int(np.searchsorted(radii, reach + margin)) + 1)
    return replace(projector, ring_radii=radii[:count])


def _middle(light: Light, local: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a ring frame whose axis is in the middle of points of the device."""
    frame = np.eye(4)
    if light.common_direction(frame) is None:
        rays = local / lengths(local)[:, None]
        centre, _ = enclosing_ball(rays)
        frame[:3, 2] = centre / np.linalg.norm(centre)
    else:
        centre, _ = enclosing_ball(local * [1.0, 1.0, 0.0])
        frame[:2, 3] = centre[:2]
    return frame
