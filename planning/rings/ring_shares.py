"""How much of each ring lands where it is wanted: the paper's false projections.

The paper draws every ring wholly on the object; what misses it is light for nothing. A
ring is followed about its axis, ray by ray.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.ring_records import RingSharesRecord
from planning.scene.measuring.measured import LitSamples, measured_by
from planning.scene.scene import Scene

from .beam_profile import BeamProfile, cast_beam, on_faces

# From just inside each: rounding doesn't decide between two gaps, nor about the last.
_INSIDE = 1.0 - 1e-9


def ring_shares(
    scene: Scene, projector: PlannedProjector, cameras: Sequence[PlannedCamera]
) -> RingSharesRecord:
    """Return what becomes of a projector's rings, to a ten thousandth of the turn."""
    scene.check_cancelled()
    profile = cast_beam(scene, projector, _INSIDE * projector.ring_radii)
    landing = {
        "on_object": profile.on_object,
        "on_target": profile.on_object & profile.target,
        "measured": _measured(scene, projector, cameras, profile),
    }
    return RingSharesRecord(
        **{
            name: tuple(np.round(lands.mean(axis=1), 4).tolist())
            for name, lands in landing.items()
        }
    )


def _measured(
    scene: Scene,
    projector: PlannedProjector,
    cameras: Sequence[PlannedCamera],
    profile: BeamProfile,
) -> NDArray[np.bool_]:
    """Whether a camera measures each ray of the grid, with this projector's light."""
    measured = np.zeros_like(profile.lit)
    if profile.lit.any():
        target = on_faces(
            scene, profile.points[profile.lit], profile.faces[profile.lit]
        )
        lit = np.ones((len(target), 1), dtype=bool)
        samples = LitSamples.of((projector,), target, lit)
        measured[profile.lit] = measured_by(scene, cameras, samples).any(axis=1)
    return measured
