"""All that a run has to say (`--verbose`); `brief` is what it says otherwise."""

from collections.abc import Sequence

import numpy as np

from geometry.mesh.extent import body_areas
from geometry.mesh.mesh import TriangleMesh
from planning.model.document.input_records import MeshRecord
from planning.model.plan import RigPlan
from planning.model.requirements import Workspace
from planning.model.words import labelled, percent
from planning.report.tolerance.joint_lines import joint_lines
from planning.report.tolerance.robust_lines import robust_lines
from planning.report.tolerance.survival_lines import survival_lines

from .check_lines import check_lines, cost_lines, unchecked
from .coverage_lines import coverage_lines, marginal_lines
from .devices.device_lines import (
    axis_name,
    device_lines,
    devices_words,
    mount_lines,
)
from .devices.station_lines import station_lines
from .light_lines import light_lines
from .proof_lines import proof_lines
from .ring_lines import code_lines, range_lines, ring_lines
from .warning_lines import warning_lines

# An object under this share of the field is taken to be in another unit.
_TINY = 0.1
# So many bodies are told one by one.
_MOST_BODIES = 4


def summary(plan: RigPlan, files: Sequence[str], missed: Sequence[str]) -> str:
    """Return the plan as text, in millimetres, degrees and square centimetres.

    Args:
        plan: The plan.
        files: Where it was written.
        missed: What `shortfalls` returned.
    """
    lines = [
        _head(plan),
        *device_lines(plan),
        *mount_lines(plan),
        *warning_lines(plan),
        *proof_lines(plan),
        *coverage_lines(plan),
        *light_lines(plan),
        *station_lines(plan),
        *survival_lines(plan),
        *joint_lines(plan),
        *robust_lines(plan),
        *range_lines(plan.document),
        *ring_lines(plan),
        *code_lines(plan),
        *(() if plan.document.evaluation else marginal_lines(plan)),
        *check_lines(plan),
        *(() if plan.document.evaluation else cost_lines(plan.document)),
        *(f"MISSED   {line}" for line in missed),
        *labelled("files", files),
    ]
    return "\n".join(lines)


def _head(plan: RigPlan) -> str:
    document, workspace = plan.document, plan.requirements.workspace
    mesh, evaluation = document.own_mesh, document.evaluation
    size = np.diff(plan.surface.mesh.bounds, axis=0)[0] * 1e3
    cut = "; TRUNCATED" if document.truncated else ""
    cut += f"; {unchecked(plan)}" if document.reconstruction is None else ""
    lost = lost_in_field(plan)
    cut += f"; WARNING: {lost}" if lost else ""
    words = body_words(plan.surface.mesh)
    bodies = f"         {words}\n" if words else ""
    return (
        f"{'AS BUILT' if evaluation else 'PLAN':<9}"
        f"{devices_words(plan, ', ')}"
        f"{f' of {evaluation.path}' if evaluation else ''} for "
        f"{mesh.path}{cut}\n"
        f"         {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm, "
        f"{_unit(mesh)}, up {axis_name(workspace.up)}; rig {document.rig.name}, "
        f"{'cameras alone' if plan.cameras_alone else f'{document.rig.light} light'}\n"
        f"{''.join(_assumed(document.assumed))}"
        f"{shell_line(mesh)}"
        f"{bodies}"
        f"         devices may stand in {_where(workspace)}"
    )


def _assumed(sentences: Sequence[str]) -> list[str]:
    return [f"         assumed: {words}\n" for words in sentences]


def lost_in_field(plan: RigPlan) -> str:
    """Return a warning where the object is tiny in a camera's field: a wrong unit?"""
    standoff = plan.document.rig.standoff_m
    if standoff is None or not plan.cameras:
        return ""
    across = 2.0 * plan.requirements.workspace.object_radius_m
    field = 2.0 * float(plan.cameras[0].device.half_rectangle(standoff).min())
    if not across < _TINY * field:
        return ""
    return (
        f"the object is {1e3 * across:.3g} mm across in a camera's field of "
        f"{1e3 * field:.0f} mm, is its unit right?"
    )


def body_words(mesh: TriangleMesh) -> str:
    """Return how many bodies a mesh has, with their shares; nothing of a single one."""
    areas = body_areas(mesh.faces, mesh.face_areas)
    if len(areas) == 1:
        return ""
    shares = [percent(area / mesh.area) for area in areas[:_MOST_BODIES]]
    more = ", ..." if len(areas) > _MOST_BODIES else ""
    return (
        f"{len(areas)} bodies that share no vertex, of {', '.join(shares)}{more} of "
        f"the area"
    )


def shell_line(mesh: MeshRecord) -> str:
    """Return what kind of body a mesh of the plan is, as a line; none for a solid."""
    shell = mesh.shell
    if shell.kind == "solid":
        return ""
    if shell.wall_m is None:
        return f"         {shell.kind}\n"
    sealed = shell.sealed_m2 / mesh.area_m2
    closed = f", {percent(sealed)} in sealed cavities" if sealed > 5e-4 else ""
    inside = percent(shell.inside_m2 / mesh.area_m2)
    return (
        f"         {shell.kind}, wall about {1e3 * shell.wall_m:.2g} mm; {inside} of "
        f"the surface lies inside{closed}\n"
    )


def _where(workspace: Workspace) -> str:
    """Where devices may stand, by what the workspace leaves of the shell."""
    phrases: list[str] = []
    if workspace.half_angle < np.pi:
        x, y, z = workspace.axis
        phrases.append(
            f"within {np.degrees(workspace.half_angle):.0f} degrees of the axis "
            f"({x:.3g}, {y:.3g}, {z:.3g}) from its centre"
        )
    if workspace.floor_m is not None:
        phrases.append(f"at least {1e3 * workspace.floor_m:.0f} mm above its centre")
    if workspace.box is not None:
        size = " x ".join(f"{2e3 * half:.0f}" for half in workspace.box.half_m)
        phrases.append(f"in a box of {size} mm")
    if workspace.mounting:
        names = [plane.name for plane in workspace.mounting]
        phrases.append(f"on {' or '.join(names)}")
    if workspace.keep_out:
        phrases.append(
            f"not in {' or '.join(zone.name for zone in workspace.keep_out)}"
        )
    if not phrases:
        return "the whole shell about it (no floor)"
    return f"the shell about it, {', '.join(phrases)}"


def _unit(mesh: MeshRecord) -> str:
    if mesh.unit == "size_mm":
        return f"scaled to that size ({1e3 * mesh.scale_to_m:.6g} mm a file unit)"
    return f"unit {mesh.unit}"
