"""`verify_plan`: audit, mesh and pixels together, from memory and from files."""

import json
import re
from dataclasses import asdict

import numpy as np
import pytest
import trimesh
from support.plain_shapes import grid

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.model.document.check_records import ReconstructionRecord
from planning.model.document.made_with import MadeWith
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.verify import verification
from planning.verify.audit import figure_claims
from planning.verify.mesh_comparison import compare_meshes, compare_records
from planning.verify.verification import verify_plan


def compare_figures(recorded, again):
    """Compare two `reconstruction` tables, as plain values."""
    read = ReconstructionRecord.model_validate
    claimed = None if recorded is None else read(recorded)
    return figure_claims.compare_figures(claimed, read(again))


@pytest.fixture(scope="module")
def verified(handmade):
    lines: list[str] = []
    found = verify_plan(handmade.build_plan("diverging"), progress=lines.append)
    return found, lines


def test_a_true_plan_is_verified_down_to_the_pixels(verified):
    found, lines = verified
    assert found.failures == ()
    assert found.passed
    assert found.reconstruction.passed
    assert found.reconstruction.n_merged > 10_000
    assert lines[0].startswith("audit: ")
    assert re.fullmatch(r"pixels: 4 pairs on \d+ threads?, about \d+ s", lines[1])
    assert lines[2].startswith("pixels: pair 1 of 4, about ")
    assert lines[-1] == "pixels: pair 4 of 4"
    document = json.loads(json.dumps(found.to_document(), allow_nan=False))
    assert document["passed"] is True
    assert document["coverage"]["target"]["measured_m2"] > 0.004
    assert document["reconstruction"]["passed"] is True
    assert "verified: every claim holds (pixels checked)" in found.summary()


def test_pixels_judge_the_audits_own_samples(verified):
    found, _ = verified
    case = found.audit.case
    predicted = case.actual.measured[case.samples.in_target]
    missing = found.reconstruction.completeness.missing
    assert missing.shape == predicted.shape
    assert not np.any(missing & ~predicted)


def test_what_is_measured_is_what_physics_was_predicted_to_allow(verified):
    tables = verified[0].reconstruction.comparison.confusion.surface
    # Here ranges of the devices bind, and the simulated ones are sharp beyond them.
    assert tables.floors.agreement >= 0.94
    assert tables.floors.agreement > tables.floors.trivial_agreement + 0.02
    assert tables.floors.missing <= 0.01
    # The plan's limits are the stricter ones: more is measured, hardly any less.
    assert tables.limits.missing <= 0.002
    assert tables.limits.unexpected > tables.floors.unexpected


def test_a_false_confusion_table_is_named(handmade, verified):
    figures = verified[0].reconstruction.to_document()
    figures = json.loads(json.dumps(figures))
    figures["confusion"]["target"]["floors"]["agreement"] -= 0.05
    figures["whole_surface"]["measured"] += 0.05
    false = compare_figures(figures, verified[0].reconstruction.to_document())
    assert [sentence.split(":")[0] for sentence in false] == [
        "reconstruction.confusion.target.floors.agreement",
        "reconstruction.whole_surface.measured",
    ]


@pytest.mark.long
def test_recorded_figures_are_held_against_a_run_with_other_noise(handmade, verified):
    figures = verified[0].reconstruction.to_document()
    plan = handmade.tampered(
        handmade.build_plan(), lambda document: document.update(reconstruction=figures)
    )
    assert verify_plan(plan, seed=7).failures == ()


def _made_here(handmade, figures, **elsewhere):
    """A plan with recorded figures, made with what runs now but for some of it."""
    made = MadeWith.here().to_document()
    libraries = made["libraries"] | elsewhere

    def change(document):
        document["reconstruction"] = figures
        document["made_with"] = made | {"libraries": libraries}

    return handmade.tampered(handmade.build_plan(), change)


@pytest.mark.long
def test_made_with_the_same_every_figure_is_compared_to_the_last_digit(
    handmade, verified
):
    figures = verified[0].reconstruction.to_document()
    honest = verify_plan(_made_here(handmade, figures))
    assert honest.failures == ()
    assert "recorded figures of the check compared to the last digit" in (
        honest.summary()
    )
    moved = figures | {"accuracy_rms_m": figures["accuracy_rms_m"] * (1.0 + 1e-12)}
    found = verify_plan(_made_here(handmade, moved))
    assert len(found.failures) == 1
    assert found.failures[0].startswith("reconstruction.accuracy_rms_m: claimed ")
    apart = verify_plan(_made_here(handmade, moved, numpy="1.0"))
    assert apart.failures == ()
    assert f"within tolerances: made with numpy 1.0, here {np.__version__}" in (
        apart.summary()
    )


def test_what_is_asked_and_edited_after_the_check_is_told(handmade, verified):
    figures = verified[0].reconstruction.to_document()
    digest = handmade.build_plan().digest

    def loosened(document):
        document["reconstruction"] = figures | {"plan": digest}
        document["requirements"]["check"]["max_rms_m"] *= 2.0

    plan = handmade.tampered(handmade.build_plan(), loosened)
    (failure,) = verify_plan(plan, check_pixels=False).failures
    assert failure.startswith(
        f"reconstruction.plan: the check was of a plan with digest {digest[:16]}, and "
        f"this one has {plan.digest[:16]}"
    )
    honest = handmade.tampered(
        handmade.build_plan(),
        lambda document: document.update(reconstruction=figures | {"plan": digest}),
    )
    assert verify_plan(honest, check_pixels=False).failures == ()


def test_many_other_figures_are_counted_and_none_may_be_left_out(verified):
    figures = verified[0].reconstruction.to_document()
    read = ReconstructionRecord.model_validate
    gone = "whole_surface", "dominant"
    without = {key: value for key, value in figures.items() if key not in gone}
    found = figure_claims.compare_exactly(read(without), read(figures))
    assert len(found) == 9
    assert re.fullmatch(r"reconstruction: \d+ more figures differ", found[-1])
    assert figure_claims.compare_exactly(read(figures), read(figures)) == []
    # Whether it passed is another claim.
    verdict = {"passed": False}
    assert figure_claims.compare_exactly(read(figures | verdict), read(figures)) == []


def _strict(handmade, reconstruction):
    """The plan with a limit that no check can keep; no cause is sought of it alone."""

    def change(document):
        document["requirements"]["check"]["max_p95_m"] = 1e-6
        document["reconstruction"] = reconstruction

    return handmade.tampered(handmade.build_plan(), change)


@pytest.fixture(scope="module")
def strict_pixels(handmade):
    """With other noise."""
    return verify_plan(_strict(handmade, None), seed=7).reconstruction


@pytest.fixture
def strict(handmade, verified, strict_pixels, monkeypatch):
    """The same with some of its recorded figures changed; None: none is recorded.

    What is recorded doesn't change the pixels: they are computed once.
    """
    monkeypatch.setattr(
        "planning.verify.verification._reconstruct", lambda *_: strict_pixels
    )
    figures = verified[0].reconstruction.to_document()

    def recording(change):
        return _strict(handmade, None if change is None else figures | change)

    return recording


@pytest.fixture(scope="module")
def honest(verified):
    """What the recorded figures say of that limit."""
    p95_mm = 1e3 * verified[0].reconstruction.to_document()["accuracy_p95_m"]
    why = f"95th percentile of the distance is {p95_mm:.3f} mm, limit 0.001 mm"
    return {"passed": False, "failures": [why]}


def test_a_limit_that_the_plan_says_it_misses_is_no_false_claim(strict, honest):
    found = verify_plan(strict(honest), seed=7)
    assert found.failures == ()
    assert found.passed
    assert [sentence for sentence in found.unmet if "95th percentile" in sentence]
    assert "not met: 95th percentile" in found.summary()
    assert "FALSE" not in found.summary()
    assert found.to_document()["unmet"] == list(found.unmet)
    assert not found.reconstruction.passed
    (false,) = verify_plan(strict(honest | {"failures": ["light was off"]})).failures
    assert false.startswith("reconstruction.failures: claimed ['light was off'], but")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (None, "95th percentile"),
        ({}, "reconstruction.passed: claimed true, the check run again fails"),
        (
            {"passed": False, "failures": ["rms"], "accuracy_rms_m": 1e-6},
            "reconstruction.accuracy_rms_m: claimed 1e-06",
        ),
        ({"passed": False}, "reconstruction.passed: claimed False, but"),
    ],
    ids=["not recorded", "claimed kept", "other figures", "no reason"],
)
def test_a_missed_limit_is_a_failure_unless_reported(strict, change, sentence):
    found = verify_plan(strict(change))
    assert not found.passed
    assert any(sentence in failure for failure in found.failures)


def test_what_pixels_measure_is_judged_where_a_plan_says_that_nothing_is(
    handmade, strict
):
    silent = handmade.tampered(
        strict(None), lambda d: d["coverage"]["surface"].update(measured_m2=0.0)
    )
    failures = verify_plan(silent).failures
    assert any(line.startswith("95th percentile") for line in failures)


def test_a_missed_limit_of_what_really_stands_there_is_a_failure(
    handmade, strict, honest
):
    found = verify_plan(strict(honest), truth=handmade.build_plan())
    assert any("95th percentile" in failure for failure in found.failures)


def test_a_pass_with_failures_contradicts_itself_without_the_pixels(handmade, verified):
    recorded = verified[0].reconstruction.to_document()
    recorded |= {"passed": True, "failures": ["95th percentile too large"]}
    plan = handmade.tampered(
        handmade.build_plan(), lambda document: document.update(reconstruction=recorded)
    )
    found = verify_plan(plan, check_pixels=False)
    unsaid, contradicted = found.failures
    assert unsaid.startswith("reconstruction.failures: claimed ['95th percentile too")
    assert contradicted.startswith("reconstruction.passed: claimed True, but")
    recorded |= {"failures": [], "ambient": 0.2}
    plan = handmade.tampered(plan, lambda d: d.update(reconstruction=recorded))
    (told,) = verify_plan(plan, check_pixels=False).failures
    assert told.startswith("reconstruction.ambient: claimed 0.2")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_points", 60_000),
        ("accuracy_rms_m", 5e-6),
        ("accuracy_p95_m", None),
        ("accuracy_bias_m", 2e-5),
        ("predicted_missing", 0.05),
        ("redundant_fraction", 0.1),
    ],
)
def test_a_false_figure_is_named(verified, name, value):
    figures = verified[0].reconstruction.to_document()
    failures = compare_figures(figures | {name: value}, figures)
    assert len(failures) == 1
    assert failures[0].startswith(f"reconstruction.{name}: ")
    assert f"{value}" in failures[0]
    assert "recomputed" in failures[0]


def test_a_large_missing_share_may_differ_by_a_quarter(verified):
    figures = verified[0].reconstruction.to_document() | {"predicted_missing": 0.08}
    assert compare_figures(figures | {"predicted_missing": 0.065}, figures) == []
    assert len(compare_figures(figures | {"predicted_missing": 0.055}, figures)) == 1


def test_false_completeness_and_a_false_pass_are_named(verified):
    figures = verified[0].reconstruction.to_document()
    assert compare_figures(figures, figures) == []
    assert compare_figures(None, figures) == []
    rows = [
        row | {"fraction": row["fraction"] - 0.1} for row in figures["completeness"]
    ]
    assert len(compare_figures(figures | {"completeness": rows}, figures)) == 3
    assert "0 rows" in compare_figures(figures | {"completeness": []}, figures)[0]
    failures = compare_figures(figures, figures | {"passed": False})
    assert failures == [
        "reconstruction.passed: claimed true, the check run again fails"
    ]


def test_a_false_claim_fails_without_the_pixels(handmade):
    plan = handmade.tampered(
        handmade.build_plan(),
        lambda document: document["cameras"][0].update(seen_area_m2=0.1),
    )
    found = verify_plan(plan, check_pixels=False)
    assert not found.passed
    assert found.reconstruction is None
    assert "NOT CHECKED" in found.summary()
    assert "FALSE: C1.seen_area_m2: claimed 0.1 m²" in found.summary()


@pytest.mark.long
def test_a_mounted_rig_that_differs_from_the_plan_fails(handmade):
    plan = handmade.build_plan()

    def turn(document):
        pose = np.array(document["cameras"][1]["world_from_device"])
        c, s = np.cos(0.002), np.sin(0.002)
        pose[:3, :3] = pose[:3, :3] @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        document["cameras"][1]["world_from_device"] = pose.tolist()

    found = verify_plan(plan, truth=handmade.tampered(plan, turn))
    assert not found.audit.failures
    assert not found.passed
    assert any("C2" in failure for failure in found.failures)


def test_no_name_of_a_plan_wipes_out_what_is_taken_on_trust(handmade):
    """A terminal takes words of a file for its own: up a line, and clear it."""
    wiping = "part.obj\x1b[1A\x1b[2K\x9b2K\b\u202e"
    plan = handmade.tampered(
        handmade.build_plan(), lambda d: d["meshes"][0].update(path=wiping)
    )
    told = verify_plan(plan, check_pixels=False).summary()
    assert r"--mesh 'part.obj\x1b[1A" in told
    assert all(line.isprintable() for line in told.splitlines())


def test_the_files_alone_are_enough_and_the_mesh_may_be_given(handmade, tmp_path):
    path = handmade.save(handmade.build_plan("parallel"), tmp_path)
    plan = RigPlan.load(path)
    assert verify_plan(plan, sphere(0.05, subdivisions=3), check_pixels=False).passed
    found = verify_plan(plan, sphere(0.051, subdivisions=3), check_pixels=False)
    assert [f for f in found.failures if "isn't that of surface.npz" in f]


@pytest.mark.long
def test_another_object_is_named_by_its_mesh_and_by_the_pixels(handmade):
    plan = handmade.build_plan()
    mesh = plan.surface.mesh
    found = verify_plan(plan, TriangleMesh(1.01 * mesh.vertices, mesh.faces))
    assert not found.audit.failures
    assert found.reconstruction.accuracy.bias_m == pytest.approx(5e-4, rel=0.1)
    assert found.failures[0].startswith("mesh: its bounding box (")
    assert re.search(
        r"the object looks (0\.99|1) % larger against the mesh", found.failures[1]
    )
    assert not any("claimed" in failure for failure in found.failures)


def test_a_mesh_in_another_unit_or_place_is_not_rendered(
    handmade, verified, monkeypatch
):
    meshes = []

    def spied(plan, audit, truth, mesh, *rest):
        meshes.append(mesh)
        # Where no mesh is given, it is the plan's own that was rendered before.
        return verified[0].reconstruction

    monkeypatch.setattr(verification, "_reconstruct", spied)
    plan = handmade.build_plan()
    mesh = plan.surface.mesh
    found = verify_plan(plan, TriangleMesh(25.4 * mesh.vertices, mesh.faces))
    assert len(found.failures) == 1
    assert found.failures[0].startswith("mesh: ")
    assert meshes == [None]
    assert found.reconstruction.passed
    for changed, rendered in (
        (mesh.vertices + [0.06, 0.0, 0.0], False),
        (mesh.vertices + [0.04, 0.0, 0.0], True),
        (1.4 * mesh.vertices, True),
        (mesh.vertices / 1.6, False),
        (mesh.vertices, False),
    ):
        verify_plan(plan, TriangleMesh(changed, mesh.faces))
        assert (meshes[-1] is not None) is rendered
        if rendered:
            assert np.array_equal(meshes[-1].vertices, changed)


def test_a_changed_surface_is_refused(handmade, tmp_path):
    path = handmade.save(handmade.build_plan(), tmp_path)
    other = handmade.build_plan("parallel").surface
    (tmp_path / "surface.npz").write_bytes(other.content)
    with pytest.raises(PlanFileError, match="SHA-256"):
        RigPlan.load(path)


def test_one_shape_in_other_triangles_is_the_same_mesh():
    mesh = sphere(0.05, subdivisions=3)
    quarters = mesh.corners
    middle = (quarters + np.roll(quarters, -1, axis=1)) / 2
    a, b, c = (quarters[:, i] for i in range(3))
    ab, bc, ca = (middle[:, i] for i in range(3))
    corners = np.concatenate(
        [
            np.stack(t, axis=1)
            for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ]
    )
    finer = TriangleMesh(
        corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    )
    assert compare_meshes(mesh, mesh, 0) == []
    assert compare_meshes(finer, mesh, 0) == []


def test_another_shape_in_the_same_box_is_named():
    mesh = sphere(0.05, subdivisions=3)
    dented = mesh.vertices.copy()
    dented[(np.abs(dented) > 0.02).all(axis=1)] *= 0.97
    other = TriangleMesh(dented, mesh.faces)
    assert "another shape" in compare_meshes(other, mesh, 0)[0]
    doubled = TriangleMesh(mesh.vertices, np.vstack([mesh.faces, mesh.faces]))
    assert "area" in compare_meshes(doubled, mesh, 0)[0]


def test_a_lid_too_small_for_draws_by_area_is_another_shape():
    """On the mouth of a pit, 1e-5 of the area: what is in it would be out of reach."""
    top = grid(1.0, 1.0, divisions=(200, 200))
    middle = np.argmin(np.linalg.norm(top.face_centroids[:, :2], axis=1))
    mouth = top.corners[middle]
    floor = mouth - [0.0, 0.0, 0.2]
    walls = [
        [[mouth[k], floor[k], floor[k - 1]], [mouth[k], floor[k - 1], mouth[k - 1]]]
        for k in range(3)
    ]
    pit = np.concatenate([*walls, [floor]])
    open_ones = np.delete(top.corners, middle, axis=0)
    meshes = [
        TriangleMesh(
            corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3)
        )
        for corners in (
            np.concatenate([open_ones, pit]),
            np.concatenate([top.corners, pit]),
        )
    ]
    (why,) = compare_meshes(*meshes, 0)
    assert "another shape" in why


def test_a_sheet_without_thickness_in_other_triangles_is_the_same_mesh():
    one, other = (grid(1.0, 1.0, divisions=(n, n)) for n in (3, 7))
    sheets = [
        TriangleMesh(m.vertices, np.vstack([m.faces, m.faces[:, ::-1]]))
        for m in (one, other)
    ]
    assert compare_meshes(*sheets, 0) == []


def test_faces_that_look_the_other_way_are_named():
    """Of half a ball, down to three faces: N is what light and view are limited by."""
    mesh = sphere(0.05, subdivisions=3)
    for part in (2, 20, 400):
        turned = mesh.faces.copy()
        some = slice(len(turned) // part)
        turned[some] = turned[some, ::-1]
        (why,) = compare_meshes(mesh, TriangleMesh(mesh.vertices, turned), 0)
        assert "looks the other way" in why


def test_what_is_said_of_the_file_is_held_against_the_file(tmp_path, handmade):
    path = tmp_path / "ball.stl"
    ball = sphere(50.0, subdivisions=2)
    trimesh.Trimesh(ball.vertices, ball.faces).export(path)
    mesh = load_mesh(path, size_mm=90.0)
    assert mesh.source.repairs

    def saying(**figures):
        def change(document):
            document["meshes"][0] |= asdict(mesh.source) | figures

        return compare_records(mesh, handmade.tampered(handmade.build_plan(), change))

    assert saying() == saying(n_faces=7, sha256="0" * 64) == []
    for name, value in (
        *(("n_vertices", 7), ("n_faces", 7), ("unit", "mm"), ("scale_to_m", 1e-3)),
        ("repairs", [{"kind": "holes_closed", "count": 12}]),
    ):
        (false,) = saying(**{name: value})
        assert false.startswith(f"meshes.0.{name}: ")
