"""Fewest candidates: against brute force, with every figure of the certificate."""

import itertools

import numpy as np
import pytest

from planning.proofs.candidate_certificate import certified
from planning.proofs.marginals import marginals
from planning.proofs.quotas import RegionFloors
from planning.proofs.selection import CandidateCover, select_fewest


def brute(covers, required, count):
    """Most rows that `count` columns cover."""
    return max(
        covers[:, list(c)].any(axis=1).sum()
        for c in itertools.combinations(range(covers.shape[1]), count)
    )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [0.7, 0.9, 1.0])
def test_count_bound_and_areas_against_brute_force(seed, share):
    rng = np.random.default_rng(seed)
    covers = rng.random((60, 9)) < 0.35
    reachable = int(covers.any(axis=1).sum())
    required = int(np.ceil(share * reachable - 1e-9))
    best = {k: brute(covers, required, k) for k in range(1, 10)}
    fewest = min(k for k in best if best[k] >= required)
    cover = CandidateCover(covers, share)
    found = select_fewest(cover)
    assert found.required == required
    assert found.needed == len(found.chosen) == fewest
    assert found.lower_bound <= fewest
    assert found.status == ("optimal" if found.lower_bound == fewest else "feasible")
    assert found.status == "optimal"
    assert found.n_covered == best[fewest] <= found.n_covered_bound
    others = marginals(cover, found)
    for count, (rows, bound) in others.n_covered.items():
        assert rows == best[count] <= bound
        assert count >= fewest or bound < required
    assert list(others.by_count) == list(range(1, min(fewest + 2, 9) + 1))
    assert others.by_count[fewest].tolist() == found.chosen.tolist()
    for count, chosen in others.by_count.items():
        assert len(chosen) <= count
        assert covers[:, chosen].any(axis=1).sum() == best[count]
    assert others.greedy >= fewest


def test_too_few_allowed_gives_the_best_of_them_and_what_would_be_needed():
    covers = np.kron(np.eye(4, dtype=bool), np.ones((5, 1), dtype=bool))
    cover = CandidateCover(covers, 1.0, max_count=2)
    found = select_fewest(cover)
    assert found.status == "infeasible"
    assert len(found.chosen) == 2
    assert found.n_covered == found.n_covered_bound == 10
    assert (found.needed, found.lower_bound) == (4, 4)
    others = marginals(cover, found)
    assert others.n_covered == {1: (5, 5), 2: (10, 10), 3: (15, 15), 4: (20, 20)}
    assert covers[:, others.by_count[4]].any(axis=1).all()
    _, proof = certified(cover, found, 0.5)
    proof = proof.to_document()
    assert proof["one_fewer"] == {"upper_bound_m2": 2.5, "scope": "candidates"}
    assert proof["count"] == 2
    assert proof["needed"] == {"count": 4, "lower_bound": 4}
    assert proof["best_area"] == {
        "value_m2": 5.0,
        "upper_bound_m2": 5.0,
        "scope": "candidates",
    }
    assert proof["required_m2"] == 10.0
    assert proof["candidates"]["lower_bound"] <= proof["count"]


def test_rows_out_of_reach_are_left_out_of_the_requirement():
    covers = np.zeros((10, 2), dtype=bool)
    covers[:4, 0] = covers[4:6, 1] = True
    found = select_fewest(CandidateCover(covers, 0.6))
    assert found.required == 4
    assert found.chosen.tolist() == [0]


def test_the_same_question_gets_the_same_answer():
    covers = np.random.default_rng(5).random((120, 30)) < 0.3
    first = select_fewest(CandidateCover(covers, 0.95, seed=3))
    again = select_fewest(CandidateCover(covers, 0.95, seed=3))
    assert first.chosen.tolist() == again.chosen.tolist()
    assert first.lower_bound == again.lower_bound


@pytest.mark.parametrize(("dark", "total"), [(10, 2), (30, 3)])
def test_a_certificate_says_what_the_total_takes_without_floors(dark, total):
    """Two candidates cover all but a region, a third that: 90 % takes `total`."""
    covers = np.zeros((100, 3), dtype=bool)
    half = (100 - dark) // 2
    covers[:half, 0] = covers[half : 2 * half, 1] = covers[2 * half :, 2] = True
    floors = RegionFloors(np.repeat([0, 1], [100 - dark, dark]), 2, 0.5)
    for most in (None, 2):
        cover = CandidateCover(covers, 0.9, max_count=most, regions=floors)
        _, proof = certified(cover, select_fewest(cover), 1.0)
        assert (proof.needed.count, proof.needed.lower_bound) == (3, 3)
        assert proof.candidates.for_total == total
    plain = CandidateCover(covers, 0.9)
    assert certified(plain, select_fewest(plain), 1.0)[1].candidates.for_total is None


def test_no_more_of_a_route_are_told_to_cover_less_than_fewer():
    """Its pair goes by floors, and covers half as much as its first does alone."""
    covers = np.zeros((100, 5), dtype=bool)
    covers[:60, 0] = covers[60:80, 1] = covers[80:95, 2] = covers[95:, 3] = True
    covers[60:65, 4] = True
    cover = CandidateCover(covers, 1.0)
    passed = {1: [0], 2: [1, 4], 3: [0, 1, 2], 4: [0, 1, 2, 3]}
    route = {n: np.array(of) for n, of in passed.items()}
    others, proof = certified(cover, select_fewest(cover), 1.0, None, route)
    areas = {row.count: row.value_m2 for row in proof.by_count}
    assert [areas[n] for n in (1, 2, 3)] == [60.0, 80.0, 95.0]
    assert [others[n].tolist() for n in (1, 2, 3)] == [[0], [0, 1], [0, 1, 2]]
