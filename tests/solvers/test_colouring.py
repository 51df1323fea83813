"""Fewest groups: graphs of known number, and every colouring of small ones."""

import itertools

import numpy as np
import pytest

from solvers.colouring import fewest_colours


def graph(n, edges):
    conflicts = np.zeros((n, n), dtype=bool)
    for i, j in edges:
        conflicts[i, j] = conflicts[j, i] = True
    return conflicts


def cycle(n):
    return graph(n, [(i, (i + 1) % n) for i in range(n)])


def mycielski(conflicts):
    """One colour more, no larger clique: a copy of each vertex, and one for all."""
    n = len(conflicts)
    edges = [tuple(e) for e in np.argwhere(np.triu(conflicts))]
    edges += [(n + i, j) for i in range(n) for j in np.flatnonzero(conflicts[i])]
    return graph(2 * n + 1, edges + [(n + i, 2 * n) for i in range(n)])


def colourable(conflicts, k):
    """Whether any of the k^n colourings is one."""
    n = len(conflicts)
    every = np.indices((k,) * n).reshape(n, k**n)
    i, j = np.nonzero(np.triu(conflicts))
    return bool((every[i] != every[j]).all(axis=0).any())


def largest_clique_by_brute_force(conflicts):
    n = len(conflicts)
    return max(
        k
        for k in range(n + 1)
        for chosen in itertools.combinations(range(n), k)
        if all(conflicts[i, j] for i, j in itertools.combinations(chosen, 2))
    )


def assert_proved(found, conflicts):
    for group in found.groups:
        assert not conflicts[np.ix_(group, group)].any()
    assert sorted(v for group in found.groups for v in group) == list(
        range(len(conflicts))
    )
    clique = np.ix_(found.clique, found.clique)
    assert conflicts[clique].sum() == len(found.clique) * (len(found.clique) - 1)
    assert found.lower_bound == found.n_colours
    alike = len(found.clique) == found.n_colours
    assert found.proof == ("clique" if alike else "exhaustion")


@pytest.mark.parametrize(
    ("conflicts", "count", "proof"),
    [
        (np.zeros((0, 0), dtype=bool), 0, "clique"),
        (graph(1, []), 1, "clique"),
        (graph(4, []), 1, "clique"),
        (cycle(6), 2, "clique"),
        (cycle(7), 3, "exhaustion"),
        (~np.eye(5, dtype=bool), 5, "clique"),
        # Groetzsch's graph: no triangle, and 3 colours aren't enough.
        (mycielski(cycle(5)), 4, "exhaustion"),
        (mycielski(mycielski(cycle(5))), 5, "exhaustion"),
    ],
)
def test_graphs_of_known_number(conflicts, count, proof):
    found = fewest_colours(conflicts)
    assert (found.n_colours, found.proof) == (count, proof)
    assert_proved(found, conflicts)


def test_random_graphs_against_every_colouring():
    rng = np.random.default_rng(0)
    proofs = set()
    for trial in range(150):
        n = int(rng.integers(1, 8))
        upper = np.triu(rng.random((n, n)) < rng.uniform(0.1, 0.9), 1)
        conflicts = upper | upper.T
        found = fewest_colours(conflicts)
        assert_proved(found, conflicts)
        assert not colourable(conflicts, found.n_colours - 1), trial
        assert len(found.clique) == largest_clique_by_brute_force(conflicts)
        proofs.add(found.proof)
    assert proofs == {"clique", "exhaustion"}


def test_groups_begin_with_their_first_members_and_are_the_same_each_time():
    rng = np.random.default_rng(3)
    upper = np.triu(rng.random((25, 25)) < 0.4, 1)
    found, again = (fewest_colours(upper | upper.T) for _ in range(2))
    assert found.groups == again.groups
    firsts = [group[0] for group in found.groups]
    assert firsts == sorted(firsts)
    assert_proved(found, upper | upper.T)


def test_work_that_runs_out_claims_no_proof():
    conflicts = mycielski(mycielski(cycle(5)))
    found = fewest_colours(conflicts, max_nodes=1)
    assert found.proof == "none"
    assert len(found.clique) <= found.lower_bound < found.n_colours
    assert found.n_colours >= 5
    for group in found.groups:
        assert not conflicts[np.ix_(group, group)].any()


@pytest.mark.parametrize(
    ("conflicts", "message"),
    [
        (np.zeros((2, 3), dtype=bool), "square"),
        (np.zeros((2, 2)), "boolean"),
        (np.array([[False, True], [False, False]]), "symmetric"),
        (np.eye(2, dtype=bool), "its own conflict"),
    ],
)
def test_tables_that_are_no_graph_are_refused(conflicts, message):
    with pytest.raises(ValueError, match=message):
        fewest_colours(conflicts)
