"""A second sequence's rings: where the surface bends, and never where it errs more."""

from itertools import product

import numpy as np
import pytest

from planning.verify.reconstruction.density.second_radii import (
    Gaps,
    MeasuredRings,
    nearest_rings,
    second_radii,
)
from planning.verify.reconstruction.light_laws import LIGHTS
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings

STEEPEST = np.deg2rad(60.0)
RADII = np.array([0.01, 0.02, 0.03, 0.04])


def gaps(bend, finest=1e-6, radii=RADII):
    whole = np.ones(len(radii))
    return Gaps(radii, np.asarray(bend) * whole, whole, finest * whole)


def count(of, found):
    """How many of the new rings lie in each gap."""
    edges = np.concatenate([[0.0], of.radii])
    return np.histogram(found, edges)[0]


def test_where_all_bends_alike_there_is_one_in_each_gap():
    found = second_radii(gaps(1.0))
    # A diameter in three equal parts, the others in two.
    assert found == pytest.approx([0.01 / 3.0, 0.015, 0.025, 0.035])


def test_rings_go_where_the_surface_bends_as_far_as_images_separate_them():
    one = gaps([1e-9, 1e-9, 1.0, 1e-9])
    assert count(one, second_radii(one)).tolist() == [0, 0, 4, 0]
    apart = gaps([1e-9, 1e-9, 1.0, 1e-9], 0.0032)
    assert count(apart, second_radii(apart))[2] == 2
    assert np.diff(second_radii(apart)).min() >= 0.0032


def test_no_other_choice_of_as_many_rings_errs_less():
    rng = np.random.default_rng(0)
    for _ in range(5):
        one = gaps(10.0 ** rng.uniform(-3.0, 3.0, 4), radii=np.cumsum(rng.random(4)))
        best = min(
            one.squared_error(np.array(more)).sum()
            for more in product(range(5), repeat=4)
            if sum(more) == 4
        )
        chosen = count(one, second_radii(one))
        assert one.squared_error(chosen).sum() == pytest.approx(best)


def test_it_is_never_worse_than_one_ring_in_each_gap():
    """Though two rings where it bends shut out those beside them."""
    rng = np.random.default_rng(1)
    even = np.ones(6, dtype=np.int64)
    for _ in range(40):
        radii = np.cumsum(rng.uniform(0.5, 1.5, 6))
        bend = 10.0 ** rng.uniform(-2.0, 2.0, 6)
        one = Gaps(radii, bend, np.ones(6), rng.uniform(0.2, 0.7, 6))
        chosen = count(one, second_radii(one))
        errors = [one.squared_error(more).sum() for more in (chosen, even)]
        assert errors[0] <= errors[1] * (1.0 + 1e-12)


def on_rings(light, height, turns=720, noise=1e-9):
    """Points of a surface on the rings, (x, y) scaled by z in diverging light."""
    turn = (np.arange(turns) + 0.5) * (2.0 * np.pi / turns)
    ring = np.repeat(np.arange(len(RADII)), turns)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    p = RADII[ring, None] * np.tile(circle, (4, 1))
    z = height(p)
    flat = p if light == "parallel" else p * z[:, None]
    pattern = DrawnRings(LIGHTS[light], RADII)
    return MeasuredRings.of(pattern, np.column_stack([flat, z]), ring, noise)


def test_the_bend_of_a_bowl_is_that_of_its_formula():
    """z = 1 + 5 r^2: kappa = 10 at every ring, and through the centre."""
    measured = on_rings("parallel", lambda p: 1.0 + 5.0 * (p**2).sum(axis=1))
    bend, seen = measured.bends(STEEPEST)
    assert bend == pytest.approx(100.0, rel=1e-6)
    assert np.all(seen == 180)


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_a_slanted_plane_bends_no_more_than_the_noise(light):
    def plane(p):
        along = 0.5 * p[:, 0]
        return 1.0 + along if light == "parallel" else 1.0 / (1.0 - along)

    # One point in each azimuth: a plane's median is its own.
    bend, _ = on_rings(light, plane, turns=180, noise=2e-5).bends(STEEPEST)
    assert bend == pytest.approx((8.0 * 2e-5 / 0.02**2) ** 2)


def test_diverging_light_bends_a_ball_as_its_derivative_says():
    """kappa = sqrt(1 + R^2) z^2 |(1/z)''(R)|, between rings close together."""
    away, radius = 1.0, 0.1

    def depth(rho):
        a = 1.0 + rho**2
        return (away - np.sqrt(away**2 - a * (away**2 - radius**2))) / a

    measured = on_rings("diverging", lambda p: depth(np.hypot(*p.T)))
    bend, _ = measured.bends(STEEPEST)
    step, rho = 1e-4, RADII[1]
    w = [1.0 / depth(rho + s) for s in (-step, 0.0, step)]
    truth = np.sqrt(1 + rho**2) * abs(w[0] - 2 * w[1] + w[2]) / step**2 / w[1] ** 2
    # Gap 1 lies between rings 0 and 1, gap 2 between 1 and 2.
    assert np.sqrt(bend[1:3].mean()) == pytest.approx(truth, rel=0.1)


def test_a_step_is_no_bend():
    """Half of the circumference drops by 50 mm between rings 1 and 2."""

    def cliff(p):
        return np.where((np.hypot(*p.T) > 0.025) & (p[:, 0] > 0.0), 1.05, 1.0)

    bend, _ = on_rings("parallel", cliff).bends(STEEPEST)
    assert bend == pytest.approx((8e-9 / 0.02**2) ** 2)


def test_nothing_measured_still_gives_radii():
    pattern = DrawnRings(LIGHTS["parallel"], RADII)
    empty = MeasuredRings.of(pattern, np.zeros((0, 3)), np.zeros(0, dtype=int), 1e-6)
    bend, seen = empty.bends(STEEPEST)
    found = second_radii(Gaps(RADII, bend, seen, np.full(4, 1e-3)))
    assert len(found) == 4
    assert np.all(np.diff(found) > 0.0)


def test_rings_in_an_image_lie_as_far_apart_as_they_are_drawn():
    turn = np.linspace(0.0, 2.0 * np.pi, 2000)
    radii = np.array([10.0, 17.0, 30.0])
    pixels = np.concatenate(
        [r * np.column_stack([np.cos(turn), np.sin(turn)]) for r in radii]
    )
    ring = np.repeat(np.arange(3), len(turn))
    apart = nearest_rings(pixels, ring, 4, share=0.05)
    assert apart[1:3] == pytest.approx([7.0, 13.0], rel=1e-3)
    assert np.isnan(apart[[0, 3]]).all()
