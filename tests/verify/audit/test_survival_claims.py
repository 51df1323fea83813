"""What a plan says is left after each loss: truths from the slow loop, and lies."""

from dataclasses import replace

import numpy as np
import pytest

from planning.verify.audit.audit import unmet_requirements
from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.coverage.survival_claims import audit_survival

_NAMES = (None, "P1", "P2", "C1", "C2")
_COUNT = {"count": 2, "needed": 2, "without": 1, "lower_bound": 2, "everywhere": None}


def _pairs_left(row, lost):
    """Pairs of a row of the slow loop that measure it without a device."""
    return [(p, c) for p, c in row["pairs"] if lost not in (f"P{p + 1}", f"C{c + 1}")]


def _could(row, lost, views):
    """Whether pairs and reference cameras measure a row so often without a device."""
    projectors = [p for p in range(2) if row["lit_by"][p] and lost != f"P{p + 1}"]
    own = sum(p in projectors for p, _ in row["pairs"])
    return own + sum(row["reference"][p] for p in projectors) >= views


@pytest.fixture(scope="module")
def rows_of_pairs(handmade):
    return handmade.pairs_of(handmade.build_plan())


@pytest.fixture(scope="module", params=[1, 2])
def told(request, handmade, rows_of_pairs):
    """A plan with true claims of its losses, K-fold, and the audit's case of it."""
    views, plan = request.param, handmade.build_plan()
    rows, weights, inside, regions = rows_of_pairs

    def area(test):
        chosen = np.array([bool(test(row)) for row in rows]) & inside
        return float(weights[chosen].sum())

    def share(part, whole, region):
        mine = regions == region
        parts, wholes = (
            np.array([bool(test(row)) for row in rows]) & mine for test in (part, whole)
        )
        counts = weights[parts].sum(), weights[wholes].sum()
        return counts[0] / counts[1]

    losses = []
    for lost in _NAMES:

        def lit(row, lost=lost):
            return any(on and lost != f"P{p + 1}" for p, on in enumerate(row["lit_by"]))

        def done(row, lost=lost):
            return len(_pairs_left(row, lost)) >= views

        def able(row, lost=lost):
            # A camera that is lost could stand there again.
            return _could(row, lost, views)

        missed = [
            region
            for region in (0, 1)
            if share(lit, lambda row: row["by_projectors"], region) < 0.3
            or share(done, able, region) < 0.3
        ]
        losses.append(
            {
                "lost": lost,
                "lit_m2": area(lit),
                "reachable_by_projectors_m2": area(lambda row: row["by_projectors"]),
                "measured_m2": area(done),
                "reachable_by_cameras_m2": area(able),
                "floors_missed": missed,
            }
        )
    record = {
        "samples": len(rows),
        "losses": losses,
        "projectors": _COUNT,
        "cameras": _COUNT,
    }

    def claim(document):
        document["requirements"]["survival"] = {"views": views, "survive": 1}
        document["survival"] = record

    plan = handmade.tampered(plan, claim)
    return plan, examine(plan, seed=1, n_samples=4000, threads=1)


def found(told, handmade, change=lambda document: None):
    plan, case = told
    findings = AuditFindings()
    audit_survival(replace(case, plan=handmade.tampered(plan, change)), findings)
    return findings.failures


@pytest.mark.long
def test_what_the_slow_loop_finds_left_is_true(told, handmade):
    assert found(told, handmade) == ()


def test_a_device_less_leaves_less(told):
    whole, *rest = told[0].document.survival.losses
    assert all(loss.measured_m2 < whole.measured_m2 for loss in rest)
    assert all(loss.lit_m2 <= whole.lit_m2 for loss in rest)


@pytest.mark.parametrize("k", range(5))
@pytest.mark.parametrize("name", ["lit_m2", "measured_m2", "reachable_by_cameras_m2"])
def test_each_area_that_is_a_lie_is_told(told, handmade, k, name):
    def lie(document):
        loss, area = document["survival"]["losses"][k], document["coverage"]["target"]
        loss[name] += 0.12 * area["area_m2"] * (1 if loss[name] < 0.5 else -1)

    lost = _NAMES[k] or "none"
    assert any(
        f"survival.losses.{lost}.{name}" in one for one in found(told, handmade, lie)
    )


def test_devices_that_are_left_out_are_missed(told, handmade):
    def forget(document):
        del document["survival"]["losses"][2]

    assert "each device after none" in found(told, handmade, forget)[0]
    for key in ("document", "requirements"):

        def drop(document, key=key):
            part = document if key == "document" else document["requirements"]
            del part["survival"]

        assert "there without the other" in found(told, handmade, drop)[0]


def test_floors_that_fall_are_told(told, handmade):
    losses = told[0].document.survival.losses
    fallen = [k for k, loss in enumerate(losses) if loss.floors_missed]
    held = [k for k, loss in enumerate(losses) if 1 not in loss.floors_missed]
    assert fallen or told[0].requirements.survival.views == 1
    if fallen:

        def hide(document):
            document["survival"]["losses"][fallen[-1]]["floors_missed"] = []

        assert any("floors_missed" in one for one in found(told, handmade, hide))
    if held:

        def invent(document):
            document["survival"]["losses"][held[0]]["floors_missed"] = [0, 1]

        assert any("floors_missed" in one for one in found(told, handmade, invent))


@pytest.mark.parametrize(
    ("key", "lie"),
    [
        ("count", 3),
        ("needed", 1),
        ("lower_bound", 3),
        ("everywhere", 2),
        ("without", 0),
    ],
)
def test_numbers_of_devices_that_are_lies_are_told(told, handmade, key, lie):
    def change(document):
        document["survival"]["projectors"] = _COUNT | {key: lie}

    assert any(
        f"survival.projectors.{key}" in one for one in found(told, handmade, change)
    )


def test_what_isnt_met_after_a_loss_is_told(told):
    unmet = " ".join(unmet_requirements(told[0]))
    assert "requirements.dominant_coverage without P1" in unmet
    assert "requirements.coverage without C1" in unmet
