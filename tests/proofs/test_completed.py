"""Covers that fresh samples deny: candidates are added, and what is proved stays."""

import itertools

import numpy as np
import pytest

from planning.proofs.completed import completed, greedy_cover
from planning.proofs.device_stock import DeviceStock
from planning.proofs.selection import CandidateCover, select_fewest


def drawn(seed, share=0.9, rows=40, **more):
    """A cover of few samples, and of many others by the same candidates."""
    rng = np.random.default_rng(seed)
    reach = rng.uniform(0.1, 0.4, 12)
    few, many = (rng.random((n, 12)) < reach for n in (rows, 30 * rows))
    return CandidateCover(few, share, **more), CandidateCover(many, share)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_added_is_enough_of_the_fresh_and_no_bound_is_beaten(seed):
    cover, fresh = drawn(seed)
    found = select_fewest(cover)
    assert not fresh.enough(found.chosen)
    more = completed(cover, found, fresh)
    count = len(more.chosen)
    assert more.chosen[: found.needed].tolist() == found.chosen.tolist()
    assert fresh.enough(more.chosen)
    assert not fresh.enough(more.chosen[:-1])
    assert more.status == "feasible"
    assert more.needed == count > found.needed
    assert (more.lower_bound, more.proof) == (found.lower_bound, found.proof)
    assert more.n_covered == cover.n_covered(more.chosen) >= found.n_covered
    every = itertools.combinations(range(12), count)
    most = max(cover.n_covered(np.array(some)) for some in every)
    assert most <= more.n_covered_bound <= len(cover.covers)


def test_no_more_are_added_than_are_allowed():
    cover, fresh = drawn(0)
    unbound = completed(cover, select_fewest(cover), fresh)
    cover, _ = drawn(0, max_count=unbound.needed - 1)
    found = select_fewest(cover)
    more = completed(cover, found, fresh)
    assert more.chosen.tolist() == unbound.chosen[:-1].tolist()
    cover, _ = drawn(0, max_count=found.needed)
    found = select_fewest(cover)
    assert completed(cover, found, fresh) is found


def test_of_too_few_it_is_the_smallest_cover_that_grows():
    cover, fresh = drawn(0, max_count=2)
    found = select_fewest(cover)
    assert found.status == "infeasible"
    more = completed(cover, found, fresh)
    assert fresh.enough(more.smallest)
    assert more.needed > found.needed
    assert more.chosen is found.chosen
    assert (more.status, more.n_covered) == ("infeasible", found.n_covered)


def test_where_nothing_is_lacking_or_nothing_left_it_stays():
    cover, fresh = drawn(1)
    found = select_fewest(cover)
    assert completed(cover, found, cover) is found
    # Two of the one model, and none adds what the other lacks.
    stock = DeviceStock(np.zeros(12, dtype=np.int64), np.array([found.needed]))
    short = CandidateCover(fresh.covers, 0.9, stock=stock)
    assert completed(cover, found, short) is found


def test_the_greedy_cover_takes_what_adds_most_and_the_first_of_equals():
    covers = np.zeros((10, 4), dtype=bool)
    covers[:3, 0] = covers[2:7, 1] = covers[2:7, 2] = covers[7:, 3] = True
    none = np.zeros(0, dtype=np.int64)
    assert greedy_cover(CandidateCover(covers, 1.0), none).tolist() == [1, 3, 0]
    assert greedy_cover(CandidateCover(covers, 0.5), none).tolist() == [1]
    begun = np.array([2])
    assert greedy_cover(CandidateCover(covers, 0.8), begun).tolist() == [2, 3]
