"""What samples of the audit say against extremes of a plan's own samples."""

from types import SimpleNamespace

import numpy as np
import pytest

from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.exposure_claims import (
    audit_exposures,
    most_beyond,
    n_beyond,
)

PHOTOMETRY = {
    **{"lumens": 3800.0, "albedo": 0.5, "quantum_efficiency": 0.6},
    **{"full_well_e": 1e4, "read_noise_e": 2.0},
}


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


@pytest.mark.parametrize(
    ("written_ms", "camera_ms", "rate", "longest_s"),
    [
        (50.0, 20.0, 60.0, 0.05),
        (None, 20.0, 60.0, 1 / 60),
        (None, 40.0, 60.0, 2 / 60),
        (None, None, 60.0, 1 / 60),
        (None, 20.0, None, 0.02),
    ],
)
def test_the_longest_exposure_is_the_rigs(
    handmade, written_ms, camera_ms, rate, longest_s
):
    """Where it isn't written the camera's own, in whole refreshes."""

    def told(claimed_s):
        def change(document):
            rig, own = document["rig"], {"max_exposure_ms": written_ms}
            rig["photometry"] = PHOTOMETRY | (own if written_ms else {})
            rig["camera"]["figures"] = {"exposure_ms": camera_ms}
            rig["projector"]["figures"] = {"frame_rate_hz": rate}
            figures = {k: v for k, v in PHOTOMETRY.items() if k != "albedo"}
            document["requirements"]["triangulation"]["light"] = figures | {
                **{"contrast": 500.0, "room_lux": 0.0, "lumens_per_watt": 300.0},
                **{"albedo": [0.5, 0.5], "f_number": 11.0, "focal_px": 5e3},
                **{"transmission": 0.9, "pixel_m": 3e-6, "gain": 1.0, "bits": 8},
                **{"min_contrast": 15.0, "max_exposure_s": claimed_s},
            }

        plan, findings = (
            handmade.tampered(handmade.unclaimed(), change),
            AuditFindings(),
        )
        audit_exposures(SimpleNamespace(plan=plan), findings)
        return [line for line in findings.failures if ".max_exposure_s: " in line]

    assert not told(longest_s)
    assert told(longest_s + 1e-4)
