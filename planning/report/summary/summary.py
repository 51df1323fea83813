"""The result that a person reads in ten seconds."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from planning.model.document.coverage_records import (
    Areas,
    CameraMarginal,
    ProjectorMarginal,
)
from planning.model.document.input_records import MeshRecord, SelectionRecord
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Workspace
from planning.model.words import percent
from planning.report.entries.cost import cost_lines
from planning.report.entries.exposure import schedule_line
from planning.report.entries.range_entries import summary_lines
from planning.report.entries.ring_entries import rings_lines

from .check_lines import check_lines
from .proof_lines import proof_lines
from .shortfall import causes_line

_AXES = "xyz"
# Surfaces below this are told in mm² [m²].
_SMALL_M2 = 1e-3


def summary(plan: RigPlan, files: Sequence[str], missed: Sequence[str]) -> str:
    """Return the plan as text, in millimetres, degrees and square centimetres.

    Args:
        plan: The plan.
        files: Where it was written.
        missed: What `shortfalls` returned.
    """
    parts = [
        _head(plan),
        _devices(plan),
        proof_lines(plan, _regions(plan)),
        _coverage(plan),
        *_ranges(plan),
        *_rings(plan),
        _marginal(plan),
        check_lines(plan),
        *cost_lines(plan.document.cost),
        *(f"MISSED   {line}" for line in missed),
        *(f"files    {name}" for name in files[:1]),
        *(f"         {name}" for name in files[1:]),
    ]
    return "\n".join(parts)


def _head(plan: RigPlan) -> str:
    document, workspace = plan.document, plan.requirements.workspace
    mesh = document.meshes[0]
    size = np.diff(plan.surface.mesh.bounds, axis=0)[0] * 1e3
    cut = "; TRUNCATED, not the best that could be found" if document.truncated else ""
    where = _where(workspace)
    return (
        f"PLAN     {_number(plan.projectors, 'projector')}, "
        f"{_number(plan.cameras, 'camera')} for "
        f"{mesh.path}{cut}\n"
        f"         {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm, "
        f"{_unit(mesh)}, up {_axis(workspace.up)}; rig {document.rig.name}, "
        f"{document.rig.light} light\n"
        f"{shell_line(mesh)}"
        f"         devices may stand in {where}"
    )


def shell_line(mesh: MeshRecord) -> str:
    """Return what kind of body a mesh of the plan is, as a line; none for a solid."""
    shell = mesh.shell
    if shell.kind == "solid":
        return ""
    if shell.wall_m is None:
        return f"         {shell.kind}\n"
    share = 100.0 * shell.inside_m2 / mesh.area_m2
    sealed = 100.0 * shell.sealed_m2 / mesh.area_m2
    closed = f", {sealed:.1f} % in sealed cavities" if sealed > 0.05 else ""
    return (
        f"         {shell.kind}, wall about {1e3 * shell.wall_m:.2g} mm; "
        f"{share:.1f} % of the surface lies inside{closed}\n"
    )


def _number(devices: Sequence[object], name: str) -> str:
    return f"{len(devices)} {name}{'s' * (len(devices) != 1)}"


def _where(workspace: Workspace) -> str:
    zones = zone_phrases(workspace)
    if workspace.half_angle >= np.pi and workspace.floor_m is None and not zones:
        return "the whole shell about it (no floor)"
    parts: list[str] = []
    if workspace.half_angle < np.pi:
        x, y, z = workspace.axis
        parts.append(
            f"within {np.degrees(workspace.half_angle):.0f} degrees of the axis "
            f"({x:.3g}, {y:.3g}, {z:.3g}) from its centre"
        )
    if workspace.floor_m is not None:
        parts.append(f"at least {1e3 * workspace.floor_m:.0f} mm above its centre")
    return f"the shell about it, {', '.join(parts + zones)}"


def zone_phrases(workspace: Workspace) -> list[str]:
    """Return what a box, keep-out volumes and mounting planes leave, a phrase each."""
    found: list[str] = []
    if workspace.box is not None:
        size = " x ".join(f"{2e3 * half:.0f}" for half in workspace.box.half_m)
        found.append(f"in a box of {size} mm")
    if workspace.mounting:
        names = [plane.name for plane in workspace.mounting]
        found.append(f"on {' or '.join(names)}")
    if workspace.keep_out:
        found.append(f"not in {' or '.join(zone.name for zone in workspace.keep_out)}")
    return found


def _unit(mesh: MeshRecord) -> str:
    if mesh.unit == "size_mm":
        return f"scaled to that size ({1e3 * mesh.scale_to_m:.6g} mm a file unit)"
    return f"unit {mesh.unit}"


def _axis(up: Sequence[float]) -> str:
    index = int(np.argmax(np.abs(up)))
    return f"{'-' if up[index] < 0 else '+'}{_AXES[index]}"


def _devices(plan: RigPlan) -> str:
    lines = [
        "\n     position x, y, z [mm]            image centre aims along         roll"
        "   standoff",
        "                                      azimuth   elevation [deg]     [deg]   "
        "to centre [mm]",
    ]
    centre = np.array(plan.requirements.workspace.centre)
    up = np.array(plan.requirements.workspace.up)
    for device in (*plan.projectors, *plan.cameras):
        position = device.world_from_device[:3, 3]
        azimuth, elevation, roll = aim_angles(device, up)
        x, y, z = 1e3 * position
        distance = 1e3 * np.linalg.norm(position - centre)
        lines.append(
            f"{device.id:<4} {x:9.1f} {y:9.1f} {z:9.1f}    {azimuth:12.1f} "
            f"{elevation:10.1f}   {roll:12.1f}   {distance:10.1f}"
            + (f"   existing: {device.existing}" if device.existing else "")
        )
    k = int(np.argmax(np.abs(up)))
    lines.append(
        f"     azimuth counts about {_axis(tuple(up))} from +{_AXES[(k + 1) % 3]}; the "
        f"axes are those of the mesh file"
    )
    return "\n".join(lines)


def aim_angles(
    device: PlannedProjector | PlannedCamera, up: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return azimuth, elevation and roll of a device in degrees.

    Azimuth counts about `up` from the first world axis that isn't along it towards
    the next (x towards y for up z); elevation is the angle above the horizontal; roll
    turns the image clockwise as the device sees it, 0 with the image upright.
    """
    pose = device.world_from_device
    axis = _middle(device)
    k = int(np.argmax(np.abs(up)))
    e1 = np.eye(3)[(k + 1) % 3]
    e2 = np.cross(up, e1)
    azimuth = np.degrees(np.arctan2(axis @ e2, axis @ e1))
    elevation = np.degrees(np.arcsin(np.clip(axis @ up, -1.0, 1.0)))
    level = np.cross(axis, up)
    if np.linalg.norm(level) < 1e-6:
        return float(azimuth), float(elevation), 0.0
    level /= np.linalg.norm(level)
    roll = np.arctan2(pose[:3, 0] @ np.cross(axis, level), pose[:3, 0] @ level)
    return float(azimuth), float(elevation), float(np.degrees(roll)) + 0.0


def _middle(device: PlannedProjector | PlannedCamera) -> NDArray[np.float64]:
    return device.world_from_device[:3, :3] @ device.device.middle_ray


def _coverage(plan: RigPlan) -> str:
    coverage = plan.coverage
    target, surface = coverage.target, coverage.surface
    labels = (
        "area",
        "reachable by projectors",
        "lit",
        "reachable by cameras",
        "measured",
    )
    cells = zip(labels, _cells(target), _cells(surface), strict=True)
    name = _target_name(plan)
    lines = [
        f"\n{'':<9}{'':<25}{'target (' + name + ')':>24}{'whole surface':>24}",
        *(
            f"{'':<9}{label:<25}{of_target:>24}{of_surface:>24}"
            for label, of_target, of_surface in cells
        ),
    ]
    lit = _ratio(target.lit_m2, target.reachable_by_projectors_m2)
    measured = _ratio(target.measured_m2, target.reachable_by_cameras_m2)
    lines.append(
        f"COVERAGE lit / reachable by projectors {lit}, measured / reachable by "
        f"cameras {measured}, on the target, {coverage.samples} fresh samples"
    )
    left = coverage.uncovered_by_cause
    if left:
        lines.append(f"         not measured: {causes_line(left, target.area_m2)}")
    idle = {c.id for c in plan.document.cameras if c.seen_area_m2 == 0.0}
    groups = [g for g in plan.document.camera_groups if not idle.issuperset(g)]
    if len(groups) > 1:
        names = ", ".join("{" + " ".join(group) + "}" for group in groups)
        lines.append(
            f"         the parts of {names} don't overlap: register them by the "
            f"calibrated poses, not by the surface"
        )
    areas = (
        *(("lights", p.id, p.lit_area_m2) for p in plan.document.projectors),
        *(("measures", c.id, c.seen_area_m2) for c in plan.document.cameras),
    )
    lines += [
        f"         {name} {does} none of the target"
        for does, name, area in areas
        if area == 0.0
    ]
    if firing := schedule_line(plan.document):
        lines.append(firing)
    return "\n".join(lines)


def _target_name(plan: RigPlan) -> str:
    return "your selection" if _own(plan) else plan.requirements.target


def _regions(plan: RigPlan) -> str:
    """Return how many regions there are, and what chose their faces."""
    regions = plan.document.regions
    many = f"region{'s' * (len(regions) != 1)}"
    own = _own(plan)
    if own is None:
        return f"{len(regions)} dominant {many}"
    by = "highest weight" if own.kind == "vertex_weight" else "selection"
    source = f" by {own.source}" if own.source else ""
    removed = own.n_removed_by_repair
    gone = f" ({removed} chosen ones removed by repair)" if removed else ""
    return f"{len(regions)} {many} of your {by}{source}: {own.n_faces} faces{gone}"


def _own(plan: RigPlan) -> SelectionRecord | None:
    """Return `surface.selection` if the user made it; older plans have none."""
    selection = plan.document.surface.selection
    return None if selection is None or selection.kind == "curvature" else selection


def _cells(areas: Areas) -> list[str]:
    parts = (
        areas.area_m2,
        areas.reachable_by_projectors_m2,
        areas.lit_m2,
        areas.reachable_by_cameras_m2,
        areas.measured_m2,
    )
    return [_cell(part, areas.area_m2) for part in parts]


def _cell(area_m2: float, whole_m2: float) -> str:
    share = 100.0 * area_m2 / whole_m2
    area, unit = 1e4 * area_m2, "cm²"
    if whole_m2 < _SMALL_M2:
        area, unit = 1e6 * area_m2, "mm²"
    return f"{area:9.1f} {unit} {share:6.1f} %"


def _ratio(part: float, whole: float) -> str:
    return percent(part / whole) if whole > 0 else "undefined"


def _ranges(plan: RigPlan) -> list[str]:
    lines = summary_lines(plan.document)
    return ["\n" + "\n".join(lines)] if lines else []


def _rings(plan: RigPlan) -> list[str]:
    lines = rings_lines(plan)
    return ["\n" + "\n".join(lines)] if lines else []


def _marginal(plan: RigPlan) -> str:
    rows = plan.document.marginal
    lit = {
        row.n_projectors: row.lit_target_m2
        for row in rows
        if isinstance(row, ProjectorMarginal)
    }
    measured = {
        row.n_cameras: row.measured_target_m2
        for row in rows
        if isinstance(row, CameraMarginal)
    }
    return "\n".join(
        (
            "\nMARGINAL what one more or fewer would change (* as planned)",
            _counted("projectors", "lit", lit, len(plan.projectors), plan),
            _counted("cameras", "measured", measured, len(plan.cameras), plan),
        )
    )


def _counted(
    kind: str, verb: str, areas: Mapping[int, float], planned: int, plan: RigPlan
) -> str:
    whole = plan.coverage.target.area_m2
    cells = [
        f"{n}{'*' if n == planned else ''}: {percent(area / whole)}"
        for n, area in areas.items()
    ]
    return f"         {kind:<10} {verb} of the target   {'   '.join(cells)}"
