"""Whether a predicted deviation is honest, where few or unlike samples are measured."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import betabinom

from planning.verify.audit.audit_case import AuditCase, examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.coverage.sigma_claims import audit_deviations
from planning.verify.audit.estimates import chance_below

SAMPLES, DRAWS = 12_000, 400


@pytest.fixture(scope="module")
def case(handmade) -> AuditCase:
    return examine(handmade.build_plan(), seed=3, n_samples=400, threads=1)


def skewed(rng, n):
    """Deviations [m] of skewness 5 or so: one sample in twenty lies in a long tail."""
    tail = rng.random(n) < 0.05
    return 1e-4 * (1.0 + 0.02 * rng.random(n) + tail * rng.exponential(0.4, n))


def claiming(handmade, case, values, *, factor=1.0, key=None, samples=SAMPLES):
    """The case of a plan that measured samples of these deviations, or says so."""
    figures = {
        "median_m": np.quantile(values, 0.5),
        "p95_m": np.quantile(values, 0.95),
        "noise_median_m": np.quantile(values, 0.5),
        "noise_p95_m": np.quantile(values, 0.95),
    }
    rms = np.sqrt(np.mean(values**2))
    if key in figures:
        figures[key] *= factor
    elif key is not None:
        rms *= factor

    def claim(document):
        coverage = document["coverage"]
        target = coverage["target"]
        target["measured_m2"] = len(values) / SAMPLES * target["area_m2"]
        coverage["samples"] = samples
        coverage["sigma"] = figures | {"terms_rms_m": {"edges": rms}}

    plan = handmade.tampered(case.plan, claim)
    estimator = replace(case.estimator, n_claimed=samples)
    return replace(case, plan=plan, estimator=estimator)


def found_of(case, at_first, again=None):
    """Failures by the terms of the first samples, and of those that decide."""
    terms, findings = iter((at_first, again)), AuditFindings()

    def terms_of(_):
        return {"edges": next(terms)}

    audit_deviations(case, terms_of, ("edges",), findings)
    return findings.failures


@pytest.mark.parametrize(
    ("k", "n", "rank", "of"),
    [(74, 94, 40, 43), (10, 30, 3, 9), (0, 5, 1, 1), (950, 1000, 5700, 6000)],
)
def test_the_chance_of_a_count_is_that_of_a_beta_binomial(k, n, rank, of):
    expected = betabinom.cdf(k, n, rank, of + 1 - rank)
    assert chance_below(k, n, rank, of) == pytest.approx(expected, rel=1e-9)


def test_no_count_is_negative_and_none_is_larger_than_all():
    assert chance_below(-0.5, 7, 2, 3) == 0.0
    assert chance_below(9.3, 7, 2, 3) == pytest.approx(1.0)


def test_a_quantile_of_few_samples_is_honest(handmade, case, monkeypatch):
    """Of 43 the 95th percentile is nearly the largest: what lies beyond varies much."""
    monkeypatch.setattr(AuditCase, "drawn_again", lambda self, times: self)
    rng, false = np.random.default_rng(1), 0
    for _ in range(DRAWS):
        of_plan, own = 1e-4 * rng.random(43), 1e-4 * rng.random(94)
        honest = claiming(handmade, case, of_plan)
        told = found_of(honest, own, own)
        false += any("p95" in line for line in told)
    assert false <= 2


@pytest.mark.parametrize("key", ["median_m", "noise_p95_m"])
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_false_quantile_of_many_samples_is_found(handmade, case, key, factor):
    rng = np.random.default_rng(2)
    false = claiming(handmade, case, 1e-4 * rng.random(6000), key=key, factor=factor)
    draws = 1e-4 * rng.random(5000), 1e-4 * rng.random(20_000)
    assert [line.split(":")[0] for line in found_of(false, *draws)] == [key]


def test_stating_few_samples_earns_no_quantile(handmade, case):
    rng = np.random.default_rng(3)
    false = claiming(
        *(handmade, case, 1e-4 * rng.random(6000)),
        **{"key": "median_m", "factor": 1.2, "samples": 40},
    )
    draws = 1e-4 * rng.random(5000), 1e-4 * rng.random(20_000)
    (failure,) = found_of(false, *draws)
    assert failure.startswith("median_m")


def test_a_draw_that_misses_the_tail_decides_nothing(handmade, case):
    """Its mean is too small, and so is its spread, from which the room would follow."""
    rng = np.random.default_rng(4)
    of_plan, more = skewed(rng, 1004), skewed(rng, 3400)
    own = np.sort(skewed(rng, 880))[:851]
    of_both = claiming(handmade, case, of_plan)
    assert any("terms_rms_m" in line for line in found_of(of_both, own, own))
    assert found_of(of_both, own, more) == ()


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_more_samples_find_what_is_false(handmade, case, factor):
    rng = np.random.default_rng(5)
    of_plan = skewed(rng, 1004)
    false = claiming(handmade, case, of_plan, key="edges", factor=factor)
    told = found_of(false, skewed(rng, 851), skewed(rng, 3400))
    assert [line.split(":")[0] for line in told] == ["terms_rms_m.edges"]


def test_what_decides_are_other_samples_four_times_as_many(handmade, case):
    looked, faces = [], []

    def of(some):
        wanted = some.samples.in_target & some.actual.measured
        looked.append(some.samples.points[wanted, 0])
        faces.append(some.samples.faces)
        return {"edges": np.full(np.count_nonzero(wanted), 2e-4)}

    false = claiming(handmade, case, np.full(6000, 1e-4))
    findings = AuditFindings()
    audit_deviations(false, of, ("edges",), findings)
    assert len(findings.failures) == 5
    first, again = looked
    assert 3.0 * len(first) < len(again) < 5.0 * len(first)
    assert not np.isin(first, again).any()
    # Of one stream the first faces would be the same ones.
    n = np.count_nonzero(case.samples.in_target)
    assert np.mean(faces[0][:n] == faces[1][:n]) < 0.1
