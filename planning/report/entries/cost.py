"""Eq. (8): what a reconstruction costs, before and after the cameras were minimised."""

from collections.abc import Mapping, Sequence

from planning.model.document.plan_document import CostRecord
from planning.model.planned import PlannedCamera

# Stages of planning that place light, with what they need to know of the surface, and
# those that place cameras.
_PROJECTOR_STAGES = ("regions", "projectors", "bounds", "projector_poses", "rings")
_CAMERA_STAGES = ("cameras", "baselines")


def cost_record(
    cameras: Sequence[PlannedCamera],
    n_before: int,
    seconds: Mapping[str, float],
) -> CostRecord:
    """Return the plan's `cost`; `docs/method/cost.md` defines every key.

    With M_j N_j pixels of camera j::

        C = (sum_j M_j N_j)(t1 + t2) + t3 + t4 + t5

    t1 (acquisition, here rendering) and t2 (pixels to points) are seconds a pixel, t3
    (fusion), t4 (projector planning) and t5 (camera planning) seconds. C_before is the
    same with the cameras of the greedy cover, which is what D was before it was
    minimised. Without a check t1 to t3 are unknown, and C with them.

    Args:
        cameras: As planned.
        n_before: Cameras of the greedy cover.
        seconds: Measured processor times in [s]: of the stages of planning, and where a
            check was made of `render`, `decode` and `merge`.
    """
    sizes = [c.device.resolution[0] * c.device.resolution[1] for c in cameras]
    pixels = sum(sizes)
    t4, t5 = (
        sum(seconds.get(name, 0.0) for name in names)
        for names in (_PROJECTOR_STAGES, _CAMERA_STAGES)
    )
    times = dict.fromkeys(("t1", "t2", "t3", "C", "C_before"))
    if "render" in seconds:
        t1, t2 = seconds["render"] / pixels, seconds["decode"] / pixels
        t3 = seconds["merge"]
        before = pixels * n_before / len(cameras)
        times = {
            "t1": t1,
            "t2": t2,
            "t3": t3,
            "C": pixels * (t1 + t2) + t3 + t4 + t5,
            "C_before": before * (t1 + t2) + t3 + t4 + t5,
        }
    return CostRecord(pixels=pixels, n_cameras_before=n_before, t4=t4, t5=t5, **times)


def cost_lines(cost: CostRecord) -> list[str]:
    """Return eq. (8) with its terms, for a person; nothing where C is unknown."""
    if cost.C is None or cost.C_before is None:
        return []
    per_pixel = " + ".join(f"{1e6 * (t or 0.0):.2f}" for t in (cost.t1, cost.t2))
    once = " + ".join(f"{t or 0.0:.1f}" for t in (cost.t3, cost.t4, cost.t5))
    n = cost.n_cameras_before
    return [
        f"COST     eq. (8): {1e-6 * cost.pixels:.1f} Mpx x ({per_pixel}) us + "
        f"{once} s = {cost.C:.1f} s of processor time",
        f"         with the {n} camera{'s' * (n != 1)} of a greedy cover, before D was "
        f"minimised: {cost.C_before:.1f} s",
    ]
