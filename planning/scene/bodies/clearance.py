"""Where a device's body has room: beside others, off the object, within the zones."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.scene.placed_bodies import (
    CLEARANCE_M,
    Device,
    collide,
    existing_devices,
    placed_box,
    touches_mesh,
)
from planning.scene.scene import Scene
from planning.scene.workspace.admissible import broken_by_body

_D = TypeVar("_D", PlannedProjector, PlannedCamera)
# Poses that are tried for each wanted, at most.
_MOST_OFFERED = 20
# Poses whose causes are told, about.
_TOLD = 1000


def lacks_clearance(scene: Scene, device: Device) -> str:
    """Return what a device's body would touch or reach into; empty if nothing.

    The object, a keep-out volume, the body of another device, an obstacle; below the
    floor; out of the room. Floor and zones don't bind devices that stand already.
    """
    if device.body is None:
        return ""
    box = placed_box(device.body, device.world_from_device).grown(CLEARANCE_M)
    if touches_mesh(box, scene.mesh):
        return "the object"
    workspace = scene.requirements.workspace
    if not device.existing and (broken := broken_by_body(workspace, box)):
        return broken[0]
    others = collide(device, scene.bodies, workspace.clearance_m)
    return others[0].words if others else ""


def with_clearance(scene: Scene, devices: Sequence[_D]) -> tuple[_D, ...]:
    """Return the devices whose bodies have room among those that stand already."""
    kept: list[_D] = []
    for device in devices:
        scene.check_cancelled()
        if not lacks_clearance(scene, device):
            kept.append(device)
    return tuple(kept)


def candidates_with_clearance(
    scene: Scene, n: int, offer: Callable[[int], tuple[_D, ...]]
) -> tuple[_D, ...]:
    """Return at least n candidates that have room, if a finer lattice has as many.

    Raises:
        InfeasibleLimitsError: If no candidate's body has room.
    """
    offered, most = n, _MOST_OFFERED * n
    while True:
        candidates = offer(offered)
        kept = with_clearance(scene, candidates)
        if len(kept) >= min(n, len(candidates)) or offered >= most:
            break
        more = np.ceil(1.1 * offered * n / max(len(kept), 1))
        offered = int(min(more, most))
    if not kept:
        raise InfeasibleLimitsError(_no_room(scene, candidates))
    return kept


def check_existing_clearance(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
) -> None:
    """Refuse existing devices whose bodies touch each other or the object.

    Raises:
        InfeasibleLimitsError: It names both and what to do.
    """
    required = scene.requirements
    devices = (
        *existing_devices(required, projectors),
        *existing_devices(required, cameras),
    )
    for device in devices:
        if what := lacks_clearance(scene, device):
            raise InfeasibleLimitsError(
                f"existing {device.existing!r}: its body touches {what}, bodies must "
                f"stand at least {1e3 * CLEARANCE_M:g} mm apart; correct its place or "
                f"size_mm and centre_mm of its body"
            )


def _no_room(scene: Scene, candidates: Sequence[Device]) -> str:
    causes: list[str] = []
    for device in candidates[:: max(1, len(candidates) // _TOLD)]:
        scene.check_cancelled()
        causes.append(lacks_clearance(scene, device))
    kind = "projector" if isinstance(candidates[0], PlannedProjector) else "camera"
    named = ", ".join(
        f"{what} {100.0 * causes.count(what) / len(causes):.0f} %"
        for what in sorted(set(causes), key=lambda what: (-causes.count(what), what))
    )
    apart = 1e3 * scene.requirements.workspace.clearance_m
    near = f", or come nearer than {apart:g} mm to," if apart else ""
    return (
        f"no {kind} of {len(candidates)} poses has room for its body, which would "
        f"touch or reach into{near} {named}; make the body smaller, "
        f"{_remedy(set(causes))}"
    )


def _remedy(causes: set[str]) -> str:
    if causes == {"the object"}:
        return "or raise placement.standoff_mm"
    if "the object" in causes:
        return "move or widen the others, or change placement.standoff_mm"
    return "or move or widen what is in its way"
