"""How much of each ring lands where it is wanted: the paper's false projections.

The paper draws every ring wholly on the object; what misses it is light for nothing. A
ring is followed about its axis, ray by ray.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.scene import lighting
from planning.scene.measured import LitSamples, measured_by
from planning.scene.patterns.pattern import code_surfaces
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .beam_profile import BeamProfile, cast_beam

_AZIMUTHS = 360
# From just inside each: rounding doesn't decide between two gaps, nor about the last.
_INSIDE = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class RingShares:
    """Shares of each ring's azimuth, in [0, 1], shape (n_rings,) each.

    Attributes:
        on_object: Lands on the object.
        on_target: Lands on its target.
        measured: Is lit, and a camera measures it with this projector.
    """

    on_object: NDArray[np.float64]
    on_target: NDArray[np.float64]
    measured: NDArray[np.float64]

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values: shares in ten thousandths."""
        return {
            name: np.round(values, 4).tolist() for name, values in vars(self).items()
        }


def ring_shares(
    scene: Scene, projector: PlannedProjector, cameras: Sequence[PlannedCamera]
) -> RingShares:
    """Return what becomes of a projector's rings on the surface.

    Args:
        scene: Surface and limits.
        projector: With its final rings.
        cameras: As planned.
    """
    scene.check_cancelled()
    profile = cast_beam(scene, projector, _INSIDE * projector.ring_radii, _AZIMUTHS)
    return RingShares(
        profile.on_object.mean(axis=1),
        (profile.on_object & profile.target).mean(axis=1),
        _measured(scene, projector, cameras, profile).mean(axis=1),
    )


def _measured(
    scene: Scene,
    projector: PlannedProjector,
    cameras: Sequence[PlannedCamera],
    profile: BeamProfile,
) -> NDArray[np.bool_]:
    """Whether a camera measures each ray of the grid, with this projector's light."""
    measured = np.zeros_like(profile.lit)
    if not profile.lit.any():
        return measured
    points, faces = profile.points[profile.lit], profile.faces[profile.lit]
    samples = SurfaceSamples(points, scene.mesh.face_normals[faces], faces, 0.0)
    target = Target(samples, scene.steep[faces])
    rows = LitSamples(
        target,
        np.ones((len(target), 1), dtype=bool),
        (lighting.light_on(projector, target),),
        (code_surfaces(projector, points),),
    )
    measured[profile.lit] = measured_by(scene, cameras, rows).any(axis=1)
    return measured
