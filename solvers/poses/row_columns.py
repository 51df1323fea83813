"""A formula at many instances at once: each of its operations on columns of numbers.

CasADi interprets an `SX` function operation by operation, for one instance after the
other. Here each operation is one loop over as many instances as there are slots, to the
same last digit in an eighth of the time.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

# More and a program of few rows pays for what it doesn't use; fewer and an operation
# costs more to begin than to do.
_SLOTS = 64


@dataclass(frozen=True, eq=False)
class InColumns:
    """An `SX` function of vectors, with one dense result of r numbers."""

    function: ca.Function

    @cached_property
    def _slotted(self) -> ca.Function:
        """The function of inputs (slots, n) each, with a result (slots, r)."""
        of = self.function
        inputs = [
            ca.MX.sym(of.name_in(i), _SLOTS, of.numel_in(i)) for i in range(of.n_in())
        ]
        columns = [ca.horzsplit(each) for each in inputs]
        results = [ca.MX(0.0)] * of.numel_out(0)
        work: dict[int, ca.MX] = {}
        for k in range(of.n_instructions()):
            operation, given = of.instruction_id(k), of.instruction_input(k)
            into = of.instruction_output(k)
            if operation == ca.OP_INPUT:
                work[into[0]] = columns[given[0]][given[1]]
            elif operation == ca.OP_OUTPUT:
                results[into[1]] = work[given[0]]
            elif operation == ca.OP_CONST:
                work[into[0]] = ca.MX(of.instruction_constant(k))
            elif len(given) == 1:
                work[into[0]] = ca.MX.unary(operation, work[given[0]])
            else:
                one, two = (work[i] for i in given)
                work[into[0]] = ca.MX.binary(operation, one, two)
        ones = ca.DM.ones(_SLOTS, 1)
        filled = [each * ones if each.is_scalar() else each for each in results]
        return ca.Function(of.name(), inputs, [ca.horzcat(*filled)])

    def __call__(self, m: int, *inputs: ca.MX | ca.DM) -> ca.MX:
        """Return the results of m instances one after the other, (m r,).

        Inputs are `in_slots` of (m, n) each.
        """
        blocks, r = _n_blocks(m), self.function.numel_out(0)
        shaped = [ca.reshape(each, _SLOTS, each.numel() // _SLOTS) for each in inputs]
        results = ca.vec(self._slotted.map(blocks)(*shaped))
        places = np.arange(blocks * r * _SLOTS).reshape(blocks, r, _SLOTS)
        return results[places.transpose(0, 2, 1).reshape(-1, r)[:m].ravel().tolist()]


def in_slots(rows: NDArray[Any]) -> NDArray[Any]:
    """Return rows (m, n) by blocks, and in these column by column; m at least 1."""
    blocks = _n_blocks(len(rows))
    filled = rows[np.resize(np.arange(len(rows)), blocks * _SLOTS)]
    return filled.reshape(blocks, _SLOTS, -1).transpose(0, 2, 1).ravel()


def _n_blocks(m: int) -> int:
    return -(-m // _SLOTS)
