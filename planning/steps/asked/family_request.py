"""Several meshes for one rig: their names, and what can't be asked of them."""

import re
from collections.abc import Sequence

from geometry.alignment.alignment import aligned
from geometry.mesh.mesh import TriangleMesh
from planning.model.document.family_records import AlignedBy, AlignmentRecord
from planning.model.errors import InputError
from planning.report.partial_plan import FamilyRequest, PlanRequest
from planning.rig.wishes import Wishes

# What is awkward in the name of a folder.
_AWKWARD = re.compile(r"[^A-Za-z0-9._-]+")


def family_of(
    meshes: Sequence[TriangleMesh], align: AlignedBy, quantile: float
) -> FamilyRequest:
    """Return meshes as members of a family, laid over the first if that is asked.

    Raises:
        InputError: If the share is none.
    """
    if not 0.0 < quantile <= 1.0:
        raise InputError(
            f"family_quantile = {quantile} must be above 0 and at most 1: the share of "
            f"the members that the rig must serve"
        )
    names = member_names([mesh.source.path if mesh.source else "" for mesh in meshes])
    placed = aligned(meshes, align)
    return FamilyRequest(
        names,
        tuple(one.mesh for one in placed),
        tuple(
            AlignmentRecord.model_validate(
                {
                    "world_from_file": one.world_from_file.tolist(),
                    "rms_before_m": one.rms_before_m,
                    "rms_m": one.rms_m,
                }
            )
            for one in placed
        ),
        align,
        quantile,
    )


def member_names(paths: Sequence[str]) -> tuple[str, ...]:
    """Return a name for each member that no other has: that of its file, or a number.

    Names are told apart whatever the case of their letters, as folders are.
    """
    names: list[str] = []
    for number, path in enumerate(paths, start=1):
        stem = re.split(r"[\\/]", path)[-1].split(".")[0]
        stem = _AWKWARD.sub("-", stem).strip("-.") or f"member-{number}"
        name, again, taken = stem, 2, {one.lower() for one in names}
        while name.lower() in taken:
            name, again = f"{stem}-{again}", again + 1
        names.append(name)
    return tuple(names)


def check_members(wishes: Wishes, *, selected: bool) -> None:
    """Refuse what is said of the regions of one mesh.

    Raises:
        InputError: It names both, and what to do.
    """
    _refuse(
        (selected, "a selection or a weight", "faces are of one mesh"),
        (bool(wishes.region_coverage), "region_coverage", "the floors are members'"),
    )


def check_family(request: PlanRequest) -> None:
    """Refuse what can't be planned for several meshes together.

    Raises:
        InputError: It names both, and what to do.
    """
    rig, wishes = request.rig, request.wishes
    mounted = request.mounted is not None or bool(rig.table.existing)
    _refuse(
        (wishes.robust is not None, "robust", "drawn rigs measure one mesh"),
        (wishes.joint, "joint", "devices are sought in two stages"),
        (wishes.survive > 0, "survive = 1", "losses are planned for one mesh"),
        ((wishes.views or 1) > 1, f"views = {wishes.views}", "one pair is enough here"),
        (wishes.max_heads is not None, "max_heads", "heads are placed for one mesh"),
        (wishes.pattern == "none", "pattern = 'none'", "there are no projectors"),
        (rig.turntable is not None, "a [turntable]", "its steps are of one part"),
        (mounted, "fixed devices", "all are sought anew"),
        (request.evaluates, "an evaluation", "it is of one mesh"),
        (
            request.cameras_by == "paper",
            "cameras_by = 'paper'",
            "that route follows one surface",
        ),
    )


def _refuse(*others: tuple[bool, str, str]) -> None:
    for asked, what, why in others:
        if asked:
            raise InputError(
                f"several meshes with {what}: {why}; leave it out, or plan one mesh"
            )
