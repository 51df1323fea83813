"""Signs of products against the same in whole numbers, near zero above all."""

import numpy as np
import pytest

from geometry.directions.product_signs import ProductSigns, packed


def unpacked(words, n):
    return (words[:, None] >> np.arange(n, dtype=np.uint64) & np.uint64(1)).astype(bool)


@pytest.mark.parametrize("n", [1, 40, 64])
@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_every_sign_is_exact_or_told_to_be_near(n, size):
    """Whole numbers of 20 bits: single precision rounds them, double doesn't."""
    rng = np.random.default_rng(n)
    rows = rng.integers(-(2**20), 2**20, (6000, 4))
    columns = rng.integers(-(2**20), 2**20, (n, 4))
    # A third of the rows are within rounding of zero for some column, or zero.
    some = np.arange(0, 6000, 3)
    own = columns[some % n]
    rows[some, 3] = -(rows[some, :3] * own[:, :3]).sum(axis=1) // own[:, 3]
    truth = rows @ columns.T
    words, near, products = ProductSigns(rows * size).over(columns / 1024.0)
    np.testing.assert_array_equal(products, (rows * size)[near] @ columns.T / 1024.0)
    far = np.setdiff1d(np.arange(6000), near)
    np.testing.assert_array_equal(unpacked(words, n)[far], truth[far] > 0)
    assert np.isin(some[np.abs(rows[some, 3]) < 2**20], near).all()
    assert 1000 < far.size
    # What fills the word up is as its first column.
    assert ((words[far] >> np.uint64(63) & np.uint64(1)) > 0).tolist() == (
        truth[far, 63 if n == 64 else 0] > 0
    ).tolist()


def test_what_counts_as_near_is_told():
    rows = np.linspace(-1.0, 1.0, 5001)[:, None]
    _, near, _ = ProductSigns(rows).over(np.array([[3.0]]), 0.3)
    told = np.zeros(5001, dtype=bool)
    told[near] = True
    assert told[np.abs(3.0 * rows[:, 0]) <= 0.3].all()
    assert not told[np.abs(3.0 * rows[:, 0]) > 0.3001].any()


def test_no_rows_have_no_signs():
    words, near, products = ProductSigns(np.empty((0, 3))).over(np.ones((2, 3)))
    assert words.size == near.size == products.size == 0


@pytest.mark.parametrize("n", [1, 13, 64])
def test_column_i_is_bit_i(n):
    bits = np.random.default_rng(0).random((50, n)) < 0.5
    np.testing.assert_array_equal(unpacked(packed(bits), 64)[:, :n], bits)
    assert not unpacked(packed(bits), 64)[:, n:].any()
