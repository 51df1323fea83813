"""Sparse rows of dense matrices, as scipy makes them, and transposes of these."""

import numpy as np
import pytest
from scipy import sparse

from solvers.bit_rows import sparse_rows, transposed


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (1, 1), (40, 7), (7, 40)])
@pytest.mark.parametrize("layout", ["C", "F"])
def test_rows_are_those_of_scipy(shape, layout):
    dense = np.random.default_rng(sum(shape)).random(shape) < 0.3
    dense[:1] = False
    found, expected = (
        sparse_rows(np.asarray(dense, order=layout)),
        sparse.csr_array(dense),
    )
    assert found.shape == expected.shape
    assert found.dtype == bool
    assert found.has_canonical_format
    for name in ("indptr", "indices", "data"):
        own, other = getattr(found, name), getattr(expected, name)
        assert own.dtype == other.dtype
        np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (7, 40), (256, 5), (700, 30)])
def test_transposes_are_those_of_numpy(shape):
    dense = np.random.default_rng(sum(shape)).random(shape) < 0.3
    turned = transposed(dense)
    assert turned.flags.c_contiguous
    np.testing.assert_array_equal(turned, dense.T)
