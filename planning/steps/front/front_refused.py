"""What a front can't be asked together with."""

from planning.model.errors import InputError
from planning.report.partial_plan import PlanRequest


def check_front(request: PlanRequest) -> None:
    """Refuse what the points of a front aren't planned with.

    Raises:
        InputError: It names both, and what to do.
    """
    wishes, rig = request.wishes, request.rig
    others = (
        (rig.head is not None, "a [head]", "its devices come together"),
        (
            rig.turntable is not None,
            "a [turntable]",
            "`plan` prints steps for each number of devices there",
        ),
        (wishes.pattern == "none", "pattern 'none'", "there are no projectors"),
        (request.ranges is not None, "ranges", "cameras keep spare field there"),
        (wishes.survive > 0, "survive = 1", "every point would need spare devices"),
        ((wishes.views or 1) > 1, f"views = {wishes.views}", "one pair is asked for"),
        (wishes.robust is not None, "robust", "drawn rigs are of one plan"),
        (wishes.joint, "joint", "a front takes projectors first"),
        (
            request.cameras_by == "paper",
            "cameras_by = 'paper'",
            "the paper's route has no rig of fewer cameras",
        ),
    )
    for asked, what, why in others:
        if asked:
            raise InputError(f"a front with {what}: {why}; leave one of them out")
    for kind in ("projector", "camera"):
        if any(model.body is not None for model in rig.models(kind)):
            raise InputError(
                f"a front: rig {rig.name!r} gives a {kind} a body, and a front chooses "
                f"devices that aren't in each other's way; leave [{kind}.body] out"
            )
