"""Poses between the candidates save a projector where free poses need one fewer.

Parallel light within 45 degrees lights caps of (1 - cos 45)/2 = 0.146 of a ball. Six,
90 degrees apart, don't overlap and light 0.879; five light 0.732 at most. So 0.875
takes six, and only if they stand just there: a coarse lattice needs seven.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene

from geometry.shapes.primitives import sphere
from planning.projectors.candidate_set import CandidateSet, CandidateSource
from planning.projectors.fewest_projectors import Found, Search, confirms
from planning.projectors.one_fewer import _swapped, one_fewer
from planning.projectors.share_margin import margin_at_share, widest_between
from planning.proofs.quotas import Quotas, RegionFloors, missed_shares
from planning.proofs.selection import select_fewest
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import DRAWS, Draw
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.limits import projector_limits
from planning.scene.workspace.candidates import Candidates


@pytest.fixture(scope="module")
def ball():
    mesh = sphere(0.1, subdivisions=4)
    rig = load_rig("default", light="parallel")
    required = make_requirements(mesh, rig, max_projectors=9)
    limits = replace(required.projector, max_incidence=np.radians(45.0))
    required = replace(required, projector=limits, dominant_coverage=0.875)
    scene = make_scene(mesh, required)
    radii = uniform_radii(0.15, 0.0035)
    return scene, make_projector(rig, radii)


@pytest.fixture(scope="module")
def lattice(ball):
    scene, template = ball
    poses = Candidates(template, scene.requirements.workspace).over(40)
    samples = scene.target_samples(Draw(2000, 100))
    return CandidateSource(scene, (template,)), CandidateSet.over(scene, samples, poses)


def test_fresh_samples_deny_as_if_all_candidates_were_asked(lattice, monkeypatch):
    """Of what any of 40 candidates reaches, which are asked 3, 6, 12, ... at a time."""
    monkeypatch.setattr("planning.projectors.fewest_projectors._FIRST_ASKED", 3)
    _, offer = lattice
    fresh = offer.on(offer.scene.target_samples(DRAWS.fresh_projectors.later(1)))
    rng, answers = np.random.default_rng(5), []
    for share in np.linspace(0.5, 1.0, 40):
        required = replace(offer.scene.requirements, dominant_coverage=share)
        asking = replace(offer, scene=offer.scene.asking(required))
        few = rng.choice(40, 6, replace=False)
        lit = fresh.lit[:, few].any(axis=1)
        answers.append(lit.sum() >= share * fresh.reached.sum())
        assert confirms(asking, offer.of(few), 1) == answers[-1]
    assert 3 < sum(answers) < 37


@pytest.mark.parametrize(("allowed", "longer"), [(9, 1), (3, 0)])
def test_a_longer_proof_is_of_a_count_that_may_be_taken(
    ball, monkeypatch, allowed, longer
):
    """Six caps; each bound is said to be open after the first work."""
    (scene, template), asked = ball, []

    def open_after(cover, *, budget=None, **how):
        asked.append(budget)
        return replace(select_fewest(cover, **how), lower_bound=1)

    monkeypatch.setattr(
        "planning.projectors.fewest_projectors.select_fewest", open_after
    )
    scene = scene.asking(replace(scene.requirements, max_projectors=allowed))
    source = CandidateSource(scene, (template,))
    candidates = CandidateSet.over(
        scene, scene.target_samples(Draw(500, 100)), source.lattice(40)
    )
    none = Found(candidates, select_fewest(candidates.cover), 0, confirmed=False)
    found = Search(source, 40, 80, rounds=1).fewest(none)
    assert len(found.selection.chosen) == min(found.selection.needed, allowed)
    assert sum(budget is not None for budget in asked) == longer


def moved(lattice, n_projectors, n_existing=0):
    source, offer = lattice
    offer = replace(offer, n_existing=n_existing)
    return one_fewer(
        source, offer, n_projectors, finer=lambda: offer, reached=offer.reached
    )


def test_six_caps_are_found_where_the_lattice_needs_seven(lattice):
    alone = select_fewest(lattice[1].cover)
    assert alone.needed == alone.lower_bound == 7
    found = moved(lattice, 6)
    assert found is not None
    assert found.reached.sum() >= 1750
    axes = np.array([p.world_from_device[:3, 2] for p in found.projectors])
    apart = np.degrees(np.arccos(np.clip(axes @ axes.T, -1.0, 1.0)))
    assert np.min(apart + 360 * np.eye(6)) > 80.0


def test_what_stands_already_counts_and_is_not_offered_again(lattice):
    offer = lattice[1]
    found = moved(lattice, 6, n_existing=1)
    assert found is not None
    assert len(found.projectors) == 5
    assert all(p is not offer.projectors[0] for p in found.projectors)
    assert (offer.lit[:, 0] | found.reached).sum() >= 1750


def test_what_no_poses_can_do_is_given_up(lattice):
    assert moved(lattice, 5) is None


@pytest.mark.parametrize(("count", "near"), [(5, False), (6, True)])
@pytest.mark.long
def test_a_finer_lattice_is_asked_for_where_it_comes_near(
    lattice, count, near, monkeypatch
):
    # So coarse a lattice begins farther off than those that are planned with.
    monkeypatch.setattr("planning.projectors.one_fewer._SHORT", 0.1)
    monkeypatch.setattr("planning.projectors.one_fewer._SCALES", (1.0, 0.5))
    source, offer = lattice
    # Six caps light 0.879 of the ball, about 1,800 of these; five light far less.
    share = 1815 / int(offer.reached.sum())
    beyond = replace(offer.scene.requirements, dominant_coverage=share)
    offer = replace(offer, scene=replace(offer.scene, requirements=beyond))
    asked = []
    found = one_fewer(
        source,
        offer,
        count,
        finer=lambda: asked.append(count) or offer,
        reached=offer.reached,
    )
    assert found is None
    assert bool(asked) is near


def test_what_any_known_pose_reaches_is_asked_for(lattice):
    source, offer = lattice
    # One pose reaches what it lights, and 0.875 of that is lit by it alone.
    one = offer.take(np.arange(1))
    for reached, enough in ((one.reached, True), (np.ones_like(one.reached), False)):
        found = one_fewer(source, one, 1, finer=lambda: one, reached=reached)
        assert (found is not None) is enough


@dataclass
class Poses:
    """What random poses light of random samples; the first one stands already."""

    lit: np.ndarray
    n_existing: int = 1
    stock: None = None


@pytest.mark.parametrize("seed", range(5))
def test_no_other_pose_in_the_place_of_one_misses_less_of_floors_and_all(seed):
    rng = np.random.default_rng(seed)
    poses = Poses(rng.random((80, 30)) < 0.35)
    regions = RegionFloors(rng.integers(0, 4, 80), 4, 0.8)
    quotas = Quotas.of(regions, np.ones(80, dtype=bool), 0.9)

    def missed(chosen):
        lit = poses.lit[:, chosen].any(axis=1)
        short = [max(0, quotas.total - lit.sum()) / quotas.total]
        for number in (1, 2, 3):
            wanted = np.ceil(0.8 * (regions.row == number).sum())
            short.append(max(0, wanted - lit[regions.row == number].sum()) / wanted)
        assert sum(short) == pytest.approx(
            float(missed_shares(quotas, regions.counts(lit)[:, None])[0])
        )
        return sum(short), -lit.sum()

    start = np.array([0, 7, 11, 13])
    found = _swapped(poses, quotas, start)
    assert found[0] == 0
    assert len(found) == 4
    assert missed(found) < missed(start)
    others = [
        np.append(np.delete(found, i), other) for i in (1, 2, 3) for other in range(30)
    ]
    assert missed(found)[0] <= min(missed(other)[0] for other in others) + 1e-12


def test_margins_grow_between_the_poses_of_a_lattice(lattice):
    offer = lattice[1]
    scene, rows = offer.scene, offer.samples

    def margins(projectors):
        lit = lit_stages(scene, projectors, rows) == projector_limits.LIT
        return lit_margins(scene, projectors, rows, lit)

    start = offer.projectors[:3]
    required = int((margins(start) > -np.inf).any(axis=1).sum())
    before = margin_at_share(margins(start), required)
    quotas = Quotas(required, RegionFloors.none(len(rows)), np.zeros(1, dtype=int))
    moved = widest_between(scene, start, margins, quotas, len(offer.projectors))
    after = margin_at_share(margins(moved), required)
    assert len(moved) == 3
    assert after > before + np.radians(1.0)
    stands = replace(start[0], existing="P0")
    kept = widest_between(
        scene, (stands, *start[1:]), margins, quotas, len(offer.projectors)
    )
    assert kept[0] is stands
    assert all(not projector.existing for projector in kept[1:])
