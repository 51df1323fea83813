"""Distances and lenses from which one image holds an object, chosen or refused."""

import math
from collections.abc import Mapping, Sequence

from geometry.devices import PinholeModel

# Radius of the ball about an object over its longest side: more than half of it.
BALL = 0.6
# How much nearer or farther a device may stand, as a share of its distance.
PLAY = 0.05
# Nearest distance of a lens of which nothing else is known, in focal lengths.
NEAREST = 10.0
_FOCAL_MM = (100.0, 75.0, 50.0, 35.0, 25.0, 16.0, 12.0, 8.0, 6.0, 4.0)


def least_mm(
    optics_of: Mapping[str, PinholeModel], radius: float, chosen: list[str]
) -> float:
    """The least distance at which lenses focus and an image holds the object [mm]."""
    holds = {
        name: _rounded(radius / math.sin(device.half_angle) - radius)
        for name, device in optics_of.items()
    }
    focus = {
        name: _rounded(device.range_m[0] * 1e3 / (1.0 - PLAY))
        for name, device in optics_of.items()
    }
    widest = max(holds, key=holds.__getitem__)
    nearest = max(focus, key=focus.__getitem__)
    distance, why = holds[widest], f"one image of the {widest} holds the object"
    if focus[nearest] > distance:
        also = f"one image holds the object from {distance:g} mm on"
        distance, why = focus[nearest], f"the {nearest} can be focused; {also}"
    chosen.append(
        f"distance {distance:g} mm from device to surface (--distance-mm): the least "
        f"at which {why}"
    )
    return distance


def check_range(optics_of: Mapping[str, PinholeModel], near: float, far: float) -> None:
    """Refuse distances that a lens can't be focused at, before it is set to them.

    Raises:
        ValueError: It says from where to where it can.
    """
    for name, device in optics_of.items():
        low, high = (1e3 * end for end in device.range_m)
        if not low <= near < far <= high:
            least = f"{_rounded(low / (1.0 - PLAY)):g} or more"
            raise ValueError(
                f"the {name} can be focused from {low:.0f} to {high:.0f} mm, the "
                f"object is {near:.0f} to {far:.0f} mm away; write a --distance-mm "
                f"{least if near < low else 'that is less'}, or name another device"
            )


def fitting_mm(
    sensor: tuple[Sequence[int], float],
    object_mm: float,
    distance: float,
    finest_m: float,
    chosen: list[str],
) -> float:
    """The longest usual lens that shows object and ring edges from this distance [mm].

    Its image holds the object, and its pixels aren't so fine that edges get lost; where
    all are, the shortest.

    Args:
        sensor: Its pixels, and their size [um].
        object_mm: Longest side of the object.
        distance: From device to surface [mm].
        finest_m: Least width of a pixel at the object, `finest_view_m` [m].
        chosen: Gets a line.

    Raises:
        ValueError: If no usual lens shows the object.
    """
    size, pixel_um = sensor
    radius, near = BALL * object_mm, distance * (1.0 - PLAY)
    half = 0.5e-3 * pixel_um * min(size)
    holding = [
        focal
        for focal in _FOCAL_MM
        if math.sin(math.atan(half / focal)) * (distance + radius) >= radius
        and NEAREST * focal <= near
    ]
    if not holding:
        raise ValueError(
            f"no usual lens shows {object_mm:g} mm from {distance:g} mm away with a "
            f"sensor {2.0 * half:.2g} mm high; write a larger --distance-mm, or "
            f"--focal-mm for images side by side"
        )
    longest = 1e-3 * pixel_um * distance / (1e3 * finest_m) if finest_m else math.inf
    found = next((focal for focal in holding if focal <= longest), holding[-1])
    why = "" if found == holding[0] else " and whose pixels find the projector's edges"
    chosen.append(
        f"a {found:g} mm lens: the longest usual one whose image holds the object{why} "
        f"(--focal-mm)"
    )
    return found


def _rounded(mm: float) -> float:
    step = 10.0 if mm < 1000.0 else 50.0
    return step * math.ceil(mm / step - 1e-9)
