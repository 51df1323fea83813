"""Which projectors fire together: the fewest groups without an overlap."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.colouring import fewest_colours


def firing_schedule(
    names: Sequence[str], conflicts: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return the plan's `firing_schedule`: the fewest groups without an overlap.

    Args:
        names: Ids of the projectors.
        conflicts: Whether two overlap, shape (k, k).
    """
    found = fewest_colours(conflicts)
    return {
        "groups": [[names[i] for i in group] for group in found.groups],
        "n_groups": found.n_colours,
        "lower_bound": found.lower_bound,
        "proof": found.proof,
        "clique": [names[i] for i in found.clique],
    }


def schedule_line(document: Mapping[str, Any]) -> str:
    """Return what may fire together, in a line; empty for one projector."""
    schedule = document.get("firing_schedule")
    overlaps = document.get("overlaps")
    if not schedule or not overlaps:
        return ""
    n = schedule["n_groups"]
    if n == 1:
        return "FIRING   all projectors together: no two light a surface in common"
    goes = ", then ".join(" + ".join(group) for group in schedule["groups"])
    fewest = {
        "clique": f"fewer won't do: any two of {', '.join(schedule['clique'])} light "
        "surface in common",
        "exhaustion": "fewer won't do: every way was tried",
        "none": f"at least {schedule['lower_bound']} are needed",
    }[schedule["proof"]]
    most = max(overlaps, key=lambda entry: entry["target_m2"])
    share = 100.0 * most["target_m2"] / document["coverage"]["target"]["area_m2"]
    return (
        f"FIRING   {goes}: {n} groups, {fewest}; most shared: "
        f"{' and '.join(most['projectors'])}, {share:.1f} % of the target"
    )
