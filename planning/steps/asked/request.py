"""What is asked, of a surface whose long edges are cut."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.curvature.refinement import cut_for_curvature
from geometry.mesh.mesh import TriangleMesh
from planning.cache.cache import NO_CACHE, Cache
from planning.model.document.family_records import AlignedBy
from planning.model.errors import InputError
from planning.model.progress import Stopwatch
from planning.report.partial_plan import PlanRequest
from planning.rig.range_guard import Guard, guarded
from planning.rig.rig import Rig
from planning.rig.wishes import TargetName, Wishes
from planning.scene.interest import Select, Weight, interest_of
from planning.scene.ranges.ranged_body import RangedBody

from .family_request import check_members, family_of


def request_of(
    mesh: TriangleMesh | Sequence[TriangleMesh] | RangedBody,
    rig: Rig,
    wishes: Wishes,
    clock: Stopwatch,
    *,
    select: Select | None,
    weight: Weight | None,
    align: AlignedBy = "given",
    family_quantile: float = 1.0,
    cache: Cache = NO_CACHE,
) -> PlanRequest:
    """Return what is asked, of a surface whose long edges are cut.

    Limits of the rig are tightened by what isn't known of a body of ranges.

    Raises:
        InputError: If the target is none, or there is no mesh.
        InfeasibleLimitsError: If a body's ranges leave the limits no room.
    """
    selected = select is not None or weight is not None
    ranges: tuple[RangedBody, Guard] | None = None
    if isinstance(mesh, RangedBody):
        _check_single(rig)
        wishes = replace(wishes, target=_whole(wishes.target, selected))
        rig, guard = guarded(rig, mesh)
        mesh, ranges = mesh.mesh, (mesh, guard)
    if not isinstance(mesh, TriangleMesh) and len(mesh) > 1:
        family = family_of(mesh, align, family_quantile)
        check_members(wishes, selected=selected)
        wishes = replace(wishes, region_coverage=0.0)
        meshes = tuple(_cut(one, clock)[0] for one in family.meshes)
        family = replace(family, meshes=meshes)
        together = TriangleMesh.joined(meshes)
        return PlanRequest(together, rig, wishes, family=family, cache=cache)
    if family_quantile != 1.0 or align != "given":
        raise InputError(
            "align and family_quantile are of several meshes on one rig, and there is "
            "one: leave them out"
        )
    surface = _single(mesh)
    if wishes.target in ("surface", "outside") and selected:
        raise InputError(
            f"target = {wishes.target!r} and a selection both are targets: give one"
        )
    interest = interest_of(surface, select, weight)
    cut, parent = _cut(surface, clock)
    if interest is not None:
        interest = interest.on_parts(parent)
    return PlanRequest(cut, rig, wishes, interest=interest, ranges=ranges, cache=cache)


def _cut(
    surface: TriangleMesh, clock: Stopwatch
) -> tuple[TriangleMesh, NDArray[np.int64]]:
    """Return a surface whose long edges are cut, and the triangle each part is of.

    Planned and judged on places, not on whatever triangles a flat face came in.
    """
    cut, parent = cut_for_curvature(surface)
    if len(cut.faces) > len(surface.faces):
        clock.say(
            f"  long edges cut: {len(surface.faces):,} triangles become "
            f"{len(cut.faces):,}, the surface stays"
        )
    return cut, parent


def _check_single(rig: Rig) -> None:
    """Refuse several models for a body of which only ranges are known."""
    for kind in ("projector", "camera"):
        if (n := len(rig.models(kind))) > 1:
            raise InputError(
                f"rig {rig.name!r} has {n} models of {kind}s; for a body that is known "
                f"by its ranges alone what is kept free is of one: take one"
            )


def _whole(target: str | None, selected: bool) -> TargetName:
    """The target of a body of which only ranges are known: all of it."""
    if target not in (None, "surface") or selected:
        raise InputError(
            "of a body that is known by its ranges alone the target is the whole "
            "surface: it has no dominant region, no inside and no faces to select"
        )
    return "surface"


def _single(mesh: TriangleMesh | Sequence[TriangleMesh]) -> TriangleMesh:
    meshes = [mesh] if isinstance(mesh, TriangleMesh) else mesh
    if not meshes:
        raise InputError("no mesh: give one, or several for one rig")
    return meshes[0]
