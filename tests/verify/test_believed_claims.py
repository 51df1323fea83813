"""What of a check is believed: failures by its figures alone, the rest by name."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.mesh.mesh import TriangleMesh
from planning.model.document.check_records import ReconstructionRecord
from planning.model.requirements import CheckLimits
from planning.verify import verification
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.figure_claims import audit_check, compare_exactly
from planning.verify.held_figures import EXACTLY, WHOLLY
from planning.verify.reconstruction.check.accuracy import judge
from planning.verify.trust import taken_on_trust
from planning.verify.verification import verify_plan

LIMITS = CheckLimits(1e-4, 2e-4, 3e-5, 2e-3, 0.95, 0.01)
APART = "within tolerances: made with numpy 1.0"
GOOD = {"rms_m": 5e-5, "p95_m": 1e-4, "bias_m": 1e-6}
BAD = {"rms_m": 1.234e-4, "p95_m": 3e-4, "bias_m": -4e-5}


def complete(share, missing):
    return SimpleNamespace(
        thresholds_m=(1e-3, 2e-3, 4e-3),
        fractions=(share, share, share),
        predicted_missing=missing,
    )


def recorded(errors, completeness, failures):
    rows = zip(completeness.thresholds_m, completeness.fractions, strict=True)
    return ReconstructionRecord.model_validate(
        {f"accuracy_{name}": value for name, value in errors.items()}
        | {
            **{"n_points": 9, "n_merged": 9, "redundant_fraction": 0.0},
            "completeness": tuple(
                {"threshold_m": threshold, "fraction": share}
                for threshold, share in rows
            ),
            "predicted_missing": completeness.predicted_missing,
            **{"pixel_noise": None, "ambient": None},
            **{"passed": not failures, "failures": tuple(failures)},
        }
    )


def found(record):
    document = SimpleNamespace(reconstruction=record)
    asked = SimpleNamespace(check=LIMITS)
    findings = AuditFindings()
    plan = SimpleNamespace(document=document, requirements=asked)
    audit_check(SimpleNamespace(plan=plan), findings)
    return findings.failures


@pytest.mark.parametrize("errors", [GOOD, BAD, GOOD | {"p95_m": 3e-4}])
@pytest.mark.parametrize("shares", [(0.99, 0.001), (0.5, 0.5), (0.99, 0.02)])
def test_failures_are_those_that_figures_and_limits_say(errors, shares):
    completeness = complete(*shares)
    clauses = judge(SimpleNamespace(**errors), completeness, LIMITS)
    told = [f"{clause}; P1 was moved; likely as above" for clause in clauses]
    assert found(recorded(errors, completeness, clauses)) == ()
    assert found(recorded(errors, completeness, told)) == ()
    more = ["the light was off", *clauses]
    (failure,) = found(recorded(errors, completeness, more))
    assert failure.startswith("reconstruction.failures: claimed ['the light was off'")
    for k in range(len(clauses)):
        others = ["the light was off", *clauses[:k], *clauses[k + 1 :]]
        assert found(recorded(errors, completeness, others[1:]))
        assert found(recorded(errors, completeness, others))


def test_where_no_point_was_measured_that_is_the_failure():
    none = dict.fromkeys(GOOD)
    lacking = complete(0.0, 1.0)
    why = "no point was measured: nothing was decoded"
    assert found(recorded(none, lacking, [why])) == ()
    assert found(recorded(none, lacking, ["completeness is 0"]))
    assert found(recorded(none, lacking, []))
    assert found(recorded(GOOD, complete(0.99, 0.0), [why]))


def test_the_same_check_again_gives_the_same_reasons_to_the_word():
    lacking = complete(0.5, 0.5)
    one, other = (recorded(BAD, lacking, ["rms; " + why]) for why in ("P1", "P2"))
    assert compare_exactly(one, one) == []
    (failure,) = compare_exactly(one, other)
    assert failure.startswith("reconstruction.failures.0: claimed 'rms; P1'")


@pytest.fixture(scope="module")
def checked(handmade):
    record = recorded(BAD, complete(0.99, 0.0), ["rms", "p95", "bias"]).to_document()
    record["accuracy_max_m"] = 1e-3
    plan = handmade.build_plan()
    return handmade.tampered(plan, lambda d: d.update(reconstruction=record))


def named(plan, claims_held, figures_held):
    return "\n".join(taken_on_trust(plan, None, claims_held, figures_held))


def test_a_mesh_to_give_is_named_as_a_command_takes_it(handmade):
    plan = handmade.tampered(
        handmade.build_plan(), lambda d: d["meshes"][0].update(path="my parts/lid.obj")
    )
    lines = taken_on_trust(plan, None, EXACTLY, EXACTLY)
    assert any(line.endswith("give --mesh 'my parts/lid.obj'") for line in lines)


@pytest.mark.parametrize(
    "key",
    [
        *("region in surface.npz", "steep in surface.npz"),
        *("regions.*.mean_curvedness", "surface.curvature_radius_m"),
        *("coverage.samples", "requirements.check.tau_m"),
    ],
)
def test_what_no_audit_recomputes_is_named_unless_it_came_out_again(checked, key):
    assert key in named(checked, APART, APART)
    assert key in named(checked, "", EXACTLY)
    assert key not in named(checked, EXACTLY, APART)
    assert key not in named(checked, WHOLLY, APART)


@pytest.mark.parametrize("held", ["", APART, EXACTLY, WHOLLY])
def test_the_rig_is_the_plans_own_unless_all_was_planned_again(checked, held):
    assert ("--rig FILE" in named(checked, held, EXACTLY)) is (held != WHOLLY)


def test_how_many_stations_it_takes_is_told(checked, handmade):
    count = {"count": 1, "needed": 1, "lower_bound": 1, "n_candidates": 24}
    count |= {"n_samples": 200, "lit": 180, "measured": 150, "proof": "all looked at"}
    step = {"id": "T1", "world_from_station": np.eye(4).tolist(), "angle": 0.0}
    step |= {"projectors": ["P1", "P2"], "cameras": ["C1", "C2"]}
    told = {"kind": "turntable", "stations": [step], "count": count}
    stood = handmade.tampered(checked, lambda d: d.update(stations=told))
    line = "numbers of heads or steps, and their bounds"
    assert line in named(stood, APART, EXACTLY)
    assert line not in named(checked, APART, EXACTLY)


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("turned", [False, True])
def test_triangles_that_a_mesh_file_has_otherwise_are_told(checked, turned, known):
    """Samples lie along them: in another order they are others, whosever the digest."""
    mesh = checked.surface.mesh
    sha256 = checked.document.meshes[0].sha256 if known else "0"
    source = SimpleNamespace(sha256=sha256)
    faces = mesh.faces[::-1] if turned else mesh.faces
    given = replace(TriangleMesh(mesh.vertices, faces), source=source)
    told = "\n".join(taken_on_trust(checked, given, EXACTLY, EXACTLY))
    assert ("cut into triangles" in told) is turned
    assert ("other bytes" in told) is not known


def test_what_only_a_check_again_gives_is_named_likewise(checked):
    for key in ("reconstruction.accuracy_max_m", "reconstruction.failures"):
        assert key in named(checked, WHOLLY, APART)
        assert key not in named(checked, WHOLLY, EXACTLY)
    assert "left_out_fraction" not in named(checked, APART, APART)
    assert "every figure of the check" in named(checked, EXACTLY, "")


def test_faces_that_a_user_chose_are_told_though_all_else_came_out_again(
    checked, handmade
):
    chosen = {"kind": "faces", "source": "f.txt", "sha256": "0", "n_faces": 1}
    chosen |= {"area_m2": 1.0, "n_removed_by_repair": 0}
    plan = handmade.tampered(checked, lambda d: d["surface"].update(selection=chosen))
    told = "which faces are the target (region in surface.npz): chosen by a file"
    assert told in named(plan, EXACTLY, EXACTLY)
    assert told not in named(plan, WHOLLY, EXACTLY)
    assert re.search("by curvature, says surface.selection", named(checked, APART, ""))


def test_false_claims_are_told_where_the_plan_cannot_be_rendered(handmade, monkeypatch):
    def broken(*_, **__):
        raise ValueError("cannot convert float NaN to integer")

    monkeypatch.setattr(verification, "reconstruct", broken)
    plan = handmade.build_plan()
    with pytest.raises(ValueError, match="NaN"):
        verify_plan(plan, threads=1)

    def larger(document):
        document["coverage"]["target"]["lit_m2"] *= 1.5

    failures = verify_plan(handmade.tampered(plan, larger), threads=1).failures
    assert any(line.startswith("coverage.target.lit_m2") for line in failures)
    assert failures[-1] == "pixels: not to be rendered (ValueError)"
