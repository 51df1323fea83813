"""What samples of the audit say against extremes of a plan's own samples."""

from types import SimpleNamespace

import numpy as np
import pytest

from planning.verify.audit.devices.exposure_claims import most_beyond, n_beyond


def case_of(n_audited, n_claimed):
    return SimpleNamespace(
        samples=SimpleNamespace(in_target=np.ones(n_audited, dtype=bool)),
        estimator=SimpleNamespace(n_claimed=n_claimed),
    )


@pytest.mark.parametrize(("n_audited", "n_claimed"), [(2000, 1000), (400, 2400)])
def test_extremes_of_fewer_samples_are_not_denied_by_their_draw(n_audited, n_claimed):
    """Of equal draws; of a hundred thousand pairs none may be called false."""
    rng, most = np.random.default_rng(0), most_beyond(case_of(n_audited, n_claimed))
    # Ranks of the plan's largest among all: a geometric number lie beyond it.
    beyond = rng.geometric(n_claimed / (n_audited + n_claimed), size=100_000) - 1
    assert beyond.max() <= most
    # Nor is much more allowed: a sixth of the samples beyond would be noticed.
    assert most < n_audited / 6
    assert most_beyond(case_of(0, n_claimed)) == 0.0


def test_rounding_lies_beyond_nothing():
    # As a plane in parallel light comes out.
    values = 254.4 * (1.0 + np.linspace(-1e-12, 1e-12, 101))
    assert n_beyond(values, values[0]) == 0
    assert n_beyond(values + 1e-3, 254.4) == 101
    assert n_beyond(np.array([0.8, 0.9, 1.0]), 0.85) == 2
    assert n_beyond(np.zeros(5), -np.inf) == 5
