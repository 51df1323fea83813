"""What is asked of heads together, against counting by hand and all selections."""

from functools import partial
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.mesh.sampling import SurfaceSamples
from planning.cameras.stations.heads.fewest_heads import _greedy, _lacking_with_each
from planning.cameras.stations.heads.head_cover import HeadCover, HeadSets
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers import solve_cover

N, HEADS, REGIONS = 60, 7, 2


def _scene(*, floor=0.0):
    required = SimpleNamespace(
        dominant_coverage=0.9, coverage=0.8, region_coverage=floor
    )
    scene = SimpleNamespace(
        requirements=required,
        region=np.arange(N) % (REGIONS + 1) - 1,
        large_regions=np.arange(REGIONS),
        seed=0,
    )
    scene.floor_rows = partial(Scene.floor_rows, scene)
    return scene


def _sets(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(N, 3))
    samples = SurfaceSamples(points, points, np.arange(N), 1.0)
    lit = rng.random((N, HEADS)) < 0.45
    measured = lit & (rng.random((N, HEADS)) < 0.8)
    return HeadSets(Target(samples, np.zeros((N, 3))), lit, measured)


def _enough(scene, sets, chosen):
    """By the words of the verdict: measured of what is lit and can be measured."""
    required = scene.requirements
    lit = sets.lit[:, chosen].any(axis=1)
    for done, reached, share in (
        (sets.lit, sets.lit.any(axis=1), required.dominant_coverage),
        (sets.measured, lit & sets.measured.any(axis=1), required.coverage),
    ):
        served = done[:, chosen].any(axis=1)
        if served.sum() < share * reached.sum() - 1e-9:
            return False
        for r in range(REGIONS) if required.region_coverage else ():
            mine = scene.region == r
            least = required.region_coverage * (reached & mine).sum()
            if (served & mine).sum() < least - 1e-9:
                return False
    return True


@pytest.mark.parametrize("floor", [0.0, 0.95])
@pytest.mark.parametrize("seed", range(6))
def test_selections_lack_nothing_where_all_requirements_are_met(seed, floor):
    scene, sets = _scene(floor=floor), _sets(seed)
    cover = HeadCover.of(scene, sets)
    fewest = None
    for count in range(1, HEADS + 1):
        for chosen in combinations(range(HEADS), count):
            rows = np.array(chosen)
            met = _enough(scene, sets, rows)
            assert (cover.lacking(rows) == 0) is met
            fewest = count if met and fewest is None else fewest
    found, solution = cover.fewest(seed=0, budget=1e7)
    assert _enough(scene, sets, found)
    assert len(found) == fewest
    assert fewest <= len(_greedy(cover)[0]) <= HEADS
    # No cover of the least floors, nor of all light or all measured, takes more.
    least, proof = cover.proved(solution, seed=0, budget=1e7)
    assert least <= fewest
    assert proof
    for number, done in zip(cover.totals, (sets.lit, sets.measured), strict=True):
        part = solve_cover(cover.of_one(number))
        asked = cover.quotas.floors[number]
        assert done[:, part.selected].any(axis=1).sum() >= asked
        assert len(part.selected) <= fewest


def test_each_head_offered_is_lacking_what_the_whole_selection_would_be():
    scene, sets = _scene(floor=0.9), _sets(3)
    cover = HeadCover.of(scene, sets)
    others, offered = sets.take(np.array([0, 1])), sets.take(np.arange(2, HEADS))
    short = _lacking_with_each(cover, others, offered)
    expected = [cover.lacking(np.array([0, 1, k])) for k in range(2, HEADS)]
    assert short.tolist() == expected


def test_a_head_that_is_left_out_serves_nothing_and_what_is_asked_stays():
    scene, sets = _scene(), _sets(4)
    cover = HeadCover.of(scene, sets)
    less = cover.without(2)
    assert less.asked == cover.asked
    assert not less.covers[:, 2].any()
    assert less.lacking(np.array([0, 1, 2])) == cover.lacking(np.array([0, 1]))
