"""What was proved over all poses of the workspace, and how a certificate says it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import Certificate, ContinuousProof
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

    def proof(self) -> ContinuousProof:
        """Return the plan's `continuous` of a certificate."""
        found = self.found
        most = found.most_weight
        if found.status is CellStatus.PROVED:
            # Fewer fall short of what is required, by a sample at least.
            most = min(most, float(found.problem.required_weight[0]) - 1.0)
        return ContinuousProof(
            lower_bound=int(found.lower_bound) + self.given,
            status=found.status.name.lower(),
            proof=found.proof,
            occlusion=self.shadows,
            n_samples=self.n_samples,
            n_reached=len(found.problem.weights) + self.n_free,
            n_cells=found.cells_used,
            one_fewer_upper_bound_m2=(most + self.n_free) * self.row_area_m2,
        )


def joined(certificate: Certificate, bound: ContinuousProof) -> Certificate:
    """Return a certificate with a bound over all poses: it holds for some of them."""
    before = certificate.changed(continuous=bound)
    needed, least = before.needed, bound.lower_bound
    if bound.n_samples != before.n_samples or least <= needed.lower_bound:
        return before
    optimal = before.status == "feasible" and least >= before.count
    return _fewer_capped(before, bound.one_fewer_upper_bound_m2).changed(
        status="optimal" if optimal else before.status,
        needed=needed.changed(lower_bound=least),
        candidates=before.candidates.changed(
            lower_bound=min(least, before.count),
            proof=f"over all poses: {bound.proof}",
        ),
    )


def _fewer_capped(proof: Certificate, most_m2: float | None) -> Certificate:
    """Lower what fewer candidates cover at most to what fewer devices do anywhere."""
    if most_m2 is None:
        return proof
    needed, best, fewer = proof.needed.count, proof.best_area, proof.one_fewer
    if fewer is not None and proof.count - 1 < needed:
        fewer = fewer.changed(upper_bound_m2=min(fewer.upper_bound_m2, most_m2))
    if proof.count < needed:
        best = best.changed(upper_bound_m2=min(best.upper_bound_m2, most_m2))
    by_count = tuple(
        row.changed(upper_bound_m2=min(row.upper_bound_m2, most_m2))
        if row.count < needed
        else row
        for row in proof.by_count
    )
    return proof.changed(by_count=by_count, best_area=best, one_fewer=fewer)
