"""Kinds of constraints in the program of ``baseline_program``, differentiated once.

A kind is a formula of a few variables and data, which many rows of a program share. Its
derivatives are expressions of their own, so that a program only gathers, evaluates and
scatters: to differentiate the whole takes longer than to solve it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .row_columns import InColumns, in_slots

_Array = NDArray[np.float64]
_Index = NDArray[np.int64]
Formula = Callable[[ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True, eq=False)
class Kind:
    """A formula g(v, q) of r values, with its derivatives by v.

    Attributes:
        values: (v, q) to g, (r,).
        slopes: (v, q) to dg/dv, (r, n).
        bends: (v, q, lambda) to the Hessian of lambda.g by v, (n, n).
    """

    values: InColumns
    slopes: InColumns
    bends: InColumns

    @property
    def n_values(self) -> int:
        """How many values r it has."""
        return int(self.values.function.size1_out(0))


@lru_cache(maxsize=64)
def kind_of(formula: Formula, n_variables: int, n_data: int) -> Kind:
    """Return a formula with its derivatives; one object for each formula."""
    v, q = ca.SX.sym("v", n_variables), ca.SX.sym("q", n_data)
    g = ca.densify(formula(v, q))
    weights = ca.SX.sym("lambda", g.numel())
    slopes = ca.densify(ca.jacobian(g, v))
    bends = ca.densify(ca.hessian(ca.dot(weights, g), v)[0])
    shared = {"cse": True}
    return Kind(
        InColumns(ca.Function("values", [v, q], [g], shared)),
        InColumns(ca.Function("slopes", [v, q], [slopes], shared)),
        InColumns(ca.Function("bends", [v, q, weights], [bends], shared)),
    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a program that are one kind's, m instances of it.

    Attributes:
        kind: Their formula.
        variables: Which of the program's variables are v, shape (m, n).
        data: q, shape (m, n_q).
        low: Lower bounds, shape (r,) of all instances or (m, r).
        high: Upper bounds, likewise.
        admitted: Whether what is past a limit at the start may stay there.
    """

    kind: Kind
    variables: _Index
    data: _Array
    low: _Array
    high: _Array
    admitted: bool = False

    @property
    def n_rows(self) -> int:
        """Instances times values."""
        return len(self.variables) * self.kind.n_values

    def at(self, start: _Array) -> _Array:
        """Return the values at a start, shape (m, r)."""
        m = len(self.variables)
        values = self.kind.values.function.map(m)(start[self.variables].T, self.data.T)
        return np.asarray(values, dtype=np.float64).reshape(-1, m, order="F").T

    def bounds(self, start: _Array) -> tuple[_Array, _Array]:
        """Return the bounds of all rows, instance by instance, (m r,) each."""
        shape = len(self.variables), self.kind.n_values
        low, high = (np.broadcast_to(b, shape) for b in (self.low, self.high))
        if self.admitted:
            now = self.at(start)
            low, high = np.minimum(low, now), np.maximum(high, now)
        return low.ravel(), high.ravel()


@dataclass(frozen=True, eq=False)
class StackedRows:
    """All rows of a program over x, and terms that are linear: g(x) + L x + c.

    Attributes:
        x: The variables, (n_x, 1).
        blocks: The rows, in their order.
        linear: L, shape (n_rows, n_x).
        constant: c, shape (n_rows,).
    """

    x: ca.MX
    blocks: tuple[Rows, ...]
    linear: sparse.csc_array
    constant: _Array

    @cached_property
    def _given(self) -> list[tuple[Rows, tuple[ca.MX, ca.DM]]]:
        """The blocks with their v and q, `in_slots`."""
        return [
            (block, (self.x[_slots(block.variables)], ca.DM(in_slots(block.data))))
            for block in self.blocks
        ]

    @cached_property
    def _slope(self) -> ca.DM:
        return _constant(self.linear)

    def values(self) -> ca.MX:
        """Return g(x) + L x + c."""
        parts = [
            block.kind.values(len(block.variables), *given)
            for block, given in self._given
        ]
        return ca.vertcat(*parts) + self._slope @ self.x + ca.DM(self.constant)

    def jacobian(self) -> ca.MX:
        """Return its Jacobian."""
        rows, columns, parts, first = [], [], [], 0
        for block, given in self._given:
            m, r, n = *_shape(block), block.variables.shape[1]
            parts.append(block.kind.slopes(m, *given))
            # Instance by instance, and of each column by column.
            row = first + np.arange(m * r).reshape(m, 1, r)
            rows.append(np.broadcast_to(row, (m, n, r)).ravel())
            columns.append(np.repeat(block.variables.ravel(), r))
            first += block.n_rows
        shape = first, self.x.numel()
        at = np.concatenate(rows).tolist(), np.concatenate(columns).tolist()
        pattern, order = ca.Sparsity.triplet(*shape, *at, False)
        return ca.MX(pattern, ca.vertcat(*parts)[order]) + self._slope

    def hessian(self, weights: ca.MX, own: ca.MX, of_own: _Index) -> ca.MX:
        """Return the upper triangle of the Hessian of weights.(g + L x + c).

        To it comes the diagonal `own` at the variables `of_own`.
        """
        rows, columns, parts, first = [of_own], [of_own], [own], 0
        for block, given in self._given:
            m, r = _shape(block)
            lambdas = weights[_slots(first + np.arange(m * r).reshape(m, r))]
            parts.append(block.kind.bends(m, *given, lambdas))
            # Symmetric: which of both comes first doesn't matter.
            n = block.variables.shape[1]
            rows.append(np.repeat(block.variables, n, axis=1).ravel())
            columns.append(np.tile(block.variables, (1, n)).ravel())
            first += m * r
        row, column = np.concatenate(rows), np.concatenate(columns)
        upper = np.flatnonzero(row <= column)
        n_x = self.x.numel()
        places, entry = np.unique(column[upper] * n_x + row[upper], return_inverse=True)
        gather = sparse.csc_array(
            (np.ones(len(upper)), (entry, upper)), shape=(len(places), len(row))
        )
        at = (places % n_x).tolist(), (places // n_x).tolist()
        pattern = ca.Sparsity.triplet(n_x, n_x, *at)
        return ca.MX(pattern, _constant(gather) @ ca.vertcat(*parts))


def _shape(block: Rows) -> tuple[int, int]:
    return len(block.variables), block.kind.n_values


def _slots(rows: _Index) -> list[int]:
    return in_slots(rows).tolist()


def _constant(matrix: sparse.csc_array) -> ca.DM:
    # From arrays of integers it copies number by number, and twenty times as long.
    shape = cast("tuple[int, int]", matrix.shape)
    starts, at = (cast("_Index", x).tolist() for x in (matrix.indptr, matrix.indices))
    return ca.DM(ca.Sparsity(*shape, starts, at), ca.DM(matrix.data))
