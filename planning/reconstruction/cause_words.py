"""A diagnosis in a sentence, with sizes and an "as if"."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..plan import RigPlan
from .corrections import Device
from .diagnosis import Cause, Explanation

_MM = 1e3
# Incidence of light beyond which edges smear: formulation.md section 2 [rad].
GRAZING = np.deg2rad(70.0)
# Turns below this aren't worth a word [rad].
_NO_TURN = np.deg2rad(0.005)


def in_words(cause: Cause, plan: RigPlan) -> str:
    """Return what a cause looks like, and how far the edges were off their rings.

    Args:
        cause: The equally good explanations.
        plan: Whose devices it names.
    """
    looks = [_looks(explanation, plan) for explanation in cause.explanations]
    left = cause.explanations[0].left_m
    return (
        f"{' or '.join(looks)} (that takes the edges' mean distance from their rings "
        f"from {_MM * cause.before_m:.3f} to {_MM * left:.3f} mm)"
    )


def _looks(explanation: Explanation, plan: RigPlan) -> str:
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
    if correction.role == "projectors" and explanation.cosine < np.cos(GRAZING):
        degrees = np.rad2deg(np.arccos(explanation.cosine))
        looks += f", its light grazing the surface at {degrees:.0f} degrees (median)"
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
        words.append(f"moved by {_MM * shift:.2g} mm")
        if turn > _NO_TURN:
            words.append(f"turned by {np.rad2deg(turn):.2g} degrees")
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
        words.append(
            f"were turned by {np.rad2deg(angle):.2g} degrees "
            f"(aimed {_MM * aside:.2g} mm off at the object)"
        )
    if moved > 0.0:
        words.append(f"stood {_MM * moved:.3g} mm from its place")
    return " and ".join(words) or "were not moved"


def _too_wide(name: str, after: Device, plan: RigPlan) -> str:
    """Name a baseline of the plan that exceeds its limit with the camera so placed."""
    centres = {c.id: c.world_from_device[:3, 3] for c in plan.cameras}
    for row in plan.document.get("baselines", ()):
        if name not in row["cameras"] or row["d_max"] is None:
            continue
        (other,) = (one for one in row["cameras"] if one != name)
        d = float(np.linalg.norm(after.centre - centres[other]))
        if row["d"] < row["d_max"] < d:
            return (
                f", which makes its baseline to {other} {_MM * d:.1f} mm: too wide, "
                f"eq. (10) allows {_MM * row['d_max']:.1f} mm"
            )
    return ""


def _angle(turn: NDArray[np.float64]) -> float:
    return float(Rotation.from_matrix(turn).magnitude())


def _aside(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Tangent of the angle between two unit vectors."""
    return float(np.linalg.norm(np.cross(one, other)) / max(float(one @ other), 1e-3))


def _per_cent(change: float) -> str:
    return f"{100.0 * abs(change):.2g} %"
