"""The margin at a share, and the cover of largest margin, against trying all."""

import itertools

import numpy as np
import pytest

from planning.projectors.share_margin import (
    lit_by_any,
    margin_at_share,
    to_keep,
    widest_selection,
)
from planning.proofs.quotas import Quotas, RegionFloors

STEP = np.radians(0.25)


def random_margins(seed, n=60, m=9):
    """Some pairs are unlit; the others have up to 30 degrees."""
    rng = np.random.default_rng(seed)
    margin = np.radians(rng.uniform(0, 30, (n, m)))
    return np.where(rng.random((n, m)) < 0.4, margin, -np.inf)


def test_margin_at_share_is_that_of_the_last_sample_that_counts():
    margin = np.array([[0.1, -np.inf], [0.2, 0.3], [-np.inf, -np.inf], [0.05, 0.2]])
    found = [margin_at_share(margin, required) for required in range(6)]
    assert found == [np.inf, 0.3, 0.2, 0.1, -np.inf, -np.inf]


def total(n, required):
    """So many of n samples, and no floor of any region."""
    return Quotas(required, RegionFloors.none(n), np.zeros(1, dtype=int))


def enough_lit(margin, required, before):
    """Whether fresh samples should confirm it, where so many were lit before."""
    then = np.where(np.arange(len(margin))[:, None] < before, 0.1, -np.inf)
    return to_keep(then, total(len(margin), required)).enough(lit_by_any(margin))


def test_what_is_lit_beyond_the_share_is_spared_where_it_was_there():
    lit = np.where(np.arange(1000)[:, None] < 905, 0.1, -np.inf)
    assert not enough_lit(lit, 900, before=940)
    assert not enough_lit(lit, 900, before=906)
    assert enough_lit(lit, 900, before=905)
    assert enough_lit(lit, 895, before=940)


def test_wider_margins_do_not_give_up_the_floor_of_a_region():
    # Ten samples of 100 are a region; one projector of wide margin misses them.
    region = RegionFloors(np.repeat([0, 1], [90, 10]), 2, 0.5)
    margin = np.full((100, 3), -np.inf)
    margin[:95, 0], margin[:90, 1], margin[:96, 2] = 0.1, 0.4, 0.2
    quotas = Quotas.of(region, np.ones(100, dtype=bool), 0.9)
    first = np.array([0])
    assert widest_selection(margin, first, quotas, seed=0).tolist() == [2]
    alone = widest_selection(margin, first, total(100, 89), seed=0)
    assert alone.tolist() == [1]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("given", [0, 2])
def test_no_other_selection_has_more_margin(seed, given):
    margin = random_margins(seed)
    count, required = 4, 36
    chosen = np.arange(count)
    lit = int(np.isfinite(margin[:, chosen]).any(axis=1).sum())
    if lit < required:
        pytest.skip("these four light too little to begin with")
    found = widest_selection(
        margin, chosen, total(60, required), seed=0, n_existing=given
    )
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
    assert widest_selection(margin, chosen, total(15, 15), seed=0).tolist() == [0, 1, 2]
