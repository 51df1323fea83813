"""Rigs whose devices stand together, or before a table: what can be asked of them."""

from planning.cameras.stations.turntable.table_lattice import planned_angles
from planning.model.errors import InputError
from planning.report.partial_plan import PlanRequest
from planning.rig.rig import Rig
from planning.rig.wishes import Pattern

# Angles of a turntable that are planned with, at most.
_MOST_ANGLES = 96


def pattern_of_rig(rig: Rig, asked: Pattern | None) -> Pattern:
    """Return the pattern that is asked for; of heads and turntables it is dense."""
    return asked or ("dense" if rig.head or rig.turntable else "rings")


def devices_of_heads(rig: Rig, max_heads: int) -> tuple[int, int]:
    """Return how many projectors and cameras so many heads have.

    Raises:
        InputError: If the rig has no head, or may have fewer.
    """
    head, stations = rig.head, rig.stations
    if max_heads < 1:
        raise InputError(f"max_heads = {max_heads} must be 1 or more")
    if head is None:
        raise InputError(
            f"max_heads = {max_heads}: rig {rig.name!r} has no [head]; write one, take "
            f"a preset that has one (`plan rigs`), or ask for projectors"
        )
    if stations is not None and stations.max is not None and max_heads > stations.max:
        raise InputError(
            f"max_heads = {max_heads}: [stations] of rig {rig.name!r} allows "
            f"{stations.max} poses of its head; ask for no more, or raise its max"
        )
    return max_heads * len(head.projectors), max_heads * len(head.cameras)


def check_carried(request: PlanRequest) -> None:
    """Refuse what can't be asked of heads, or of a turntable.

    Raises:
        InputError: It names both, and what to do.
    """
    rig, wishes = request.rig, request.wishes
    if request.evaluates or not (rig.head or rig.turntable):
        return
    what = "[head]" if rig.head else "[turntable]"
    named = f"rig {rig.name!r} has a {what}"
    if rig.head and wishes.max_heads is None:
        raise InputError(
            f"{named}: its devices come together, so give max_heads (--max-heads N)"
        )
    if rig.head and rig.turntable:
        raise InputError(f"{named} and a [turntable]: planned is one of both")
    if wishes.pattern != "dense":
        raise InputError(
            f"{named}, which is planned with pattern 'dense', not {wishes.pattern!r}"
        )
    table, bodies = rig.turntable, ("projector", "camera")
    if table is not None and planned_angles(table.steps) > _MOST_ANGLES:
        raise InputError(
            f"{named} of {table.steps} steps, of which none from 12 to 36 evenly over "
            f"a turn can be planned with; give a number that one of these divides, or "
            f'steps = "free"'
        )
    models = [model for kind in bodies for model in rig.models(kind)]
    fastened = any(model.table.mount for model in models)
    unable = {
        "a mount of devices": bool(table and fastened),
        "views": (wishes.views or 1) > 1,
        "survive": wishes.survive > 0,
        "robust": wishes.robust is not None,
        "[[existing]] devices, or --fixed": bool(rig.table.existing),
        "--ranges": request.ranges is not None,
        "cross = true with a housing": bool(
            rig.head and rig.head.cross and rig.head.body
        ),
        "cross = true with [stations]": bool(
            rig.head and rig.head.cross and rig.stations
        ),
        "joint": wishes.joint,
        "[photometry]": rig.table.photometry is not None,
    }
    for asked, there in unable.items():
        if there:
            raise InputError(f"{named}: {asked} can't go with it; leave one out")
