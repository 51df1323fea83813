"""Random small covers of every kind, and their optimum by trying all selections."""

import itertools
from dataclasses import dataclass

import numpy as np

from solvers import CoverProblem

# Relative; what differs by less is rounding of the sums.
SLACK = 1e-12


def small_cover(seed):
    """Return a cover of at most 12 rows and 7 sets; the seed decides of which kind.

    Full and partial, plain, weighted and weightless rows, equal and differing costs,
    rows needed once to three times, one to three row sets, none to two fixed sets.
    """
    rng = np.random.default_rng([seed, 7])
    n_e, n_s = int(rng.integers(1, 13)), int(rng.integers(1, 8))
    covers = rng.random((n_e, n_s)) < rng.choice([0.2, 0.4, 0.7])
    weights = [None, rng.uniform(0.1, 1.0, n_e), rng.integers(0, 4, n_e).astype(float)]
    costs = [None, rng.uniform(0.5, 1.5, n_s), rng.integers(1, 4, n_s).astype(float)]
    needs = [1, 2, rng.integers(1, 4, n_e)]
    n_g = int(rng.choice([1, 1, 2, 3]))
    row_sets = rng.integers(0, n_g, n_e)
    n_fixed = int(rng.choice([0, 0, 1, 2]))
    return CoverProblem(
        covers,
        weights[rng.choice(3, p=[0.3, 0.4, 0.3])],
        costs[rng.choice(3, p=[0.5, 0.3, 0.2])],
        # What no set covers would make most of the full ones infeasible.
        min_coverage=float(rng.choice([0.5, 0.8, 0.9, 1.0])),
        needs=needs[rng.choice(3, p=[0.5, 0.25, 0.25])],
        row_sets=row_sets,
        fixed=rng.choice(n_s, size=min(n_fixed, n_s), replace=False),
    )


@dataclass(frozen=True)
class Truth:
    """What trying all selections gives.

    Attributes:
        least_cost: Least cost of a cover with at most k sets, for k = 0 ... n_s; inf
            where there is none.
        most_weight: Most weight of at most k sets, the fixed ones included.
        heaviest: Most weight of a cover of the fewest sets.
    """

    least_cost: list[float]
    most_weight: list[float]
    heaviest: float


def by_hand(problem):
    """Return the truth about a small problem, counted from its own arrays."""
    covers = problem.covers.toarray()
    n_s, fixed = covers.shape[1], {int(s) for s in problem.fixed}
    groups = [problem.row_sets == g for g in range(problem.n_row_sets)]
    least, most, heaviest = [], [], -np.inf
    for k in range(n_s + 1):
        cost, weight = (least[-1], most[-1]) if k else (np.inf, -np.inf)
        smallest = not np.isfinite(cost)
        for chosen in itertools.combinations(range(n_s), k):
            if not fixed <= set(chosen):
                continue
            done = covers[:, chosen].sum(axis=1) >= problem.needs
            covered = float(problem.weights[done].sum())
            weight = max(weight, covered)
            slack = SLACK * max(problem.total_weight, problem.required_weight.max())
            if all(
                problem.weights[done & group].sum() >= required - slack
                for group, required in zip(groups, problem.required_weight, strict=True)
            ):
                cost = min(cost, float(problem.costs[list(chosen)].sum()))
                heaviest = max(heaviest, covered) if smallest else heaviest
        least.append(cost)
        most.append(weight)
    return Truth(least, most, heaviest)
