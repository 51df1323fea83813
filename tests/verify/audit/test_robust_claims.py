"""What a plan says of rigs that aren't built exactly as planned: truths and lies."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_camera, make_projector, make_rig
from support.simulated_rigs import off_by, triangulated

from geometry.poses import inverse, look_at
from planning.model.devices.calibration_errors import Mounting
from planning.model.devices.device_poses import moved_to
from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.coverage import robust_claims
from planning.verify.audit.coverage.sigma_claims import _best_pairs
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.built_rigs import built_rig, retriangulated
from planning.verify.audit.predicates.error_terms import deviation
from planning.verify.audit.predicates.recompute import recompute

_MET = {"n_drawn": 400, "n_met": 400, "least": 388, "rounds": 0} | {
    f"n_{name}_without": 2 for name in ("projectors", "cameras", "met")
}


@pytest.fixture(scope="module")
def case(handmade):
    return examine(handmade.build_plan(), seed=1, n_samples=300, threads=1)


@pytest.fixture
def found(handmade, case, monkeypatch):
    """Audit the sphere's plan, with what is said of drawn rigs."""
    monkeypatch.setattr(robust_claims, "_SAMPLES", 60)
    monkeypatch.setattr(robust_claims, "_RIGS", 25)

    def audit(record=(), calibration=None, **asked):
        robust = {
            "quantile": 0.95,
            "mounting": {"position_m": 0.0, "angle": 0.0, "focal": 0.0},
            **{"dominant_coverage": 0.3, "coverage": 0.3, "region_coverage": 0.0},
            "max_sigma_m": 1e-3,
        } | asked

        def claim(document):
            document["robust"] = _MET | dict(record)
            document["requirements"]["robust"] = robust
            limits = document["requirements"]["triangulation"]
            limits |= {"max_sigma_m": 2e-4, "calibration": calibration}

        plan = handmade.tampered(handmade.build_plan(), claim)
        findings = AuditFindings()
        robust_claims.audit_robust(replace(case, plan=plan), findings)
        return findings.failures

    return audit


def _turned(angle):
    return {"position_m": 0.0, "angle": angle, "focal": 0.0}


def test_what_is_true_is_left_alone(found):
    assert found(mounting=_turned(2e-3)) == ()


def test_rigs_that_look_away_don_t_meet_what_was_asked(found):
    (lie,) = found({"n_met": 300}, mounting=_turned(0.5))
    assert "300 of 400" in lie
    assert found({"n_met": 0}, mounting=_turned(0.5)) == ()


def test_points_of_rigs_that_are_off_aren_t_exact(found):
    off = {"angle": 3e-4, "position_m": 0.0, "focal": 0.0, "principal_px": 0.0}
    # Every point keeps this limit, and many a rig's points together don't.
    (lie,) = found(calibration=off, max_sigma_m=2.6e-4, coverage=0.0)
    assert lie.startswith("robust.n_met")


@pytest.mark.parametrize(
    ("record", "asked", "key"),
    [
        ({"least": 380}, {}, "robust.least"),
        ({"n_met": 401}, {}, "robust.quantile"),
        ({}, {"max_sigma_m": 1e-4}, "robust.max_sigma_m"),
        ({}, {"region_coverage": 0.99}, "robust.region_coverage"),
    ],
)
def test_numbers_that_can_t_be_are_found(found, record, asked, key):
    assert key in " ".join(found(record, **asked))


def test_one_record_without_the_other_says_nothing(handmade, case):
    plan = handmade.tampered(
        handmade.build_plan(), lambda document: document.update(robust=_MET)
    )
    findings = AuditFindings()
    robust_claims.audit_robust(replace(case, plan=plan), findings)
    assert "without the other" in findings.failures[0]


def test_devices_move_with_their_rings_and_existing_ones_stay(handmade):
    plan = handmade.build_plan()
    first, *others = plan.document.projectors
    records = (first.changed(existing=True, name="old"), *others)
    plan = replace(plan, document=plan.document.changed(projectors=records))
    rig = built_rig(plan, Mounting(1e-2, 1e-2, 1e-2), np.random.default_rng(0))
    before, after = plan.projectors, rig.plan.projectors
    assert np.array_equal(before[0].world_from_device, after[0].world_from_device)
    old, new = (
        inverse(p.world_from_device) @ p.world_from_ring for p in (before[1], after[1])
    )
    assert np.abs(old - new).max() < 1e-9
    moved = inverse(before[1].world_from_device) @ after[1].world_from_device
    assert 0.0 < np.abs(moved[:3, 3]).max() <= 1e-2
    assert np.abs(after[1].world_from_ring - before[1].world_from_ring).max() > 1e-4
    ratio = after[1].device.camera_matrix[0, 0] / before[1].device.camera_matrix[0, 0]
    assert 0.0 < abs(ratio - 1.0) <= 1e-2


def test_errors_of_many_rigs_are_those_that_are_predicted(handmade, case):
    def state(document):
        limits = document["requirements"]["triangulation"]
        limits |= {"max_sigma_m": 1e-3, "calibration": calibration}

    calibration = {"angle": 3e-4, "position_m": 1e-4, "focal": 0.0, "principal_px": 0.2}
    plan = handmade.tampered(handmade.build_plan(), state)
    samples = case.samples.take(case.samples.in_target)
    squares = []
    for index in range(60):
        rng = np.random.default_rng(index)
        rig = built_rig(plan, Mounting(), rng)
        found = recompute(rig.plan, samples, case.shadow)
        errors = robust_claims._errors(rig, found, rng)
        squares.append(np.nanmean(errors**2))
    best = _best_pairs(replace(case, plan=plan, actual=found))
    predicted = np.sqrt(np.mean(deviation(best) ** 2))
    assert np.sqrt(np.mean(squares)) == pytest.approx(predicted, rel=0.12)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_points_lie_where_simulated_rigs_have_them(light):
    rig, up = make_rig(light), np.array([0.0, 0.0, 1.0])
    points = np.random.default_rng(5).uniform(-0.05, 0.05, (40, 3))
    projector = make_projector(rig, np.linspace(0.002, 0.3, 150))
    projector = moved_to(projector, look_at([0.1, -1.1, 0.2], np.zeros(3), up))
    camera = moved_to(make_camera(rig), look_at([0.7, -0.8, -0.3], np.zeros(3), up))
    sizes = np.array([1e-4] * 3 + [3e-4] * 3 + [4e-4] + [0.4] * 2)
    off = np.random.default_rng(1).standard_normal((2, 9)) * sizes
    there = [np.concatenate([one[3:6], one[:3], one[6:]]) for one in off]
    if light == "parallel":
        there[0][6] = 1.0 / (1.0 + off[0][6]) - 1.0
        there[0][7:] *= -1.0
    found = retriangulated(
        points,
        AuditProjector(
            *(projector.device, projector.world_from_device),
            *(projector.world_from_ring, projector.ring_radii),
        ),
        AuditCamera(camera.device, camera.world_from_device),
        (off[0], off[1]),
        np.zeros((40, 2)),
        np.zeros(40),
    )
    expected = triangulated(
        *(points, projector, camera),
        *(off_by(projector, there[0]), off_by(camera, there[1])),
    )
    both = np.isfinite(found[:, 0]) & np.isfinite(expected[:, 0])
    assert both.mean() > 0.8
    assert np.abs(found - expected)[both].max() < 1e-8
