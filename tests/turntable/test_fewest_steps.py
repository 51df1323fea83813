"""The fewest steps of small tables, against every choice of places and angles."""

from dataclasses import replace
from itertools import combinations, product
from math import comb
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.mesh.sampling import SurfaceSamples
from planning.cameras.stations.heads.head_cover import HeadCover
from planning.cameras.stations.turntable.fewest_steps import StepSearch
from planning.cameras.stations.turntable.sample_bits import (
    are_enough_together,
    rows_together,
    subsets,
)
from planning.cameras.stations.turntable.table_sets import TableSets
from planning.scene.samples import Target

ANGLES, CIRCLES, N = 6, 2, 40


class _Lattice:
    """Places alone: six on each of two circles, cameras one place on at most."""

    n_places = ANGLES
    offsets = np.array([-1, 0, 1])
    projectors = cameras = (None,) * CIRCLES

    def __init__(self, stride=1):
        self.stride, self.n_angles = stride, ANGLES // stride


class _Room:
    """Places that are free, and what stands still between a place and samples."""

    def __init__(self, room=None, hidden=None):
        self.room = np.ones(ANGLES, dtype=bool) if room is None else room
        self.hidden, self.is_empty = hidden, hidden is None

    def begins(self, lamps, eyes):
        free = [np.roll(self.room, -place) for _, place in (*lamps, *eyes)]
        return np.flatnonzero(np.all(free, axis=0))

    def clear(self, lamps, eyes, angles, begins):
        kinds = [*((0, lamp) for lamp in lamps), *((1, eye) for eye in eyes)]
        for by in begins:
            clear = np.zeros((len(kinds), ANGLES, N), dtype=bool)
            for d, (kind, (circle, place)) in enumerate(kinds):
                for angle in angles:
                    at = (place + by) % ANGLES, (angle + by) % ANGLES
                    clear[d, angle] = ~self.hidden[kind, circle, *at]
            yield clear


def _search(seed, *, room=None, coverage=0.8, stride=1, hidden=0.0):
    rng = np.random.default_rng(seed)
    lit = rng.random((CIRCLES, ANGLES, N)) < 0.5
    measured = rng.random((CIRCLES, ANGLES, CIRCLES, 3, N)) < 0.6
    measured &= lit[:, :, None, None]
    points = rng.normal(size=(N, 3))
    target = Target(SurfaceSamples(points, points, np.arange(N), 1.0), 0.0 * points)
    required = SimpleNamespace(
        dominant_coverage=0.6, coverage=coverage, region_coverage=0.0
    )
    scene = SimpleNamespace(
        requirements=required,
        seed=0,
        check_cancelled=lambda: None,
        floor_rows=lambda samples, kind: (np.zeros(len(samples), np.int64), 1, 0.0),
    )
    solid = rng.random((2, CIRCLES, ANGLES, ANGLES, N)) < hidden if hidden else None
    sets = TableSets(_Lattice(stride), target, lit, measured)
    return StepSearch.of(scene, sets, _Room(room, solid))


def _enough(search, lamps, eyes, angles):
    """By the tensors alone: what any pair does at any of the angles."""
    sets, lattice, hidden = search.sets, search.sets.lattice, search.room.hidden
    if hidden is None:
        hidden = np.zeros((2, CIRCLES, ANGLES, ANGLES, N), dtype=bool)
    lit, measured = np.zeros((2, N), dtype=bool)
    for j, (e, i) in product(angles, lamps):
        reached = ~hidden[0, e, i, j]
        lit |= sets.lit[e, (i - j) % ANGLES] & reached
        for f, k in eyes:
            apart = (k - i + ANGLES // 2) % ANGLES - ANGLES // 2
            for column in np.flatnonzero(lattice.offsets == apart):
                both = reached & ~hidden[1, f, k, j]
                measured |= sets.measured[e, (i - j) % ANGLES, f, column] & both
    able, required = sets.measured.any(axis=(0, 1, 2, 3)), search.scene.requirements
    least_lit = required.dominant_coverage * sets.lit.any(axis=(0, 1)).sum()
    due = required.coverage * (lit & able).sum()
    return lit.sum() >= least_lit - 1e-9 and measured.sum() >= due - 1e-9


def _brute(search, n_lamps, n_eyes):
    """The fewest angles over all places of all devices; None: never enough."""
    places, lattice = list(product(range(CIRCLES), range(ANGLES))), search.sets.lattice
    every = range(0, ANGLES, lattice.stride)
    for count in range(1, lattice.n_angles + 1):
        for lamps in combinations(places, n_lamps):
            for eyes in combinations(places, n_eyes):
                if 0 not in search.room.begins(lamps, eyes):
                    continue
                for angles in combinations(every, count):
                    if _enough(search, lamps, eyes, angles):
                        return count
    return None


@pytest.mark.parametrize("seed", [0, 1, 5])
@pytest.mark.parametrize(("n_lamps", "n_eyes"), [(1, 1), (1, 2), (2, 1)])
def test_the_fewest_steps_are_those_of_all_choices(seed, n_lamps, n_eyes):
    search = _search(seed)
    steps, least = search.fewest(n_lamps, n_eyes, ANGLES)
    truth = _brute(search, n_lamps, n_eyes)
    if truth is None:
        assert steps is None
        assert least > ANGLES
        return
    assert len(steps.angles) == truth == least == steps.lower_bound
    assert (len(steps.lamps), len(steps.eyes)) == (n_lamps, n_eyes)
    assert _enough(search, steps.lamps, steps.eyes, steps.angles)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n_eyes", [1, 2])
@pytest.mark.parametrize("stride", [2, 3])
def test_devices_may_stand_between_the_angles_of_a_table(seed, n_eyes, stride):
    room = np.array([True, True, True, True, False, True])
    search = _search(seed, room=room, coverage=0.6, stride=stride)
    steps, least = search.fewest(1, n_eyes, ANGLES)
    truth = _brute(search, 1, n_eyes)
    if truth is None:
        assert steps is None
        assert least > ANGLES // stride
        return
    assert len(steps.angles) == truth == least
    assert not (steps.angles % stride).any()
    assert all(room[place] for _, place in (*steps.lamps, *steps.eyes))
    assert _enough(search, steps.lamps, steps.eyes, steps.angles)


@pytest.mark.parametrize("limit", ["_ALL", "_STOOD"])
def test_a_cut_search_finds_steps_and_claims_no_more_than_it_proved(monkeypatch, limit):
    """As good as nothing is looked at; what is found is enough, and no bound false."""
    module = "planning.cameras.stations.turntable.fewest_steps"
    cut = 0
    for seed in range(4):
        search = _crowded(seed) if limit == "_STOOD" else _search(seed)
        with monkeypatch.context() as patch:
            patch.setattr(f"{module}.{limit}", 1)
            steps, least = search.fewest(1, 2, ANGLES)
        truth = _brute(search, 1, 2)
        cut += steps.proof != "every choice of places and angles"
        assert least <= truth <= len(steps.angles)
        assert steps.lower_bound == least
        assert _enough(search, steps.lamps, steps.eyes, steps.angles)
    assert cut


class _Crowded(_Room):
    """Of two cameras there is room where they are on different circles alone.

    And beside the second circle's projector alone.
    """

    def begins(self, lamps, eyes):
        apart = len({circle for circle, _ in eyes}) == len(eyes)
        one = {circle for circle, _ in lamps} == {1}
        return super().begins(lamps, eyes) if apart and one else np.array([], dtype=int)


def _crowded(seed):
    search = _search(seed, coverage=0.7, hidden=1e-9)
    return replace(search, room=_Crowded(hidden=search.room.hidden))


@pytest.mark.parametrize("seed", range(8))
def test_where_cameras_that_measure_most_have_no_room_others_are_drawn(
    monkeypatch, seed
):
    """A cut search finds what there is, and one with few tries what is the fewest."""
    search = _crowded(seed)
    truth = _brute(search, 1, 2)
    module = "planning.cameras.stations.turntable.fewest_steps"
    assert truth is not None
    with monkeypatch.context() as patch:
        patch.setattr(f"{module}._ALL", 1)
        steps, least = search.fewest(1, 2, ANGLES)
        assert least <= truth <= len(steps.angles)
        assert {circle for circle, _ in steps.eyes} == {0, 1}
        assert _enough(search, steps.lamps, steps.eyes, steps.angles)
    monkeypatch.setattr(f"{module}._TURN", 2)
    monkeypatch.setattr(f"{module}._TRIED", 10**5)
    steps, least = search.fewest(1, 2, ANGLES)
    assert len(steps.angles) == truth == least == steps.lower_bound


def test_turns_that_end_early_leave_no_choice_out(monkeypatch):
    """Each of all choices is tried once, and refuted is what none of them meets."""
    search, tried = _search(0, coverage=0.6, hidden=0.15), []
    module = "planning.cameras.stations.turntable"
    monkeypatch.setattr(f"{module}.fewest_steps._TURN", 1)
    monkeypatch.setattr(f"{module}.fewest_steps._LONGER", 2)

    def never(_, lamps, eyes, angles):
        tried.append((lamps, eyes, tuple(angles)))

    monkeypatch.setattr(f"{module}.standing_steps.StandingSteps.enough", never)
    monkeypatch.setattr(f"{module}.fewest_steps._TRIED", 10**6)
    steps, least = search.fewest(1, 2, 3)
    assert steps is None
    assert least == 4
    assert len(tried) == len(set(tried)) > 50


def test_devices_stand_where_the_room_lets_them():
    room = np.array([True, True, False, False, False, False])
    search = _search(2, room=room, coverage=0.6)
    steps, _ = search.fewest(1, 1, ANGLES)
    assert all(room[place] for _, place in (*steps.lamps, *steps.eyes))
    assert _enough(search, steps.lamps, steps.eyes, steps.angles)
    assert len(steps.angles) == _brute(search, 1, 1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("n_lamps", "n_eyes"), [(1, 1), (1, 2), (2, 1)])
def test_what_stands_still_is_in_the_way_at_each_angle_anew(seed, n_lamps, n_eyes):
    """Then it isn't the same where devices begin, and every beginning is looked at."""
    search = _search(seed, coverage=0.6, hidden=0.15)
    steps, least = search.fewest(n_lamps, n_eyes, ANGLES)
    truth = _brute(search, n_lamps, n_eyes)
    if truth is None:
        assert steps is None
        return
    assert len(steps.angles) == truth == least
    assert _enough(search, steps.lamps, steps.eyes, steps.angles)


def test_fewer_steps_than_it_takes_are_none_and_the_bound_says_so():
    search = _search(0)
    steps, _ = search.fewest(1, 1, ANGLES)
    none, least = search.fewest(1, 1, len(steps.angles) - 1)
    assert none is None
    assert least == len(steps.angles)


def test_at_least_a_share_of_the_light_that_any_pair_measures_is_asked():
    search = _search(5)
    lit, measured = search.sets.everywhere().lit, search.sets.everywhere().measured
    least_lit = int(np.ceil(0.6 * lit.sum() - 1e-9))
    due = 0.8 * (least_lit - (lit.sum() - measured.sum()))
    assert search.cover.asked == (least_lit, int(np.ceil(due - 1e-9)))
    assert isinstance(search.cover, HeadCover)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_rows_that_hold_enough_together_are_all_found(count):
    rng = np.random.default_rng(count)
    rows = rng.random((7, 24)) < 0.35
    bits, asked = np.packbits(rows, axis=1), 15
    found = set(rows_together(bits, count, asked))
    truth = {
        chosen
        for chosen in combinations(range(7), count)
        if rows[list(chosen)].any(axis=0).sum() >= asked
    }
    assert {tuple(sorted(chosen)) for chosen in found} == truth
    for most in range(25):
        some = next(rows_together(bits, count, most), None) is not None
        assert are_enough_together(bits, count, most) == some
    assert not are_enough_together(bits[:0], count, 0)


@pytest.mark.parametrize("count", [1, 4, 5])
def test_subsets_are_all_there_are_and_each_once(count):
    """Of 24 angles 42,504 sets of five: more than are yielded at once."""
    every = np.concatenate(list(subsets(24, count)))
    assert len(every) == comb(24, count)
    assert len(np.unique(every, axis=0)) == len(every)
    assert (np.diff(every, axis=1) > 0).all()
