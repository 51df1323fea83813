"""Certificates that so many sets are too few, against all selections looked at."""

import time
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from support.cover_proofs import best_of, certificate, random_cover

from planning.model.errors import PlanFileError
from planning.model.proofs import CoverProof
from planning.verify.audit.proofs.refutation import RefutedProofError, refute


@pytest.mark.parametrize(("seed", "n_sets"), [*product(range(8), range(6))])
def test_certificates_are_made_and_hold_where_they_are_true(
    seed: int, n_sets: int
) -> None:
    covers = random_cover(seed)
    best = best_of(covers, n_sets)
    proof = certificate(covers, n_sets, best + 1)
    assert proof is not None
    refute(covers, proof, best + 1)
    with pytest.raises(RefutedProofError, match="samples"):
        refute(covers, proof, best)
    assert certificate(covers, n_sets, best, budget=1e7) is None


@pytest.mark.parametrize("n_kept", [1, 2, 4])
def test_more_sets_than_there_are_cover_what_all_cover(n_kept: int) -> None:
    covers = random_cover(n_kept)[:, 2 : 2 + n_kept]
    most = int(covers.any(axis=1).sum())
    proof = certificate(covers, 5, most + 1)
    assert proof is not None
    refute(covers, proof, most + 1)
    assert certificate(covers, 5, most, budget=1e7) is None


def test_a_certificate_of_fewer_sets_doesnt_do_for_more() -> None:
    covers = random_cover(3)
    best = best_of(covers, 3)
    proof = certificate(covers, 3, best + 1)
    assert proof is not None
    with pytest.raises(RefutedProofError):
        refute(covers, replace(proof, n_sets=4), best + 1)


def test_sets_that_stand_for_many_are_all_counted_where_more_may_be_taken() -> None:
    """Two sets stand for all, three may be taken: together they cover all."""
    covers = np.zeros((90, 6), dtype=bool)
    for k in range(6):
        covers[15 * k : 15 * k + 15, k] = True
    covers[:, 5] |= covers[:, 4]
    every = np.zeros(90, dtype=np.int64)
    none = np.empty(0, dtype=np.int64)
    forged = CoverProof(
        draws=np.array([[90, 1, 1]]),
        points=np.zeros((90, 3)),
        faces=every,
        n_sets=3,
        stand_in=np.array([0, 0, 0, 3, 3, 3]),
        multipliers=np.full((1, 90), CoverProof.whole, dtype=np.uint8),
        nodes=np.zeros(1, dtype=np.int64),
        groups=none,
        group_ends=none,
    )
    assert best_of(covers, 3) == 60
    for required in (60, 90):
        with pytest.raises(RefutedProofError, match=r"may cover 90\.0 samples"):
            refute(covers, forged, required)


@pytest.mark.parametrize("closed", [False, True])
def test_a_tree_that_only_branches_ends_soon(closed: bool) -> None:
    """Of a set each, so that groups are many; or of one set, closed again and again."""
    n = 3000
    covers = np.zeros((250, n), dtype=bool)
    covers[0] = True
    leaf = certificate(random_cover(0), 4, best_of(random_cover(0), 4) + 1)
    assert leaf is not None
    branches = 100_000 if closed else n
    tree = replace(
        leaf,
        points=np.zeros((250, 3)),
        faces=np.zeros(250, dtype=np.int64),
        n_sets=2**62,
        stand_in=np.arange(n),
        multipliers=np.zeros((1, 250), dtype=np.uint8),
        nodes=np.full(branches, CoverProof.BRANCH),
        groups=np.zeros(branches, np.int64) if closed else np.arange(n),
        group_ends=np.arange(1, branches + 1),
    )
    begun = time.process_time()
    with pytest.raises(RefutedProofError, match="parts"):
        refute(covers, tree, 1)
    assert time.process_time() - begun < 20.0


def test_no_edit_lets_what_is_false_pass() -> None:
    """Whatever a certificate holds, sets that cover enough aren't excluded."""
    rng = np.random.default_rng(0)
    refused = 0
    for seed in range(6):
        covers = random_cover(seed, n=80)
        best = best_of(covers, 4)
        proof = certificate(covers, 4, best + 1)
        assert proof is not None
        assert len(proof.nodes) > 1
        for _ in range(150):
            try:
                edited = _edited(proof, rng)
            except PlanFileError:
                continue
            refused += 1
            with pytest.raises(RefutedProofError):
                refute(covers, edited, best)
    assert refused > 300


def _edited(proof: CoverProof, rng: np.random.Generator) -> CoverProof:
    """Return the certificate with some of its numbers others."""
    name = rng.choice(["multipliers", "nodes", "groups", "group_ends", "stand_in"])
    values = getattr(proof, name).copy()
    for _ in range(int(rng.integers(1, 4))):
        if not values.size:
            break
        at = tuple(rng.integers(size) for size in values.shape)
        values[at] = (
            rng.integers(0, 256) if name == "multipliers" else rng.integers(-2, 16)
        )
    if name == "nodes" and rng.random() < 0.3:
        values = values[: int(rng.integers(len(values) + 1))]
    return replace(proof, **{name: values})


@pytest.mark.parametrize("seed", range(4))
def test_each_part_of_a_tree_is_needed(seed: int) -> None:
    covers = random_cover(seed, n=80)
    best = best_of(covers, 4)
    proof = certificate(covers, 4, best + 1)
    assert proof is not None
    nodes = proof.nodes
    edits = {
        "parts aren't looked at": replace(proof, nodes=nodes[:-1]),
        "left over": replace(proof, nodes=np.append(nodes, nodes[-1])),
        "no multipliers": replace(
            proof, nodes=np.where(nodes >= 0, len(proof.multipliers), nodes)
        ),
        "no group": replace(
            proof, groups=proof.groups[:0], group_ends=proof.group_ends[:0]
        ),
        "exceeds": replace(proof, multipliers=proof.multipliers | 255),
        "may cover": replace(proof, multipliers=proof.multipliers * 0),
        "names none": replace(proof, groups=proof.groups * 0 + 1),
    }
    assert 1 not in proof.stand_in
    for words, edited in edits.items():
        with pytest.raises(RefutedProofError, match=words):
            refute(covers, edited, best + 1)


def test_what_stands_for_a_set_is_taken_to_cover_what_it_does() -> None:
    """A set that is left out by naming another for it leaves nothing uncounted."""
    covers = np.zeros((9, 3), dtype=bool)
    covers[:3, 0] = covers[3:6, 1] = covers[6:, 2] = True
    proof = certificate(covers, 1, 4)
    assert proof is not None
    refute(covers, proof, 4)
    with pytest.raises(RefutedProofError, match="1 candidates cover 9 samples"):
        refute(covers, replace(proof, stand_in=np.zeros(3, dtype=np.int64)), 4)


def test_groups_that_share_a_set_are_refused() -> None:
    """One set could stand for both, and the bound would count two of the budget."""
    covers = np.zeros((14, 5), dtype=bool)
    covers[:4, 0] = covers[4:8, 1] = covers[8:12, 2] = True
    covers[12, 3] = covers[13, 4] = True
    proof = certificate(covers, 3, 13)
    assert proof is not None
    edited = replace(
        proof,
        stand_in=np.arange(5),
        multipliers=np.full((1, 14), proof.whole, dtype=np.uint8),
        nodes=np.array([-1, -1, 0, 0, 0]),
        groups=np.array([0, 3, 0, 4]),
        group_ends=np.array([2, 4]),
    )
    with pytest.raises(RefutedProofError, match="sets in common"):
        refute(covers, edited, best_of(covers, 3))
