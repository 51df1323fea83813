"""Eq. (10) at image level: a millimetre beyond d'_max opens a hole, none inside it."""

import re

import pytest


@pytest.fixture(scope="module")
def wall(benchmark_module):
    return benchmark_module("pixels.seam_gap")


def test_d_max_of_two_images_is_their_width_on_the_wall(wall):
    """1280 pixels of 1/8 mm; from the middle of the first to that of the last 159.9."""
    assert wall.predicted_limit() == pytest.approx(0.160, abs=1e-12)


def test_a_millimetre_inside_the_limit_leaves_no_hole(wall):
    found = wall.check(wall.predicted_limit() - 1e-3)
    assert found.passed, found.failures
    assert found.completeness.predicted_missing == 0.0
    # A pixel is 0.125 mm.
    assert wall.hole(found) < 0.15e-3


def test_a_millimetre_beyond_the_limit_opens_a_hole_that_the_check_sees(wall):
    found = wall.check(wall.predicted_limit() + 1e-3)
    assert not found.passed
    assert any("have no point within 0.75 mm" in text for text in found.failures)
    hole = r"between what C1 and C2 measured, a hole about 1\.\d mm wide: the baseline"
    assert all(re.search(hole, text) for text in found.failures), found.failures
    assert all("161.0 mm, is too wide" in text for text in found.failures)
    # The millimetre, and the pixels at either border that no edge is read from.
    assert 1.0e-3 < wall.hole(found) < 1.6e-3
    assert not found.accuracy.rms_m > 1e-4
