"""Exact edges give exact points: a tenth of the benchmark over a million rays."""

import pytest


@pytest.fixture(scope="module")
def algebra(benchmark_module):
    return benchmark_module("paper.ring_algebra")


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_no_wrong_root_and_no_error_in_any_pose(algebra, light):
    found = algebra.run(light, 50_000, seed=3)
    assert found.n_rays >= 50_000
    assert found.n_poses > 30
    assert found.n_wrong == 0
    assert found.max_error_m < 1e-9
    # The ring axis was off the device's, and some cameras stood inside their rings.
    assert found.max_offset > 0.2
    assert found.n_inside > 500
