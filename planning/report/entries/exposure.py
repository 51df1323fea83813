"""The exposure schedule: fewest groups of projectors without an overlap."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planning.model.document.coverage_records import ExposureSchedule
from planning.model.document.plan_document import PlanDocument
from solvers.colouring import fewest_colours


def exposure_schedule(
    names: Sequence[str], conflicts: NDArray[np.bool_]
) -> ExposureSchedule:
    """Return the plan's `firing_schedule`: the fewest groups without an overlap.

    Args:
        names: Ids of the projectors.
        conflicts: Whether two overlap, shape (k, k).
    """
    colouring = fewest_colours(conflicts)
    return ExposureSchedule(
        groups=tuple(tuple(names[i] for i in group) for group in colouring.groups),
        n_groups=colouring.n_colours,
        lower_bound=colouring.lower_bound,
        proof=colouring.proof,
        clique=tuple(names[i] for i in colouring.clique),
    )


def schedule_line(document: PlanDocument) -> str:
    """Return what may fire together, in a line; empty for one projector."""
    schedule, overlaps = document.firing_schedule, document.overlaps
    if schedule is None or not overlaps:
        return ""
    n = schedule.n_groups
    if n == 1:
        return "FIRING   all projectors together: no two light a surface in common"
    goes = ", then ".join(" + ".join(group) for group in schedule.groups)
    fewest = {
        "clique": f"fewer won't do: any two of {', '.join(schedule.clique)} light "
        "surface in common",
        "exhaustion": "fewer won't do: every way was tried",
        "none": f"at least {schedule.lower_bound} are needed",
    }[schedule.proof]
    most = max(overlaps, key=lambda overlap: overlap.target_m2)
    share = 100.0 * most.target_m2 / document.coverage.target.area_m2
    return (
        f"FIRING   {goes}: {n} groups, {fewest}; most shared: "
        f"{' and '.join(most.projectors)}, {share:.1f} % of the target"
    )
