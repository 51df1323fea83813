"""What was proved over all poses of the workspace, and how a certificate says it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.cells.cell_bound import CellBound, CellStatus


@dataclass(frozen=True, eq=False)
class ContinuousBound:
    """What was proved over all poses of the workspace.

    Attributes:
        found: Answer of the search over cells.
        shadows: Whether occlusion took part.
        directions: Unit directions from the centre of the workspace, or towards the
            light, of cells in which one device fewer may be enough, shape (k, 3).
        n_samples: Samples of the target from which the rows are.
        row_area_m2: Area that a sample stands for.
        given: Devices that stand already.
        n_free: Rows that they serve, which the search over cells left out.
    """

    found: CellBound
    shadows: bool
    directions: NDArray[np.float64]
    n_samples: int
    row_area_m2: float
    given: int = 0
    n_free: int = 0

    def entry(self) -> dict[str, Any]:
        """Return the plan's `continuous` of a certificate."""
        found = self.found
        most = found.most_weight
        if found.status is CellStatus.PROVED:
            # Fewer fall short of what is required, by a sample at least.
            most = min(most, float(found.problem.required_weight[0]) - 1.0)
        return {
            "lower_bound": int(found.lower_bound) + self.given,
            "status": found.status.name.lower(),
            "proof": found.proof,
            "occlusion": self.shadows,
            "n_samples": self.n_samples,
            "n_reached": len(found.problem.weights) + self.n_free,
            "n_cells": found.cells_used,
            "one_fewer_upper_bound_m2": (most + self.n_free) * self.row_area_m2,
        }


def joined(certificate: dict[str, Any], bound: dict[str, Any]) -> dict[str, Any]:
    """Return a certificate with a bound over all poses: it holds for some of them."""
    needed, candidates = certificate["needed"], certificate["candidates"]
    joined = certificate | {"continuous": bound}
    least = bound["lower_bound"]
    other_samples = bound["n_samples"] != certificate["n_samples"]
    if other_samples or least <= needed["lower_bound"]:
        return joined
    count = certificate["count"]
    joined["needed"] = needed | {"lower_bound": least}
    joined["candidates"] = candidates | {
        "lower_bound": min(least, count),
        "proof": f"over all poses: {bound['proof']}",
    }
    if certificate["status"] == "feasible" and least >= count:
        joined["status"] = "optimal"
    _cap_fewer(joined, needed["count"], bound["one_fewer_upper_bound_m2"])
    return joined


def _cap_fewer(joined: dict[str, Any], needed: int, most_m2: float) -> None:
    """Lower what fewer candidates serve at most to what fewer devices do anywhere."""
    joined["by_count"] = [
        row | {"upper_bound_m2": min(row["upper_bound_m2"], most_m2)}
        if row["count"] < needed
        else row
        for row in joined["by_count"]
    ]
    for key, n in (("one_fewer", joined["count"] - 1), ("best_area", joined["count"])):
        area = joined[key]
        if area is not None and n < needed:
            least = min(area["upper_bound_m2"], most_m2)
            joined[key] = area | {"upper_bound_m2": least}
