"""Upper bounds on many parts of a cover's selections at once, exact in any order.

A part holds the selections of K sets that take no closed set, and at least one set of
each of some groups that have none in common. For any lambda in [0, w] they cover at
most::

    sum_e (w_e - lambda_e) + the costliest such selection, a set paying lambda(a_j)

which is the costliest of each group and the costliest others. Multipliers are whole
steps of a grid so coarse that sums of all of them are exact in single precision. The
volume algorithm (``lagrangian``) lowers many bounds by one matrix product a step.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.status import WorkBudget

# Sums of whole numbers up to this are exact in single precision.
_EXACT = float(1 << 23)
# Running means are kept in steps of this size, so that their sums are exact too.
_STEP = 2.0**-12
# A dense multiply-add in single precision costs this share of a unit of work.
_DENSE_UNIT = 1.0 / 16.0
# Multiply-adds up to which OpenBLAS multiplies matrices without copying them first; of
# few parts the copy takes longer than the product.
_UNCOPIED, _FEW_PARTS = 1_000_000, 8
# Work of choosing the costliest, for each part and set.
_CHOOSE = 6.0
_MEMORY = 0.9
# After so many steps, parts that were refuted take no further part.
_ROUND = 10


@dataclass(frozen=True, eq=False)
class GroupPart:
    """Selections of K sets, bounded.

    Attributes:
        closed: Sets that aren't taken, shape (n_s,).
        groups: Indices of sets of which at least one is taken, each; none is closed.
        shares: lambda / w, shape (n_e,).
        primal: Running mean of the costliest selections, shape (n_s,).
        costliest: The last costliest selection, at most K sets.
        pace: Of the volume algorithm: the length of its steps, and how many in a row
            lowered nothing.
        bound: Integer-valued weight that no selection of the part exceeds.
    """

    closed: NDArray[np.bool_]
    groups: tuple[NDArray[np.int64], ...]
    shares: NDArray[np.float32]
    primal: NDArray[np.float32]
    costliest: NDArray[np.int64]
    bound: float
    pace: tuple[float, int] = (1.0, 0)


class PartBounds:
    """Bounds parts of the selections of K sets of a simple cover.

    Bounds below the target are as good as any. With `leaves_out` a part closes sets
    that none of its selections takes which reach the target.

    Attributes:
        covers: Whether set s covers row e, as 0 and 1, shape (n_s, n_e).
        n_sets: K.
    """

    def __init__(
        self,
        cover: ReducedCover,
        n_sets: int,
        target: float,
        budget: WorkBudget,
        *,
        leaves_out: bool = False,
    ) -> None:
        self.covers = cover.by_set.astype(np.float32).toarray()
        self.n_sets = n_sets
        self._weights, self._total = cover.weights, cover.total
        self._target, self._budget = target, budget
        self._leaves_out = leaves_out
        self._grid = 2.0 ** max(0.0, np.ceil(np.log2(self._total / _EXACT)))

    def whole(self, shares: NDArray[np.float64]) -> GroupPart:
        """Return the part of all selections, not bounded yet."""
        n = len(self.covers)
        return GroupPart(
            np.zeros(n, dtype=bool),
            (),
            shares.astype(np.float32),
            np.zeros(n, dtype=np.float32),
            np.empty(0, dtype=np.int64),
            np.inf,
        )

    def lowered(self, parts: list[GroupPart], steps: int) -> list[GroupPart]:
        """Return the parts with bounds as low as so many steps bring them."""
        bounded: list[GroupPart] = []
        live = parts
        for _ in range(0, steps, _ROUND):
            if not live or self._budget.exhausted:
                break
            live = self._stepped(live)
            bounded += [part for part in live if part.bound < self._target]
            live = [part for part in live if part.bound >= self._target]
        return bounded + live

    # BLAS flags what it finds beside short rows, now and then.
    @np.errstate(invalid="ignore")
    def _stepped(self, parts: list[GroupPart]) -> list[GroupPart]:
        weights, aim = self._weights, 0.998 * self._target
        costliest = _Costliest(parts, self.n_sets)
        shares = np.stack([part.shares for part in parts]).astype(np.float64)
        best, (bounds, taken, spared) = shares, self._bounds(costliest, shares)
        primal = np.stack([part.primal for part in parts]).astype(np.float64)
        fresh = np.array([not part.costliest.size for part in parts])
        primal = np.where(fresh[:, None], taken, primal)
        step = np.array([part.pace[0] for part in parts])
        stale = np.array([part.pace[1] for part in parts])
        for _ in range(_ROUND):
            primal = np.rint(primal / _STEP) * _STEP
            excess = 1.0 - self._reached(primal.astype(np.float32)).astype(np.float64)
            moving = np.where(excess > 0, best < 1.0, best > 0.0)
            length = np.maximum((excess * excess * moving) @ weights, 1e-9)
            far = np.maximum(bounds - aim, 1e-4 * self._total)
            shares = np.clip(best + (step * far / length)[:, None] * excess, 0.0, 1.0)
            values, taken, others = self._bounds(costliest, shares)
            primal = _MEMORY * primal + (1.0 - _MEMORY) * taken
            lower = values < bounds
            best[lower], spared[lower] = shares[lower], others[lower]
            bounds = np.minimum(bounds, values)
            stale = np.where(lower, 0, stale + 1)
            step = np.where(lower, np.minimum(1.1 * step, 4.0), step)
            step = np.where(~lower & (stale % 5 == 0), 0.6 * step, step)
            if np.all(bounds < self._target):
                break
        closed = [part.closed for part in parts]
        if self._leaves_out:
            useless = bounds[:, None] - spared < self._target
            closed = [a | b for a, b in zip(closed, useless, strict=True)]
        return [
            replace(
                part,
                closed=closed[i],
                shares=best[i].astype(np.float32),
                primal=primal[i].astype(np.float32),
                costliest=np.flatnonzero(taken[i]),
                bound=min(part.bound, float(bounds[i])),
                pace=(float(step[i]), int(stale[i])),
            )
            for i, part in enumerate(parts)
        ]

    def _bounds(
        self, costliest: "_Costliest", shares: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
        """Bounds (p,), which sets the costliest selections take, and what others spare.

        The latter two have shape (p, n_s): selections with a set beside the groups
        cover so much less than the bound at most.
        """
        steps = np.floor(shares * (self._weights / self._grid))
        payments = self._payments(steps.astype(np.float32))
        self._budget.spend(
            2.0 * len(shares) * self.covers.size * _DENSE_UNIT
            + _CHOOSE * payments.size
            + 1e5
        )
        taken, spared = costliest.at(payments)
        paid = np.sum(payments, axis=1, where=taken, dtype=np.float64)
        bounds = self._total + self._grid * (paid - steps.sum(axis=1))
        return bounds, taken, self._grid * spared

    def _reached(self, primal: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return how often selections, (p, n_s), cover each row, (p, n_e)."""
        if len(primal) > _FEW_PARTS:
            return primal @ self.covers
        # Few parts take few of the sets.
        some = np.flatnonzero(primal.any(axis=0))
        return primal[:, some] @ self.covers[some]

    def _payments(self, steps: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return what each set pays, (p, n_s), by multipliers, (p, n_e)."""
        if len(steps) > _FEW_PARTS:
            return steps @ self.covers.T
        width = max(1, _UNCOPIED // steps.size)
        firsts = range(0, len(self.covers), width)
        return np.hstack([steps @ self.covers[i : i + width].T for i in firsts])


class _Costliest:
    """The costliest selections of parts, found together at ever new payments."""

    def __init__(self, parts: list[GroupPart], n_sets: int) -> None:
        self._closed = np.stack([part.closed for part in parts])
        n_groups = np.array([len(part.groups) for part in parts])
        spare = n_sets - n_groups
        self._alike = [(k, np.flatnonzero(spare == k)) for k in set(spare[spare > 0])]
        groups = [group for part in parts for group in part.groups]
        sizes = np.array([len(group) for group in groups], dtype=np.int64)
        # All groups in one row: their sets, and of which part and group each is.
        self._sets = np.concatenate([np.empty(0, dtype=np.int64), *groups])
        self._part = np.repeat(np.arange(len(parts)), n_groups)
        self._rows = np.repeat(self._part, sizes)
        self._starts, self._sizes = np.cumsum(sizes) - sizes, sizes
        self._settled = self._closed.copy()
        self._settled[self._rows, self._sets] = True

    def at(
        self, payments: NDArray[np.float32]
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Return which sets they take, and how much less is paid with any other set.

        Payments and both answers have shape (p, n_s). Of sets taken, closed, or of a
        group nothing is said: 0.
        """
        taken = np.zeros(payments.shape, dtype=bool)
        least = np.full(len(payments), np.inf)
        if len(self._starts):
            paid = payments[self._rows, self._sets]
            most = np.maximum.reduceat(paid, self._starts)
            best = np.flatnonzero(paid == np.repeat(most, self._sizes))
            first = best[np.searchsorted(best, self._starts)]
            taken[self._part, self._sets[first]] = True
        others = np.where(self._closed | taken, np.float32(-1.0), payments)
        for spare, rows in self._alike:
            some = others[rows]
            last = min(int(spare), some.shape[1]) - 1
            top = np.argpartition(-some, last, axis=1)[:, :spare]
            costs = some[np.arange(len(some))[:, None], top]
            row, column = np.nonzero(costs > 0.0)
            taken[rows[row], top[row, column]] = True
            # Where fewer pay than are spare, any may join them: 0.
            least[rows] = np.maximum(costs.min(axis=1), 0.0)
        spared = np.where(self._settled | taken, 0.0, least[:, None] - payments)
        return taken, spared
