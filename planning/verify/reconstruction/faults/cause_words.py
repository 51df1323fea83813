"""A diagnosis in a sentence, with sizes and an "as if"."""

import numpy as np
from scipy.spatial.transform import Rotation

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.scanner import Scanner

from .corrections import Device
from .diagnosis import Cause, Explanation
from .supposed import GRAZING

_MM = 1e3
# Turns below this aren't worth a word [rad].
_NO_TURN = np.deg2rad(0.005)
# An axis that passes the object by more than this share of its distance isn't aimed.
_MOST_ASIDE = 0.5


def in_words(cause: Cause, plan: Scanner) -> str:
    """Return what a cause looks like, and how far the edges were off their rings.

    Args:
        cause: The equally good explanations.
        plan: Whose devices it names.
    """
    looks = [_looks(explanation, plan) for explanation in cause.explanations]
    remaining = cause.explanations[0].remaining_m
    return (
        f"{' or '.join(looks)} (that takes the edges' mean distance from their rings "
        f"from {_MM * cause.before_m:.3f} to {_MM * remaining:.3f} mm)"
    )


def _looks(explanation: Explanation, plan: Scanner) -> str:
    correction = explanation.correction
    if correction.role is None:
        return _object_looks(explanation)
    devices = plan.cameras if correction.role == "cameras" else plan.projectors
    names = [devices[index].id for index in correction.devices]
    if correction.kind == "swap":
        return f"{' and '.join(names)} look swapped"
    index = correction.devices[0]
    before: Device = getattr(explanation.before, correction.role)[index]
    after: Device = getattr(explanation.after, correction.role)[index]
    if correction.kind == "focal":
        return f"{names[0]} looks as if {_focal(before, after)}"
    away = float(np.linalg.norm(explanation.before.body.centre - before.centre))
    looks = f"{names[0]} looks as if it {_displaced(before, after, away)}"
    if isinstance(before, ProjectorCalibration):
        assert isinstance(after, ProjectorCalibration)
        looks += _grazing(before, after, plan)
    if correction.role == "cameras":
        looks += _too_wide(names[0], after, plan)
    return looks


def _object_looks(explanation: Explanation) -> str:
    before, after = explanation.before.body, explanation.after.body
    change = after.scale / before.scale - 1.0
    turn = _angle(after.turn @ before.turn.T)
    shift = float(np.linalg.norm(after.shift - before.shift))
    words: list[str] = []
    if explanation.correction.kind != "moved":
        words.append(f"{_per_cent(change)} {'larger' if change > 0 else 'smaller'}")
    if explanation.correction.kind != "scale":
        words.append(f"moved by {_two_digits(_MM * shift)} mm")
        if turn > _NO_TURN:
            words.append(f"turned by {_two_digits(np.rad2deg(turn))} degrees")
    return f"the object looks {', '.join(words)} against the mesh"


def _focal(before: Device, after: Device) -> str:
    change = float(after.matrix[0, 0] / before.matrix[0, 0]) - 1.0
    longer = "longer" if change > 0.0 else "shorter"
    return f"its focal length were {_per_cent(change)} {longer}"


def _displaced(before: Device, after: Device, away: float) -> str:
    moved = float(np.linalg.norm(after.centre - before.centre))
    turns = after.world_from_device[:3, :3], before.world_from_device[:3, :3]
    angle = _angle(turns[0] @ turns[1].T)
    words: list[str] = []
    if angle > _NO_TURN:
        axes = (after.world_from_device[:3, 2], before.world_from_device[:3, 2])
        aside = away * _aside(*axes)
        least = "at least " * isinstance(before, ProjectorCalibration)
        turned = f"were turned by {least}{_two_digits(np.rad2deg(angle))} degrees"
        if aside < _MOST_ASIDE * away:
            turned += f" (aimed {_millimetres(aside)} off at the object)"
        words.append(turned)
    if moved > 0.0:
        words.append(f"stood {_millimetres(moved)} from its place")
    return " and ".join(words) or "were not moved"


def _grazing(
    before: ProjectorCalibration, after: ProjectorCalibration, plan: Scanner
) -> str:
    """Say at what angle the target is lit that the projector should serve.

    That is what it would meet more squarely than any other projector of the plan.
    """
    mesh, target = plan.mesh, plan.target
    middles, normals = mesh.face_centroids[target], mesh.face_normals[target]
    areas = mesh.face_areas[target]
    each = [one.incidence_cosine(middles, normals) for one in plan.projectors]
    planned = before.incidence_cosine(middles, normals)
    limit = np.cos(plan.limits.max_lit)
    assigned = (planned >= limit) & (planned >= np.max(each, axis=0))
    if not assigned.any():
        return ""
    lit = after.incidence_cosine(middles[assigned], normals[assigned])
    order = np.argsort(lit)
    share = np.cumsum(areas[assigned][order])
    half = np.searchsorted(share, 0.5 * share[-1])
    angle = float(np.arccos(np.clip(lit[order[half]], -1.0, 1.0)))
    if angle < GRAZING:
        return ""
    return (
        f", so that it meets the surface that it should serve at "
        f"{np.rad2deg(angle):.0f} degrees (median): grazing"
    )


def _millimetres(length: float) -> str:
    """Return a length in [m] in words."""
    return f"{_two_digits(_MM * length)} mm"


def _two_digits(value: float) -> str:
    """Return a number in words: two digits, whole from 10 on, never an exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def _too_wide(name: str, after: Device, plan: Scanner) -> str:
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


def _angle(turn: Array) -> float:
    return float(Rotation.from_matrix(turn).magnitude())


def _aside(one: Array, other: Array) -> float:
    """Tangent of the angle between two unit vectors."""
    return float(np.linalg.norm(np.cross(one, other)) / max(float(one @ other), 1e-3))


def _per_cent(change: float) -> str:
    return f"{_two_digits(100.0 * abs(change))} %"
