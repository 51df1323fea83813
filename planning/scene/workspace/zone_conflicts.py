"""Which limit is to blame where zones and shell leave devices no place to stand."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.bodies import Box
from planning.model.errors import InfeasibleLimitsError
from planning.model.requirements import Workspace

from .admissible import is_zoned
from .shell_positions import shell_positions

# Positions looked for before a workspace counts as empty.
_LOOKED_FOR = 2000


def check_zones(workspace: Workspace) -> None:
    """Refuse a box or mounting planes that the shell or the floor doesn't meet.

    Raises:
        InfeasibleLimitsError: It names the limit, its value and what to do.
    """
    if workspace.box is not None:
        fault = _out_of_reach(workspace.box, workspace)
        if fault is not None:
            low, high = _corners(workspace)
            raise InfeasibleLimitsError(
                f"workspace.min_mm = {low} and max_mm = {high}: {fault}"
            )
    written = workspace.written.mounting
    faults = [
        f"workspace.mounting {plane.name!r} at {_mm(there.centre_m)} mm: {fault}"
        for plane, there in zip(workspace.mounting, written, strict=True)
        if (fault := _out_of_reach(plane, workspace)) is not None
    ]
    if faults and len(faults) == len(workspace.mounting):
        raise InfeasibleLimitsError("\n".join(faults))


def no_position(workspace: Workspace, radius_m: tuple[float, float]) -> str:
    """Return why the workspace holds no position: each limit that is to blame alone."""
    if not is_zoned(workspace):
        return (
            "the workspace holds no position: its floor, cone and shell exclude each "
            "other; lower the floor or widen the cone"
        )
    limits = _limits(workspace)
    guilty = [
        text
        for text, less in limits
        if len(shell_positions(less, radius_m, _LOOKED_FOR))
    ]
    named = guilty or [text for text, _ in limits]
    only = "without it there would be" if guilty else "each excludes the rest"
    low, high = (f"{1e3 * radius:.0f}" for radius in radius_m)
    return (
        f"no position {low} to {high} mm from the object's centre (standoff_mm with "
        f"its play, and the object's radius) is left by {', '.join(named)}; {only}"
    )


def _limits(workspace: Workspace) -> list[tuple[str, Workspace]]:
    """Every limit with its value and a remedy, and the workspace without it."""
    blamed: list[tuple[str, Workspace]] = []

    def blame(text: str, without: Workspace) -> None:
        blamed.append((f"workspace.{text}", without))

    for k, zone in enumerate(workspace.written.keep_out):
        size = " x ".join(f"{2e3 * half:g}" for half in zone.half_m)
        rest = workspace.keep_out[:k] + workspace.keep_out[k + 1 :]
        blame(
            f"keep_out {zone.name!r} ({size} mm about {_mm(zone.centre_m)} mm; make "
            f"it smaller or move it)",
            replace(workspace, keep_out=rest),
        )
    if workspace.box is not None:
        low, high = _corners(workspace)
        text = f"min_mm = {low}, max_mm = {high} (widen it)"
        blame(text, replace(workspace, box=None))
    if workspace.mounting:
        names = " and ".join(repr(plane.name) for plane in workspace.mounting)
        text = f"mounting {names} (move or extend it)"
        blame(text, replace(workspace, mounting=()))
    if workspace.floor_m is not None:
        text = f"floor_mm = {_floor_mm(workspace):g} (lower it)"
        blame(text, replace(workspace, floor_m=None))
    if workspace.half_angle < np.pi:
        degrees = np.degrees(workspace.half_angle)
        text = f"half_angle_deg = {degrees:g} (widen it)"
        blame(text, replace(workspace, half_angle=float(np.pi)))
    return blamed


def _out_of_reach(box: Box, workspace: Workspace) -> str | None:
    """Say how a box misses the shell or the floor; None if it may meet both."""
    low, high = workspace.projector_radius_m
    local, half = np.abs(np.array(box.axes) @ np.array(box.centre_m)), box.half_m
    near = np.linalg.norm(np.maximum(local - half, 0.0))
    far = np.linalg.norm(local + half)
    begins, ends = f"{1e3 * near:.0f} mm", f"{1e3 * far:.0f} mm"
    ball = f" + the object's radius of {1e3 * workspace.object_radius_m:.0f}"
    # Side by side, devices stand that near to any part.
    inner = ball if workspace.projector_standoff_m is None else ""
    if far < low:
        return (
            f"it ends {ends} from the object's centre, but devices stand at least "
            f"{1e3 * low:.0f} mm from there (standoff_mm - standoff_play_mm{inner}); "
            f"make it reach farther or lower placement.standoff_mm"
        )
    if near > high:
        return (
            f"it begins {begins} from the object's centre, but devices stand at most "
            f"{1e3 * high:.0f} mm from there (standoff_mm + standoff_play_mm{ball}); "
            f"move it nearer or raise placement.standoff_mm"
        )
    top = np.array(workspace.up) @ np.array(box.centre_m) + float(
        np.abs(np.array(box.axes) @ np.array(workspace.up)) @ np.array(box.half_m)
    )
    if workspace.floor_m is not None and not top >= workspace.floor_m:
        return (
            f"it ends {1e3 * top:.0f} mm over the object's centre, under "
            f"workspace.floor_mm = {_floor_mm(workspace):g}; lower the floor or "
            f"raise it"
        )
    return None


def _corners(workspace: Workspace) -> list[str]:
    """The corners of the room, as written."""
    box = workspace.written.box
    if box is None:
        return []
    middle, half = np.array(box.centre_m), np.array(box.half_m)
    return [_mm(middle + side * half) for side in (-1, 1)]


def _floor_mm(workspace: Workspace) -> float:
    return 1e3 * (workspace.written.floor_m or 0.0)


def _mm(lengths_m: NDArray[np.float64] | tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{1e3 * length:g}" for length in lengths_m) + "]"
