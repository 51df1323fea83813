"""What was proved over all poses of the workspace, and how a certificate says it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import Certificate, ContinuousProof
from solvers.cells.cell_bound import MOST_CELLS, CellBound, CellStatus, bound_count
from solvers.cells.cell_problem import CellProblem
from solvers.cells.cell_tree import CellTree
from solvers.cells.known_poses import proved_over

from .candidate_certificate import Refutation, least_for_total
from .quotas import Quotas, RegionFloors

_STATUS: dict[CellStatus, Literal["proved", "survived", "cut"]] = {
    CellStatus.PROVED: "proved",
    CellStatus.SURVIVED: "survived",
    CellStatus.CUT: "cut",
}

# Work for a search with floors of regions, as a share of that without.
_WITH_FLOORS = 0.25


@dataclass(frozen=True)
class Effort:
    """What is spent on a bound.

    Attributes:
        finest: Cells of positions are parts of a cube map of 2^finest cells an edge;
            cameras' where rougher ones without shadows leave room.
        budget: Counted work of a search.
        shadows: Pairs of sample and face above which shadows are left out.
        most_samples: Samples of the cover at most; None: all that it has.
        offers: Poses offered, beside cells that can't be refuted, where the bound
            leaves room for fewer projectors.
        maps: As `finest`, of the maps in which shadows are drawn; in parallel light
            their cells are those that are searched.
        finer_budget: Counted work of another search among shadows, in maps and cells
            twice as fine, where known poses leave room for a proof.
        where_room: What is spent instead, where known poses leave that room.
        most_cells: Multisets of more aren't searched for long.
        starts: Searches for fewer devices between the bound and the count.
        aims: As `finest`, of the aims of cameras whose image the object overflows;
            None: cells aren't cut by aim.
    """

    finest: int
    budget: float
    shadows: float
    most_samples: int | None = None
    offers: int = 0
    maps: int = 0
    finer_budget: float = 0.0
    where_room: "Effort | None" = None
    most_cells: int = MOST_CELLS
    aims: int | None = None
    starts: int = 0


@dataclass(frozen=True)
class BoundQuestion:
    """How many devices it takes to cover so many samples, wherever they stand.

    Existing devices are in every plan, so what they cover is free, and the fewest are
    they and the fewest more that cover the rest::

        n(W) >= n_existing + n_more(W - free)

    Attributes:
        required: Samples to be covered, of those that existing devices don't cover.
        floors: The same of each region; of which each sample is, is `regions`, (n,).
        count: Devices that are enough for that.
        n_samples: Samples of the target from which they are.
        sample_area_m2: Area that each of them stands for.
        n_existing: Existing devices.
        n_free: Samples that these cover.
        wanted: Which samples are neither free nor out of reach, (n_samples,).
    """

    required: int
    count: int
    n_samples: int
    sample_area_m2: float
    n_existing: int = 0
    n_free: int = 0
    floors: tuple[int, ...] = ()
    regions: NDArray[np.int64] | None = None
    wanted: NDArray[np.bool_] | None = None

    @classmethod
    def about(
        cls,
        certificate: Certificate,
        reached: NDArray[np.bool_],
        free: NDArray[np.bool_],
        share: float,
        area_m2: float,
        regions: RegionFloors,
    ) -> "BoundQuestion":
        """Return the question that a certificate over candidates leaves open.

        The samples reached, and those of them that existing devices cover, are (n,);
        all n stand for `area_m2`.
        """
        n_free, quotas = int(free.sum()), Quotas.of(regions, reached, share)
        floors = np.clip(quotas.floors - regions.counts(free), 0, None)
        return cls(
            max(quotas.total - n_free, 0),
            certificate.needed.count - certificate.given,
            len(reached),
            area_m2 / len(reached),
            certificate.given,
            n_free,
            tuple(floors.tolist()),
            regions.row[reached & ~free],
            reached & ~free,
        )

    def room(self, known: NDArray[np.bool_], budget: float) -> float:
        """Return by what share multipliers prove more than needed over known poses.

        These are (k, n_rows). Over all poses it is no more; none or less, and no search
        over cells proves the count by multipliers.
        """
        fewer = self.count - 1
        if fewer < 1:
            return float("inf")
        problem = self._of_all(known.shape[1])
        return proved_over(problem, known, fewer, budget) / fewer - 1.0

    def _of_all(self, n_rows: int) -> CellProblem:
        """What is required of all regions together, without their floors."""
        return CellProblem(np.ones(n_rows), np.array([float(self.required)]))

    def searched(
        self,
        tree: CellTree,
        budget: float,
        known: NDArray[np.bool_] | None = None,
        *,
        with_floors: bool = True,
        most_cells: int = MOST_CELLS,
    ) -> CellBound:
        """Return what a search over cells of poses proves.

        What is required of all alone comes first: what it proves holds with floors,
        which are asked for where the known poses leave no room for a proof without.
        What some poses cover of the tree's samples, (k, n_rows), guides the search;
        multisets of at most so many cells are searched for long.
        """
        problem = self._of_all(tree.n_rows)
        bound = bound_count(
            problem,
            tree,
            self.count,
            known=known,
            budget=budget,
            most_cells=most_cells,
        )
        room = known is not None and bound.over_known > self.count - 1
        proved = bound.status is CellStatus.PROVED
        if proved or room or not (with_floors and any(self.floors)):
            return bound
        floored = CellProblem(
            np.ones(tree.n_rows),
            np.array(self.floors, dtype=np.float64),
            None,  # pyright: ignore[reportArgumentType]
            self.regions,  # pyright: ignore[reportArgumentType]
            float(self.required),
        )
        again = bound_count(
            floored,
            tree,
            self.count,
            known=known,
            least=int(bound.lower_bound),
            budget=_WITH_FLOORS * budget,
            most_cells=most_cells,
        )
        return again if again.lower_bound > bound.lower_bound else bound


@dataclass(frozen=True, eq=False)
class ContinuousBound:
    """What was proved over all poses of the workspace.

    Attributes:
        question: What was asked.
        found: Answer of the search over cells.
        shadows: Whether occlusion took part.
        directions: Unit directions from the centre of the workspace, or towards the
            light, of cells in which one device fewer may be enough, shape (k, 3).
    """

    question: BoundQuestion
    found: CellBound
    shadows: bool
    directions: NDArray[np.float64]

    def proof(self) -> ContinuousProof:
        """Return the plan's `continuous` of a certificate."""
        found, question = self.found, self.question
        most = found.most_weight
        by_total = found.problem.required_total is None
        if found.status is CellStatus.PROVED and by_total:
            # Fewer fall short of what is required, by a sample at least.
            most = min(most, float(found.problem.required_weight[0]) - 1.0)
        return ContinuousProof(
            lower_bound=int(found.lower_bound) + question.n_existing,
            status=_STATUS[found.status],
            proof=found.proof,
            occlusion=self.shadows,
            n_samples=question.n_samples,
            n_reached=len(found.problem.weights) + question.n_free,
            n_cells=found.cells_used,
            one_fewer_upper_bound_m2=(most + question.n_free) * question.sample_area_m2,
        )

    def refutation(self) -> Refutation | None:
        """Return by what others may derive the bound again; None: by nothing.

        Floors of regions aren't followed. Where multisets of cells were looked at, the
        multipliers may yet prove as much over smaller cells.
        """
        found, wanted = self.found, self.question.wanted
        if wanted is None or found.problem.required_total is not None:
            return None
        if not 1.0 <= found.lower_bound < np.inf:
            return None
        n_devices = int(found.lower_bound) - 1
        multipliers = np.zeros(len(wanted), dtype=np.int64)
        # Of one device, multipliers that are all alike look at all that it covers.
        multipliers[wanted] = 1 if n_devices == 1 else found.multipliers
        return Refutation(n_devices, multipliers)


def with_existing_alone(certificate: Certificate, n_reached: int) -> Certificate:
    """Return a certificate where existing devices suffice: no cells are searched."""
    proof = ContinuousProof(
        lower_bound=certificate.given,
        status="proved",
        proof="those that stand already are enough, and in every plan",
        occlusion=True,
        n_samples=certificate.n_samples,
        n_reached=n_reached,
        n_cells=0,
        one_fewer_upper_bound_m2=None,
    )
    return certificate.changed(continuous=proof)


def joined(certificate: Certificate, bound: ContinuousProof) -> Certificate:
    """Return a certificate with a bound over all poses: it holds for some of them."""
    before = certificate.changed(continuous=bound)
    needed, least = before.needed, bound.lower_bound
    if bound.n_samples != before.n_samples or least <= needed.lower_bound:
        return before
    optimal = before.status == "feasible" and least >= before.count
    after = _fewer_capped(before, bound.one_fewer_upper_bound_m2)
    candidates = before.candidates.changed(
        lower_bound=min(least, before.count), proof=f"over all poses: {bound.proof}"
    )
    if candidates.for_total is not None:
        total = min(least_for_total(after.by_count, after.required_m2), least)
        total = max(total, candidates.for_total)
        candidates = candidates.changed(for_total=total)
    return after.changed(
        status="optimal" if optimal else before.status,
        needed=needed.changed(lower_bound=least),
        candidates=candidates,
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
