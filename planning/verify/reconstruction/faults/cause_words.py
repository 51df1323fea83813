"""A diagnosis in a sentence, with sizes and an "as if"."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    DeviceCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.scanner import Scanner

from .explanations import Cause, Explanation, Moves
from .supposed import GRAZING

_MM = 1e3
# Turns of the object below this aren't worth a word [rad].
_NO_TURN = np.deg2rad(0.005)
# An axis that passes the object by more than this share of its distance isn't aimed.
_MOST_ASIDE = 0.5
_Device = TypeVar("_Device", bound=DeviceCalibration)


def in_words(cause: Cause, plan: Scanner) -> str:
    """Return what a cause looks like, and how far the edges were off their rings."""
    before, remaining = cause[0].left_m
    return (
        f"{' or '.join(_looks(one, plan) for one in cause)} (that takes the edges' "
        f"mean distance from their rings from {_MM * before:.3f} to "
        f"{_MM * remaining:.3f} mm)"
    )


def _looks(explanation: Explanation, plan: Scanner) -> str:
    change = explanation.change
    states = explanation.before, explanation.after
    if change.role == "objects":
        return _object_looks(explanation)
    devices = plan.cameras if change.role == "cameras" else plan.projectors
    names = [devices[index].id for index in change.devices]
    if "swap" in change.moves:
        return f"{' and '.join(names)} look swapped"
    before, after = (getattr(s, change.role)[change.devices[0]] for s in states)
    if "zoom" in change.moves:
        by = float(after.matrix[0, 0] / before.matrix[0, 0]) - 1.0
        longer = "longer" if by > 0.0 else "shorter"
        return f"{names[0]} looks as if its focal length were {_per_cent(by)} {longer}"
    after = untwisted(before, after)
    away = float(np.linalg.norm(states[0].objects[0].centre - before.centre))
    looks = f"{names[0]} looks as if it {_displaced(change.moves, before, after, away)}"
    if change.role == "cameras":
        return looks + _too_wide(names[0], after, plan)
    return looks + _grazing(before, after, plan)


def _object_looks(explanation: Explanation) -> str:
    before, after = (rig.objects[0] for rig in (explanation.before, explanation.after))
    words: list[str] = []
    if "zoom" in explanation.change.moves:
        change = after.scale / before.scale - 1.0
        words.append(f"{_per_cent(change)} {'larger' if change > 0 else 'smaller'}")
    if "shift" in explanation.change.moves:
        shift = float(np.linalg.norm(after.centre - before.centre))
        words.append(f"moved by {_millimetres(shift)}")
    turn = _angle(before.world_from_device, after.world_from_device)
    if "turn" in explanation.change.moves and turn > _NO_TURN:
        words.append(f"turned by {_two_digits(np.rad2deg(turn))} degrees")
    return f"the object looks {', '.join(words)} against the mesh"


def _displaced(
    moves: Moves, before: DeviceCalibration, after: DeviceCalibration, away: float
) -> str:
    """Say what is to blame; what is as expected beside it isn't said."""
    poses = before.world_from_device, after.world_from_device
    words: list[str] = []
    if "turn" in moves:
        one, other = (pose[:3, 2] for pose in poses)
        cosine = max(float(one @ other), 1e-3)
        tangent = float(np.linalg.norm(np.cross(one, other))) / cosine
        least = "at least " * isinstance(before, ProjectorCalibration)
        angle = _two_digits(np.rad2deg(_angle(*poses)))
        turned = f"were turned by {least}{angle} degrees"
        if tangent < _MOST_ASIDE:
            turned += f" (aimed {_millimetres(away * tangent)} off at the object)"
        words.append(turned)
    if "shift" in moves:
        moved = float(np.linalg.norm(after.centre - before.centre))
        words.append(f"stood {_millimetres(moved)} from its place")
    return " and ".join(words)


def untwisted(before: _Device, after: _Device) -> _Device:
    """Return a projector with the least turn that draws its rings alike.

    A turn about the rings' axis leaves no trace: of the unit quaternion (v, w) of the
    whole turn it is that of the part (v.a, w) along the axis a.
    """
    if not isinstance(before, ProjectorCalibration):
        return after
    device_from_ring = np.linalg.inv(before.ring_from_device)
    turn = before.world_from_device[:3, :3].T @ after.world_from_device[:3, :3]
    *vector, scalar = Rotation.from_matrix(turn).as_quat()
    twist = 2.0 * np.arctan2(np.dot(vector, device_from_ring[:3, 2]), scalar)
    back = np.eye(4)
    back[:3, :3] = Rotation.from_rotvec([0.0, 0.0, -twist]).as_matrix()
    pose = after.world_from_device @ device_from_ring @ back @ before.ring_from_device
    return replace(after, world_from_device=pose)


def _grazing(
    before: ProjectorCalibration, after: ProjectorCalibration, plan: Scanner
) -> str:
    """Say at what angle the target is lit that the projector should serve.

    That is what it would meet more squarely than any other projector of the plan.
    """
    mesh, target = plan.mesh, plan.target
    middles, normals = mesh.face_centroids[target], mesh.face_normals[target]
    each = [one.incidence_cosine(middles, normals) for one in plan.projectors]
    planned = before.incidence_cosine(middles, normals)
    limit = np.cos(plan.limits.max_lit)
    assigned = (planned >= limit) & (planned >= np.max(each, axis=0))
    if not assigned.any():
        return ""
    lit = after.incidence_cosine(middles[assigned], normals[assigned])
    order = np.argsort(lit)
    area = np.cumsum(mesh.face_areas[target][assigned][order])
    median = lit[order[np.searchsorted(area, 0.5 * area[-1])]]
    angle = float(np.arccos(np.clip(median, -1.0, 1.0)))
    if angle < GRAZING:
        return ""
    return (
        f", so that it meets the surface that it should serve at "
        f"{np.rad2deg(angle):.0f} degrees (median): grazing"
    )


def _too_wide(name: str, after: DeviceCalibration, plan: Scanner) -> str:
    """Name a baseline of the plan that exceeds its limit with the camera so placed."""
    centres = {camera.id: camera.centre for camera in plan.cameras}
    for limit in plan.baselines:
        if name not in limit.cameras:
            continue
        (other,) = limit.cameras - {name}
        d = float(np.linalg.norm(after.centre - centres[other]))
        if limit.d < limit.d_max < d:
            return (
                f", which makes its baseline to {other} {_MM * d:.1f} mm: too wide, "
                f"eq. (10) allows {_MM * limit.d_max:.1f} mm"
            )
    return ""


def _angle(before: Array, after: Array) -> float:
    """Angle between two poses [rad]."""
    turn = after[:3, :3] @ before[:3, :3].T
    return float(Rotation.from_matrix(turn).magnitude())


def _millimetres(length: float) -> str:
    return f"{_two_digits(_MM * length)} mm"


def _per_cent(change: float) -> str:
    return f"{_two_digits(100.0 * abs(change))} %"


def _two_digits(value: float) -> str:
    """Return a number in words: two digits, whole from 10 on, never an exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"
