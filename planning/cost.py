"""Eq. (8): what a reconstruction costs, before and after the cameras were minimised."""

from collections.abc import Mapping, Sequence
from typing import Any

from .plan import PlannedCamera


def cost_entry(
    cameras: Sequence[PlannedCamera],
    n_before: int,
    seconds: Mapping[str, float],
) -> dict[str, Any]:
    """Return the plan's `cost`.

    With M_j N_j pixels of camera j::

        C = (sum_j M_j N_j)(t1 + t2) + t3 + t4 + t5

    t1 (acquisition, here rendering) and t2 (pixels to points) are seconds a pixel, t3
    (fusion), t4 (projector planning) and t5 (camera planning) seconds. C_before is the
    same with the cameras of the greedy cover, which is what D was before it was
    minimised. Without a check t1 to t3 are unknown, and C with them.

    Args:
        cameras: As planned.
        n_before: Cameras of the greedy cover.
        seconds: Measured times in [s]: `projectors` and `cameras`, and where a check
            was made processor times of `render`, `decode` and `merge`.
    """
    sizes = [c.device.resolution[0] * c.device.resolution[1] for c in cameras]
    pixels = sum(sizes)
    t4, t5 = seconds["projectors"], seconds["cameras"]
    entry: dict[str, Any] = {"pixels": pixels, "t4": t4, "t5": t5}
    if "render" not in seconds:
        return entry | {"t1": None, "t2": None, "t3": None, "C": None, "C_before": None}
    t1, t2 = seconds["render"] / pixels, seconds["decode"] / pixels
    t3 = seconds["merge"]
    before = pixels * n_before / len(cameras)
    return entry | {
        "t1": t1,
        "t2": t2,
        "t3": t3,
        "n_cameras_before": n_before,
        "C": pixels * (t1 + t2) + t3 + t4 + t5,
        "C_before": before * (t1 + t2) + t3 + t4 + t5,
    }
