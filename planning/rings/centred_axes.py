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
from planning.model.planned import PlannedProjector
from planning.scene.codes.patterns import RingPattern
from planning.scene.draws import DRAWS
from planning.scene.lights import Light, light_of
from planning.scene.measured import lit_samples
from planning.scene.samples import merged
from planning.scene.scene import Scene


def centred_axes(
    scene: Scene, projectors: Sequence[PlannedProjector], margin: float
) -> tuple[PlannedProjector, ...]:
    """Return projectors with centred ring axes, and the rings that reach so far.

    Of the evenly spaced rings those stay that hold what is lit with a margin beside it,
    in the unit of radii. One that keeps its rings, or lights nothing, keeps the axis.
    """
    both = merged(scene.target_samples(DRAWS.axes), scene.surface_samples(DRAWS.axes))
    samples = lit_samples(scene, projectors, both)
    points = samples.target.samples.points
    return tuple(
        one
        if one.keeps_rings or not samples.lit[:, p].any()
        else _centred(one, points[samples.lit[:, p]], margin)
        for p, one in enumerate(projectors)
    )


def _centred(
    projector: PlannedProjector, lit: NDArray[np.float64], margin: float
) -> PlannedProjector:
    light, pose = light_of(projector.device), projector.world_from_device
    axis = light.axis_of(_middle(light, transform(inverse(pose), lit)))
    turned = replace(projector, world_from_ring=pose @ light.ring_frame(axis))
    radii, reach = turned.ring_radii, RingPattern(turned).coordinate(lit).max()
    count = max(2, int(np.searchsorted(radii, reach + margin)) + 1)
    return replace(turned, ring_radii=radii[:count])


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
