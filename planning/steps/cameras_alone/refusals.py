"""What can't be asked for together with cameras alone."""

from planning.model.errors import InputError
from planning.report.partial_plan import PlanRequest

_ALONE = "pattern = 'none'"


def check_alone(request: PlanRequest) -> None:
    """Refuse what cameras alone aren't planned together with.

    Raises:
        InputError: It names both, and what to do.
    """
    wishes, rig = request.wishes, request.rig
    if request.evaluates:
        raise InputError(
            f"{_ALONE}: cameras alone aren't evaluated as they stand yet; plan them "
            f"with max_projectors = 0"
        )
    if wishes.robust is not None:
        raise InputError(
            f"{_ALONE} with robust = {wishes.robust:g}: rigs are drawn for pairs of "
            f"projector and camera; leave robust out"
        )
    if wishes.survive:
        raise InputError(
            f"{_ALONE} with survive = {wishes.survive}: the loss of a camera isn't "
            f"planned for among cameras alone; leave survive out"
        )
    if wishes.ring_axis is not None:
        raise InputError(
            f"{_ALONE} with ring_axis = {wishes.ring_axis!r}: there is no ring; leave "
            f"ring_axis out"
        )
    if request.cameras_by == "paper":
        raise InputError(
            f"{_ALONE} with cameras_by = 'paper': the paper's route asks for "
            f"projectors; take 'cover' or 'both'"
        )
    if request.ranges is not None:
        raise InputError(
            f"{_ALONE} for a body that is known by its ranges: what is kept free for "
            f"it is of projectors and cameras; give a mesh"
        )
    _check_devices(request)
    if len(rig.camera_models) > 1:
        raise InputError(
            f"{_ALONE}: rig {rig.name!r} has {len(rig.camera_models)} models of "
            f"cameras; cameras alone are planned of one model"
        )


def _check_devices(request: PlanRequest) -> None:
    """Refuse projectors that stand already, and bodies of cameras."""
    rig = request.rig
    standing = [one.name for one in rig.table.existing]
    if standing:
        raise InputError(
            f"{_ALONE}: {', '.join(standing)} stand already, and cameras alone are "
            f"planned from nothing; leave [[existing]] or fixed out"
        )
    if any(model.body is not None for model in rig.camera_models):
        raise InputError(
            f"{_ALONE}: rig {rig.name!r} gives the camera a body, and cameras alone "
            f"aren't planned among each other's bodies; leave [camera.body] out"
        )
