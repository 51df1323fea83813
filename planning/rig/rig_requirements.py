"""The limits of a rig file and the wishes of a user, turned into requirements."""

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar, cast, get_args

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.calibration_errors import AS_PLANNED, Survival
from planning.model.errors import InfeasibleLimitsError, InputError
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.light.light_budget import LightBudget
from planning.model.requirements import (
    CameraLimits,
    CheckLimits,
    ProjectorLimits,
    Requirements,
    TriangulationLimits,
    Workspace,
)
from planning.model.table_types import LARGEST
from planning.scene.workspace.zone_conflicts import check_zones

from .rig_tables import LimitsTable, RequirementsTable, RigTable
from .wishes import MOST_VIEWS, Pattern, TargetName, Wishes, check_counts, views_alone

_Limits = TypeVar("_Limits", ProjectorLimits, CameraLimits, TriangulationLimits)

_WARN_INCIDENCE_DEG = 70.0
# Triangulation angles where a rig states none: errors grow as 1 / sin beyond [rad].
# Of cameras alone images differ too much to be matched, docs/method/photogrammetry.md.
_ANGLES = (math.radians(10.0), math.radians(90.0))
_ANGLES_OF_VIEWS = (math.radians(10.0), math.radians(60.0))

_UP_VECTORS = {
    **{"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)},
    **{"-x": (-1.0, 0.0, 0.0), "-y": (0.0, -1.0, 0.0), "-z": (0.0, 0.0, -1.0)},
}


def build_requirements(
    table: RigTable,
    wishes: Wishes,
    workspace: Workspace,
    *,
    tau_m: float,
    drawn_edges: DrawnEdges,
    light: LightBudget | None = None,
) -> Requirements:
    """Return what a plan in a workspace must reach, its edges drawn and lit so.

    Raises:
        InputError: If an argument isn't usable.
    """
    shares = table.requirements
    target = wishes.target or "dominant"
    _check_choice("target", target, get_args(TargetName))
    _check_choice("pattern", wishes.pattern, ("rings", "dense", "none"))
    check_counts(wishes)
    alone = wishes.pattern == "none"
    _check_positive("tau_m", tau_m)
    _check_choice("accuracy_of", wishes.accuracy_of, ("noise", "total"))
    triangulation = _limits_of(
        TriangulationLimits,
        table.limits,
        calibration=table.calibration.errors(),
        accuracy_of=wishes.accuracy_of,
        drawn_edges=drawn_edges,
        light=light,
    )
    triangulation = _of_pattern(triangulation, wishes.pattern)
    if wishes.robust is not None:
        _check_drawn(table, wishes.robust)
    if wishes.accuracy_mm is not None:
        _check_positive("accuracy_mm", wishes.accuracy_mm)
        triangulation = replace(triangulation, max_sigma_m=wishes.accuracy_mm * 1e-3)
    coarse = {} if wishes.pattern == "dense" else {"max_sample_distance_m": None}
    checked: dict[str, Any] = {
        key.replace("_mm", "_m"): _si(key, value)
        for key, value in table.check.model_dump().items()
    }
    return Requirements(
        max_projectors=wishes.max_projectors,
        max_cameras=wishes.max_cameras,
        coverage=_share("coverage", wishes, shares),
        dominant_coverage=_share("dominant_coverage", wishes, shares),
        min_reachable=_share("min_reachable", wishes, shares),
        target=target,
        pattern=wishes.pattern,
        projector=_limits_of(ProjectorLimits, table.limits, "projector_", **coarse),
        camera=_limits_of(CameraLimits, table.limits, "camera_"),
        triangulation=triangulation,
        check=CheckLimits(**checked, tau_m=tau_m),
        workspace=workspace,
        region_coverage=_share("region_coverage", wishes, shares, or_none=True),
        region_share=shares.region_share,
        survival=None if alone else _survival(wishes),
        min_views=views_alone(wishes) if alone else None,
    )


def _of_pattern(limits: TriangulationLimits, pattern: Pattern) -> TriangulationLimits:
    """Return the limits that a pattern has: angles, or those of rings."""
    if pattern == "rings":
        return replace(limits, min_angle=None, max_angle=None)
    low, high = limits.min_angle, limits.max_angle
    least, most = _ANGLES_OF_VIEWS if pattern == "none" else _ANGLES
    if pattern == "none":
        # Nothing is drawn, and no projector's light is counted.
        limits = replace(limits, drawn_edges=None, light=None)
    return replace(
        limits,
        min_conditioning=0.0,
        min_ring_pitch_px=None,
        ring_sigma_m=None,
        min_angle=least if low is None else low,
        max_angle=most if high is None else high,
    )


def limit_notes(limits: LimitsTable) -> tuple[str, ...]:
    """Return what a user should know of limits, a sentence each."""
    theta, tau = limits.projector_max_incidence_deg, limits.min_tangent_angle_deg
    sentences: list[str] = []
    if tau <= 90.0 - theta:
        sentences.append(
            f"the tangent limit of {tau:g} degrees doesn't bind: at an incidence "
            f"of {theta:g} degrees or less the angle is {90.0 - theta:g} or more"
        )
    if theta > _WARN_INCIDENCE_DEG:
        sentences.append(
            f"projector incidence up to {theta:g} degrees: errors triple at 75, "
            f"and at 84 only 0.6 of the surface is measured"
        )
    return tuple(sentences)


def _survival(wishes: Wishes) -> Survival | None:
    """Return what is asked beyond one pair; None: nothing.

    Raises:
        InputError: If it can't be asked, or not together with something else.
    """
    views, survive = wishes.views or 1, wishes.survive
    if not 1 <= views <= MOST_VIEWS:
        raise InputError(f"views = {views} must be from 1 to {MOST_VIEWS}")
    if survive not in (0, 1):
        raise InputError(f"survive = {survive} must be 0 or 1")
    asked = Survival(views, survive)
    if not asked.asks:
        return None
    if wishes.robust is not None:
        raise InputError(
            f"robust = {wishes.robust:g} with views = {views}, survive = {survive}: "
            f"rigs are drawn for plans that measure once; ask for one of them"
        )
    return asked


def _check_drawn(table: RigTable, quantile: float) -> None:
    """Refuse to draw rigs of which nothing is stated, or all but an impossible share.

    Raises:
        InputError: It says what to write.
    """
    if not 0.0 < quantile < 1.0:
        raise InputError(f"robust = {quantile:g} must lie over 0 and below 1")
    if table.calibration.errors() is None and table.mounting.bounds() == AS_PLANNED:
        raise InputError(
            f"robust = {quantile:g}: rig {table.name} states neither [calibration] nor "
            f"[mounting], so that drawn rigs would all be as planned; write one of them"
        )


def build_workspace(
    table: RigTable,
    reference_ring_radius: float,
    mesh_centre: Sequence[float] | NDArray[np.float64],
    object_radius_m: float,
    up: str | None,
    overflowing: tuple[bool, bool],
) -> Workspace:
    """Return where devices may stand about an object.

    The standoff s is counted to the surface, play p either way, so that with object
    radius R both kinds of device keep::

        s + R - p <= |Q - centre| <= s + R + p

    Over an object that is wider than their field they are tiled, s from
    the part of it that they look at, which may be as near to the centre as it likes::

        s - p <= |Q - centre| <= s + R + p

    `overflowing` says whether it is wider than that of projectors, and of cameras.

    Raises:
        InputError: If an argument isn't usable.
        InfeasibleLimitsError: If no position in the workspace is admissible.
    """
    _check_positive("object_radius_m", object_radius_m)
    placement, spec = table.placement, table.workspace
    _check_choice("up", up or spec.up, tuple(_UP_VECTORS))
    up_vector = _UP_VECTORS[up or spec.up]
    axis = np.array(spec.axis or up_vector, dtype=np.float64)
    axis /= np.linalg.norm(axis)
    standoff = placement.standoff_mm * 1e-3
    middle = standoff + float(object_radius_m)
    play = placement.standoff_play_mm * 1e-3
    projector, camera = (
        (standoff - play if wide else middle - play, middle + play)
        for wide in overflowing
    )
    workspace = Workspace(
        centre=_three("mesh_centre", mesh_centre),
        object_radius_m=float(object_radius_m),
        up=up_vector,
        axis=_three("axis", axis),
        half_angle=math.radians(spec.half_angle_deg or 180.0),
        projector_radius_m=projector,
        camera_radius_m=camera,
        floor_m=None if spec.floor_mm is None else spec.floor_mm * 1e-3,
        n_reference_projectors=placement.n_reference_projectors,
        n_reference_cameras=placement.n_reference_cameras,
        reference_ring_radius=reference_ring_radius,
        projector_standoff_m=standoff if overflowing[0] else None,
        camera_standoff_m=standoff if overflowing[1] else None,
        clearance_m=placement.clearance_mm * 1e-3,
        origin="mesh" if spec.origin == "mesh" else None,
        **spec.zones(up_vector),
    )
    if workspace.origin is not None:
        x, y, z = workspace.centre
        workspace = workspace.moved((-x, -y, -z))
    _check_floor(workspace)
    check_zones(workspace)
    return workspace


def _check_floor(workspace: Workspace) -> None:
    """Refuse a floor above the highest position of shell and cone."""
    if workspace.floor_m is None:
        return
    cosine = float(np.clip(np.dot(workspace.axis, workspace.up), -1.0, 1.0))
    off_up = max(0.0, math.acos(cosine) - workspace.half_angle)
    near, far = workspace.projector_radius_m
    highest = math.cos(off_up) * (far if off_up < 0.5 * math.pi else near)
    written = workspace.written.floor_m or 0.0
    if not highest >= workspace.floor_m:
        raise InfeasibleLimitsError(
            f"workspace.floor_mm = {written * 1e3:g} lies above the highest "
            f"position that shell and cone allow, {highest * 1e3:.0f} mm over the "
            f"object's centre; lower the floor or widen the cone"
        )


def _limits_of(
    kind: type[_Limits], table: LimitsTable, device: str = "", **given: object
) -> _Limits:
    """Return limits by their names: `x_m` is `x_mm` of the table, an angle `x_deg`."""
    written = table.model_dump()
    values: dict[str, Any] = dict(given)
    for field in fields(kind):
        if field.name in given:
            continue
        stem = field.name.removesuffix("_m")
        keys = (field.name, f"{stem}_mm", f"{stem}_deg", f"{device}{stem}_deg")
        key = next(key for key in keys if key in written)
        values[field.name] = _si(key, written[key])
    return kind(**values)


def _si(key: str, value: float | None) -> float | None:
    """Return a value of a rig file in metres or radians, as its key says."""
    if value is None:
        return None
    if key.endswith("_deg"):
        return math.radians(value)
    return value * 1e-3 if key.endswith("_mm") else value


def _three(
    name: str, vector: Sequence[float] | NDArray[np.float64]
) -> tuple[float, float, float]:
    values = np.asarray(vector, dtype=np.float64)
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise InputError(f"{name} must be three finite numbers, got {vector}")
    return cast(tuple[float, float, float], tuple(values.tolist()))


def _check_choice(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"{name} = {value!r} must be one of {', '.join(known)}")


def _check_positive(name: str, value: float) -> None:
    if not 0.0 < value <= LARGEST:
        raise InputError(f"{name} = {value} must be over 0 and {LARGEST:g} at most")


def _share(
    name: str, wishes: Wishes, table: RequirementsTable, *, or_none: bool = False
) -> float:
    """Return a share that is asked for, else the rig's; perhaps 0."""
    asked = getattr(wishes, name)
    share = float(getattr(table, name) if asked is None else asked)
    if not (0.0 < share <= 1.0 or (or_none and share == 0.0)):
        least = "0 or more" if or_none else "over 0"
        raise InputError(f"{name} = {share} must be a share, {least} and at most 1")
    return share
