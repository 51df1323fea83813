"""Which columns of a cover look alike, by colour refinement.

Rows and columns start with one colour each; a row's next colour is that of its columns
together, and the other way round, until no more colours come about. Columns of
different colours can't be exchanged by any symmetry; where every column has its own
colour, there is none.

References:
    McKay and Piperno, "Practical graph isomorphism, II", Journal of Symbolic
    Computation 60, 2014.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

_MAX_ROUNDS = 50


def column_colours(covers: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return a colour of each column, equal for all that some symmetry may exchange.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s).
    """
    rng = np.random.default_rng(0)
    n_rows, n_sets = covers.shape
    matrix = sparse.csr_array(covers, dtype=np.uint64)
    turned = sparse.csr_array(matrix.T)
    # Sums of random numbers modulo 2^64: equal for equal multisets of colours.
    names = rng.integers(0, 2**64, size=n_rows + n_sets + 1, dtype=np.uint64)
    columns, n_colours = np.zeros(n_sets, dtype=np.int64), min(1, n_sets)
    for _ in range(_MAX_ROUNDS):
        rows = np.unique(matrix @ names[columns], return_inverse=True)[1]
        sums = turned @ names[rows]
        pairs = np.stack([columns.astype(np.uint64), sums], axis=1)
        columns = np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
        columns = columns.astype(np.int64)
        more = int(columns.max(initial=-1)) + 1
        if more == n_colours:
            break
        n_colours = more
    return columns


def may_be_symmetric(covers: NDArray[np.bool_]) -> bool:
    """Whether refinement finds at most half as many colours as columns."""
    colours = column_colours(covers)
    return 2 * (int(colours.max(initial=-1)) + 1) <= colours.size
