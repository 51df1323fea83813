"""Whether triangles are the whole surface of the solid that a rig states.

A closed surface that lies in the surface of a solid covers all of that equally often.
Where every triangle faces outwards and their area is the solid's, that is once.
"""

import numpy as np

from geometry.arrays import Array, Ints, Mask

_ROUNDING = 1e-9
# A triangle of a mantle that spans more than this of a turn [rad] lies inside.
_SPAN = 0.2


def lacks_of_solid(corners: Array, faces: Ints, sides: Array, *, round: bool) -> str:
    """Return why triangles aren't the surface of a solid; "" where they may be.

    Their area is compared elsewhere.

    Args:
        corners: Of each triangle in the solid's own axes [m], shape (n, 3, 3).
        faces: Their vertices' numbers, shape (n, 3).
        sides: Of the box about it [m]; of a cylinder its axis is the third.
        round: Whether it is a cylinder.
    """
    if not _closed(faces):
        return "is open: light goes through it"
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    on = np.zeros(len(faces), dtype=bool)
    for axis in (2,) if round else (0, 1, 2):
        for sign in (-1.0, 1.0):
            away = np.abs(corners[:, :, axis] - sign * 0.5 * sides[axis]).max(axis=1)
            on |= (away <= _ROUNDING) & (sign * outward[:, axis] > 0.0)
    if round:
        on |= _on_mantle(corners, outward, 0.5 * float(sides[0]))
    if not on.all():
        return f"has {int((~on).sum())} triangles inside it, or inside out"
    return ""


def _closed(faces: Ints) -> bool:
    """Whether each edge is run through once each way."""
    n = int(faces.max()) + 1
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    there, back = np.sort(begin * n + end), np.sort(end * n + begin)
    once = np.all(np.diff(there) > 0)
    return bool(once and np.array_equal(there, back))


def _on_mantle(corners: Array, outward: Array, radius: float) -> Mask:
    """Which triangles lie on a cylinder about z, as near as such flat ones can."""
    across = corners[:, :, :2]
    on = np.abs(np.linalg.norm(across, axis=2) - radius).max(axis=1) <= _ROUNDING
    middle = across.mean(axis=1)
    deep = np.linalg.norm(middle, axis=1) < radius * np.cos(_SPAN)
    return on & ~deep & (np.einsum("ij,ij->i", middle, outward[:, :2]) > 0.0)
