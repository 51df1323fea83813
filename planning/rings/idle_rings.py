"""Rings that light nothing of the object, and so aren't projected."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.scene.codes.patterns import RingPattern
from planning.scene.lighting import in_panel
from planning.scene.scene import Scene

from .beam_profile import BeamProfile, cast_beam

# Rows of rays in a gap.
_ROWS = 4


def idle_rings(
    scene: Scene, projector: PlannedProjector, profile: BeamProfile, margin: float
) -> NDArray[np.bool_]:
    """Return which rings would light nothing, though the object stood a little aside.

    The band of a ring reaches from the ring within to the ring beyond, or as far again
    beyond the last. A ring is idle if no ray of the beam meets the object in its band
    widened by the margin, nor any vertex that the panel holds lies there: rays may miss
    a pin. Rings that stay as they are aren't asked; two are always left.

    Args:
        scene: The object.
        projector: Its rings, shape (n,).
        profile: Where its light meets the object.
        margin: How far aside the object or the projector may stand, in the unit of
            radii.

    Returns:
        Shape (n,).
    """
    radii = projector.ring_radii
    vertices = scene.mesh.vertices
    met = RingPattern(projector).coordinate(vertices[in_panel(projector, vertices)])
    rows = profile.coordinates[profile.on_object.any(axis=1)]
    places = np.sort(np.concatenate([rows, met]))
    edges = np.concatenate([[0.0], radii, [2.0 * radii[-1] - radii[-2]]])
    first = np.searchsorted(places, edges[:-2] - margin, side="left")
    idle = first == np.searchsorted(places, edges[2:] + margin, side="right")
    stays = projector.keeps_rings or np.count_nonzero(~idle) < 2
    return np.zeros_like(idle) if stays else idle


def without_idle(
    scene: Scene, projector: PlannedProjector, margin: float
) -> PlannedProjector:
    """Return a projector of evenly spaced rings without the idle ones."""
    radii = projector.ring_radii
    rows = np.linspace(0.0, float(radii[-1]), _ROWS * len(radii) + 1)[1:]
    profile = cast_beam(scene, projector, rows)
    idle = idle_rings(scene, projector, profile, margin)
    return replace(projector, ring_radii=radii[~idle])
