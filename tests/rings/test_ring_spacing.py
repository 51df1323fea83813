"""Ring radii from closed forms: sphere, plane and cylinder, in both kinds of light."""

import numpy as np
import pytest

from planning.rig.rig import load_rig
from planning.rings.ring_curvature import chord_errors, ring_curvature
from planning.rings.ring_spacing import GapLimits, spaced_radii
from planning.scene.lights import light_of

RADIUS = 0.1
DISTANCE = 1.0
LIGHTS = {
    light: light_of(load_rig("default", light=light).projector_device())
    for light in ("diverging", "parallel")
}


def limits(kappa, *, coarsest=1.0, finest=1e-6, outer=1.0, free=False):
    n = len(kappa)
    whole = np.ones(n)
    return GapLimits(
        np.linspace(0.0, outer, n + 1),
        np.asarray(kappa, dtype=float),
        coarsest * whole,
        finest * whole,
        np.broadcast_to(free, n),
    )


def sphere_depth(rho, light):
    """Depth of the near side of a ball whose centre lies on the axis."""
    if light == "parallel":
        return DISTANCE - np.sqrt(RADIUS**2 - rho**2)
    # |z (R, 1) - (0, D)| = radius, R the tangent.
    a = 1.0 + rho**2
    return (DISTANCE - np.sqrt(DISTANCE**2 - a * (DISTANCE**2 - RADIUS**2))) / a


@pytest.mark.parametrize(("light", "outer"), [("parallel", 0.05), ("diverging", 0.05)])
def test_kappa_of_a_ball_is_its_closed_form(light, outer):
    """Parallel light: z'' = a^2 / (a^2 - c^2)^(3/2)."""
    c = np.linspace(0.0, outer, 401)[1:]
    errors = chord_errors(sphere_depth(c, light)[:, None], c, 2, LIGHTS[light])
    gap = 4 * (c[1] - c[0])
    kappa = ring_curvature(errors, np.isfinite(errors), gap)
    inside = slice(2, -2)
    if light == "parallel":
        truth = RADIUS**2 / (RADIUS**2 - c**2) ** 1.5
    else:
        step = 1e-4
        w = [1.0 / sphere_depth(c + s, light) for s in (-step, 0.0, step)]
        bend = np.abs(w[0] - 2.0 * w[1] + w[2]) / step**2
        truth = np.sqrt(1.0 + c**2) * bend / w[1] ** 2
    assert kappa[inside] == pytest.approx(truth[inside], rel=1e-3)


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_a_slanted_plane_has_no_kappa_in_either_light(light):
    c = np.linspace(0.0, 0.2, 101)[1:]
    # z = 1 + 0.7 x, with x = c (parallel) or x = c z (diverging).
    z = 1.0 + 0.7 * c if light == "parallel" else 1.0 / (1.0 - 0.7 * c)
    errors = chord_errors(z[:, None], c, 2, LIGHTS[light])
    assert np.nanmax(errors) < 1e-15


def test_a_cylinder_across_the_axis_bends_most_at_one_azimuth():
    """z = -sqrt(a^2 - x^2), x = c cos(azimuth): 0.99 of all azimuths, not the mean."""
    c = np.linspace(0.0, 0.05, 201)[1:]
    azimuths = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    z = 1.0 - np.sqrt(RADIUS**2 - np.outer(c, np.cos(azimuths)) ** 2)
    errors = chord_errors(z, c, 2, LIGHTS["parallel"])
    kappa = ring_curvature(errors, np.isfinite(errors), 4 * (c[1] - c[0]))
    steepest = RADIUS**2 / (RADIUS**2 - c**2) ** 1.5
    assert kappa[2:-2] == pytest.approx(steepest[2:-2], rel=0.01)
    assert np.mean(kappa[2:-2] / steepest[2:-2]) > 0.99


def test_rings_of_constant_kappa_are_even():
    radii = spaced_radii(limits(np.full(400, 3.0)), 16)
    assert radii == pytest.approx(np.arange(1, 17) / 16.0)


def test_radii_stand_at_equal_steps_of_the_root_of_kappa():
    """kappa = c^2: the integral of sqrt(kappa) is c^2 / 2, so radii go as sqrt(k/n)."""
    n = 4000
    c = (np.arange(n) + 0.5) / n
    radii = spaced_radii(limits(c**2, coarsest=1e3), 50)
    assert radii[1:] == pytest.approx(np.sqrt(np.arange(2, 51) / 50.0), abs=1e-4)


def test_the_largest_error_is_least_at_equal_steps_of_the_root():
    """Of kappa h^2 / 8, against even rings: 10 to 1 in kappa."""
    c = (np.arange(2000) + 0.5) / 2000
    kappa = np.where(c < 0.2, 100.0, 1.0)
    radii = spaced_radii(limits(kappa, coarsest=0.5), 20)

    def worst(edges):
        gap = np.diff(edges, prepend=0.0)
        inside = kappa[np.minimum((2000 * edges).astype(int), 1999)]
        return np.max(inside * gap**2 / 8.0)

    even = np.arange(1, 21) / 20.0
    assert worst(radii) < 0.3 * worst(even)


def test_no_gap_is_wider_or_finer_than_its_limits():
    n = 800
    c = (np.arange(n) + 0.5) / n
    kappa = 1.0 + 1e4 * np.exp(-(((c - 0.5) / 0.05) ** 2))
    for wanted in (25, 40, 70):
        radii = spaced_radii(limits(kappa, coarsest=0.05, finest=0.01), wanted)
        gaps = np.diff(radii)
        assert len(radii) >= 20
        assert gaps.max() <= 0.05 + 1e-12
        assert gaps.min() >= 0.01 - 1e-12
        assert radii[-1] == 1.0


def test_as_many_rings_as_wanted_fewer_where_too_fine_more_where_too_coarse():
    even = limits(np.ones(100), coarsest=0.05, finest=0.02)
    assert [len(spaced_radii(even, n)) for n in (5, 30, 200)] == [20, 30, 50]
    # Where h_min > h_max, h_min wins.
    crossed = limits(np.ones(100), coarsest=0.02, finest=0.1)
    assert len(spaced_radii(crossed, 40)) == 10


def test_a_tolerance_asks_for_more_rings():
    """h <= sqrt(8 e / kappa): 0.02 for e = 5e-5 and kappa = 1, so 50 rings."""
    assert len(spaced_radii(limits(np.ones(100), coarsest=0.5), 3, 5e-5)) == 50


def test_free_cells_take_what_is_left_of_a_gap():
    """Lit from 0.5 on: there gaps stay at their limit, to the last digit."""
    n = 1000
    free = np.arange(n) < 500
    both = np.where(free, 0.2, 0.03)
    found = GapLimits(np.linspace(0.0, 1.0, n + 1), np.ones(n), both, both, free)
    radii = spaced_radii(found, 40)
    lit = np.diff(radii)[radii[:-1] >= 0.5]
    assert lit == pytest.approx(0.03)


def test_the_innermost_ring_is_no_larger_than_the_gap_beyond_it():
    """A sample inside it counts with the first gap: so near a ring must lie."""
    kappa = np.where(np.arange(100) < 30, 1e-6, 100.0)
    radii = spaced_radii(limits(kappa), 8)
    assert radii[0] <= radii[1] - radii[0] + 1e-15
    assert np.all(np.diff(radii) > 0)


def test_a_dark_centre_widens_no_gap_that_is_lit():
    """Light from 0.58 on: rings before it are few, and none of its gaps grows."""
    c = np.linspace(0.0, 1.0, 401)
    middle = 0.5 * (c[1:] + c[:-1])
    dark = middle < 0.53
    found = GapLimits(
        c,
        np.zeros(400),
        np.where(dark, 1.3, 0.05),
        np.where(dark, 1.3, 0.01),
        dark,
    )
    radii = spaced_radii(found, 10)
    gaps = np.diff(radii)
    assert gaps[radii[1:] > 0.58].max() <= 0.05 + 1e-9
    # A sample at the centre is no farther from a ring than half the gap to the next.
    assert radii[0] <= 0.5 * radii[1] + 1e-12
    lit = spaced_radii(limits(np.zeros(400), coarsest=0.05), 10)
    assert np.diff(lit).max() <= 0.05 + 1e-9
    assert lit[0] <= 0.5 * lit[1] + 1e-12
