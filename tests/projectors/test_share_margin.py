"""The margin at a share, and the cover of largest margin, against trying all."""

import itertools

import numpy as np
import pytest

from planning.projectors.share_margin import (
    enough_lit,
    margin_at_share,
    widest_selection,
)

STEP = np.radians(0.25)


def random_margins(seed, n=60, m=9):
    """Some pairs are unlit; the others have up to 30 degrees."""
    rng = np.random.default_rng(seed)
    margin = np.radians(rng.uniform(0, 30, (n, m)))
    return np.where(rng.random((n, m)) < 0.4, margin, -np.inf)


def test_margin_at_share_is_that_of_the_last_sample_that_counts():
    margin = np.array([[0.1, -np.inf], [0.2, 0.3], [-np.inf, -np.inf], [0.05, 0.2]])
    found = [margin_at_share(margin, required) for required in (1, 2, 3, 4, 5)]
    assert found == [0.3, 0.2, 0.1, -np.inf, -np.inf]


def test_what_is_lit_beyond_the_share_is_spared_where_it_was_there():
    lit = np.where(np.arange(1000)[:, None] < 905, 0.1, -np.inf)
    assert not enough_lit(lit, 900, before=940)
    assert not enough_lit(lit, 900, before=906)
    assert enough_lit(lit, 900, before=905)
    assert enough_lit(lit, 895, before=940)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("given", [0, 2])
def test_no_other_selection_has_more_margin(seed, given):
    margin = random_margins(seed)
    count, required = 4, 36
    chosen = np.arange(count)
    lit = int(np.isfinite(margin[:, chosen]).any(axis=1).sum())
    if lit < required:
        pytest.skip("these four light too little to begin with")
    found = widest_selection(margin, chosen, required, seed=0, n_existing=given)
    assert len(found) == count
    assert set(range(given)) <= set(found.tolist())
    best = max(
        margin_at_share(margin[:, list(other)], required)
        for other in itertools.combinations(range(9), count)
        if set(range(given)) <= set(other)
        and enough_lit(margin[:, list(other)], required, lit)
    )
    reached = margin_at_share(margin[:, found], required)
    assert enough_lit(margin[:, found], required, lit)
    assert best - STEP <= reached <= best


def test_a_cover_that_nothing_beats_stays():
    margin = np.where(np.eye(3) > 0, 0.1, -np.inf).repeat(5, axis=0)
    chosen = np.array([0, 1, 2])
    assert widest_selection(margin, chosen, 15, seed=0).tolist() == [0, 1, 2]
