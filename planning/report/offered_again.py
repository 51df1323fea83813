"""The poses that a rig offers, again: do a plan's reference sets still hold them?

What is reachable is what any reference pose reaches, and all shares are of that: with
fewer poses less would be asked.
"""

from collections.abc import Iterable

from planning.cameras.camera_cover import camera_candidate_views
from planning.model.plan import RigPlan
from planning.projectors.candidate_set import CandidateSource
from planning.scene.placed_bodies import Device
from planning.scene.scene import Scene
from planning.verify.trust import kinds_offered_again

from .claims.judged import Devices
from .entries import device_entries as entries
from .written_plan import templates_of

# No rig file may offer fewer.
_LEAST = {"projector": 600, "camera": 400}


def offered_again(plan: RigPlan, scene: Scene, devices: Devices) -> dict[str, int]:
    """Return `rig.n_candidate_*` as far as the reference sets hold what they say.

    They may hold more poses. Where one is lacking, it is how many are there.
    """
    rig = plan.document.rig
    numbers: dict[str, int] = {}
    for kind in kinds_offered_again(plan):
        key = f"n_candidate_{kind}s"
        n = max(getattr(rig, key), _LEAST[kind])
        if kind == "projector":
            lights = templates_of(plan.projectors, rig.models(kind))
            lattice = CandidateSource(scene, tuple(lights)).lattice(n)
            offered = _poses(entries.rounded_projector(one, "") for one in lattice)
            held = _poses(devices.reference_projectors)
        else:
            views = templates_of(plan.cameras, rig.models(kind))
            cameras = camera_candidate_views(scene, tuple(views), n).cameras
            offered = _poses(entries.rounded_camera(one, "") for one in cameras)
            held = _poses(devices.reference_cameras)
        numbers[key] = n if offered <= held else min(len(offered & held), n - 1)
    return numbers


def _poses(devices: Iterable[Device]) -> set[tuple[str, bytes]]:
    """Models and poses, to the last digit; of 0 there is one only."""
    return {(one.model, (one.world_from_device + 0.0).tobytes()) for one in devices}
