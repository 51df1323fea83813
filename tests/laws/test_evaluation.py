"""A rig as it stands: closed forms, a plan's own figures, and what may be claimed."""

from dataclasses import replace

import numpy as np
import pytest
from support.little_work import draw_fewer
from support.plain_shapes import box

from geometry.mesh.mesh import TriangleMesh
from planning import load_rig, plan_rig, read_mounted
from planning.model.errors import InputError
from planning.model.plan import RequirementError, RigPlan
from planning.report.summary.shortfall import shortfalls
from planning.report.summary.summary import summary
from planning.verify.audit.audit import audit_plan

HEADER = "name,kind,x_mm,y_mm,z_mm,aim_x_mm,aim_y_mm,aim_z_mm\n"
FEW = (
    "[placement]\nn_candidate_projectors = 600\nn_candidate_cameras = 400\n"
    "n_reference_projectors = 600\nn_reference_cameras = 400\n"
)


def made(mesh, rig, **changes):
    """The plan, whether or not a requirement is missed."""
    # About centred axes a blind curve would take its share of what closed forms say.
    asked = {"max_projectors": None, "target": "surface", "check": False}
    asked |= {"ring_axis": "free"}
    try:
        return plan_rig(mesh, rig, **(asked | changes))
    except RequirementError as missed:
        return missed.plan


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("rig")


def rig_file(folder, name, text):
    (folder / name).write_text(f'base = "default"\n{text}{FEW}', encoding="utf-8")
    return load_rig(folder / name)


# ---- a closed form


@pytest.mark.long
def test_over_a_plate_a_disc_is_lit_and_a_lens_of_two_discs_measured(folder):
    """Incidence alone limits: up to 8 degrees, from 1 m over the plate.

    A projector and a camera at the height h, d apart, serve the discs of radius
    h tan(8 degrees) below them; both serve 2 r² acos(d / 2r) - d/2 sqrt(4 r² - d²).
    """
    limits = (
        "[limits]\nprojector_max_incidence_deg = 8\ncamera_max_incidence_deg = 8\n"
        'min_conditioning = 1e-9\nmax_sigma_mm = "off"\nmin_ring_pitch_px = "off"\n'
    )
    rig = rig_file(folder, "plate.toml", limits)
    # Aimed at the plate's top, 5 mm over the origin of the mesh.
    (folder / "two.csv").write_text(
        f"{HEADER}light,projector,-75,0,1005,-75,0,5\neye,camera,75,0,1005,75,0,5\n"
    )
    plate = box((0.6, 0.5, 0.01), divisions=8)
    top = plate.face_normals[:, 2] > 0.9
    with pytest.MonkeyPatch.context() as patch:
        draw_fewer(patch, claims=60_000, overlaps=3000)
        devices = read_mounted(folder / "two.csv", rig)
        plan = made(plate, rig, fixed=devices, target=None, select=top)
    r, d = np.tan(np.radians(8.0)), 0.15
    disc = np.pi * r**2
    lens = 2 * r**2 * np.arccos(d / (2 * r)) - 0.5 * d * np.sqrt(4 * r**2 - d**2)
    areas = plan.coverage.target
    assert areas.area_m2 == pytest.approx(0.3, rel=1e-9)
    # Three standard errors of 60,000 samples, of which a fifth and a tenth are hits.
    assert areas.lit_m2 == pytest.approx(disc, rel=0.025)
    assert areas.measured_m2 == pytest.approx(lens, rel=0.05)
    causes = plan.coverage.uncovered_by_cause
    assert causes.keys() == {
        *("projector_beam", "projector_incidence", "camera_field", "camera_incidence")
    }
    unseen = causes["camera_field"] + causes["camera_incidence"]
    assert unseen == pytest.approx(disc - lens, rel=0.05)
    assert sum(causes.values()) == pytest.approx(0.3 - lens, rel=0.01)
    assert [d.existing for d in (*plan.projectors, *plan.cameras)] == ["light", "eye"]
    assert audit_plan(plan, n_samples=4000).failures == ()
    text = summary(plan, (), shortfalls(plan))
    assert text.startswith(f"AS BUILT 1 projector, 1 camera of {folder / 'two.csv'}")
    assert "nothing is proved of their number" in text
    asked = "two.csv --max-projectors 2`, mesh and rig as here, keeps these and seeks"
    assert f"{asked} more projectors" in text
    for claim in ("PROVED", "fewest", "MARGINAL", "ROUTES"):
        assert claim not in text


# ---- a plan's own devices


@pytest.fixture(scope="module")
def plate():
    return box((0.1, 0.01, 0.1), divisions=4)


@pytest.fixture(scope="module")
def planned(folder, plate, with_little_work):
    """A plate whose ends most of the workspace doesn't reach, from both sides."""
    wishes = "[requirements]\ncoverage = 0.8\ndominant_coverage = 0.8\n"
    wishes += "region_coverage = 0\n"
    rig = rig_file(folder, "plan.toml", wishes + "min_reachable = 0.1\n")
    with with_little_work(every_pose=True):
        plan = made(plate, rig, max_projectors=3)
    plan.save(folder / "plan" / "plan.json")
    return rig, plan


def test_a_plan_evaluated_has_its_own_figures(folder, plate, planned, with_little_work):
    rig, plan = planned
    with with_little_work(every_pose=True):
        seen = made(plate, rig, fixed=read_mounted(folder / "plan", rig))
    # Something else was asked, in another way; poses that were read are inverted anew.
    told = seen.coverage.changed(asked=plan.coverage.asked, sigma=plan.coverage.sigma)
    assert told == plan.coverage
    ours, theirs = (one.coverage.sigma.to_document() for one in (seen, plan))
    terms = ours.pop("terms_rms_m")
    assert terms == pytest.approx(theirs.pop("terms_rms_m"), rel=1e-9)
    assert ours == pytest.approx(theirs, rel=1e-9)
    # What is reachable is told by the same poses.
    for name in ("reference_projectors", "reference_rings", "reference_cameras"):
        theirs = getattr(plan.surface, name)
        ours = getattr(seen.surface, name)[-len(theirs) :]
        assert ours == pytest.approx(theirs, abs=1e-11), name
    for kind in ("projectors", "cameras"):
        ours, theirs = getattr(seen, kind), getattr(plan, kind)
        assert [device.id for device in ours] == [device.id for device in theirs]
        for one, other in zip(ours, theirs, strict=True):
            assert one.world_from_device == pytest.approx(
                other.world_from_device, abs=1e-11
            )
        proof = getattr(seen.document.certificates, kind)
        assert (proof.status, proof.given) == ("feasible", len(theirs))
        assert (proof.candidates.lower_bound, proof.continuous) == (0, None)
    for one, other in zip(seen.projectors, plan.projectors, strict=True):
        assert np.array_equal(one.ring_radii, other.ring_radii)
        assert np.array_equal(one.world_from_ring, other.world_from_ring)
    assert {r.rings.spacing for r in seen.document.projectors} == {"kept"}
    assert audit_plan(seen, n_samples=4000).failures == ()


def test_another_mesh_is_measured_by_the_same_rings(
    folder, plate, planned, with_little_work
):
    """Half the plate: the middle of either side of it, that the whole had, too."""
    rig, plan = planned
    half = TriangleMesh(plate.vertices * [0.5, 1.0, 1.0], plate.faces)
    with with_little_work(every_pose=True):
        seen = made(half, rig, fixed=read_mounted(folder / "plan", rig))
    for one, other in zip(seen.projectors, plan.projectors, strict=True):
        assert np.array_equal(one.ring_radii, other.ring_radii)
    assert plan.coverage.target.measured_m2 == pytest.approx(0.02, rel=0.01)
    assert seen.coverage.target.measured_m2 == pytest.approx(0.01, rel=0.01)
    assert audit_plan(seen, n_samples=4000).failures == ()


@pytest.mark.long
def test_devices_that_are_kept_count_and_keep_their_names(
    folder, plate, planned, with_little_work
):
    rig, plan = planned
    kept_ids = [plan.projectors[-1].id, plan.cameras[0].id]
    fixed = read_mounted(folder / "plan", rig, kept_ids)
    with with_little_work(every_pose=True):
        again = made(plate, rig, fixed=fixed, max_projectors=3)
    every = {d.id: d for d in (*again.projectors, *again.cameras)}
    assert len(every) == len(again.projectors) + len(again.cameras)
    before = {d.id: d for d in (*plan.projectors, *plan.cameras)}
    for name in kept_ids:
        assert every[name].existing == name
        assert every[name].world_from_device == pytest.approx(
            before[name].world_from_device, abs=1e-11
        )
    lamp = kept_ids[0]
    assert np.array_equal(every[lamp].ring_radii, before[lamp].ring_radii)
    assert np.array_equal(every[lamp].world_from_ring, before[lamp].world_from_ring)
    spacing = {r.id: r.rings.spacing for r in again.document.projectors}
    assert [name for name, how in spacing.items() if how == "kept"] == [lamp]
    proofs = again.document.certificates
    assert (proofs.projectors.given, proofs.cameras.given) == (1, 1)
    assert proofs.projectors.count == len(again.projectors) >= 2
    assert proofs.projectors.candidates.lower_bound >= 1
    assert again.document.evaluation is None
    assert audit_plan(again, n_samples=4000).failures == ()


def test_a_rig_without_a_camera_isnt_one(folder, plate, planned):
    rig, plan = planned
    lamps = read_mounted(folder / "plan", rig, [p.id for p in plan.projectors])
    with pytest.raises(InputError, match="and 0 cameras stand; a rig measures with"):
        plan_rig(plate, rig, max_projectors=None, fixed=lamps)


# ---- limits that devices break, and false claims

ZONES = """
[workspace]
shape = "box"
min_mm = [-1300, -1400, -500]
max_mm = [1300, 1400, 900]
floor_mm = -450
[[workspace.keep_out]]
name = "robot"
centre_mm = [900, -600, -500]
size_mm = [400, 400, 400]
blocks = false
[projector.body]
size_mm = [100, 100, 250]
centre_mm = [0, -20, -126]
[camera.body]
size_mm = [60, 60, 120]
centre_mm = [0, 0, -61]
"""
BROKEN = {
    ("P1", "floor", ""): 0.02,
    ("P1", "keep_out", "robot"): 0.17,
    ("P1", "body", "the floor"): None,
    ("P1", "body", "the walls of the room"): None,
    ("P1", "body", "the keep-out volume 'robot'"): None,
    ("C2", "clearance", "the body of C1"): 0.03,
    ("C3", "body", "the body of C1"): None,
    ("C4", "standoff", "too far"): None,
    ("C4", "box", "box"): 0.9,
}


@pytest.fixture(scope="module")
def broken(folder, plate, with_little_work):
    """A rig that breaks what a planned one keeps."""
    rig = rig_file(folder, "zones.toml", ZONES)
    placement = rig.table.placement.model_copy(update={"clearance_mm": 50.0})
    rig = replace(rig, table=rig.table.model_copy(update={"placement": placement}))
    (folder / "broken.csv").write_text(
        f"{HEADER}in the robot,projector,900,-600,-470,0,0,0\n"
        "one,camera,0,-1000,0,0,0,0\nbeside,camera,80,-1000,0,80,0,0\n"
        "in one,camera,0,-1000,30,0,0,30\nfar,camera,0,-2300,0,0,0,0\n"
    )
    with with_little_work(every_pose=True):
        return made(plate, rig, fixed=read_mounted(folder / "broken.csv", rig))


def test_limits_that_devices_break_are_told_and_refuse_nothing(broken):
    told = {
        (v.device, v.limit, v.what): v.by_m
        for v in broken.document.evaluation.violations
    }
    assert BROKEN.keys() <= told.keys(), told
    for key, by_m in BROKEN.items():
        if by_m is not None:
            assert told[key] == pytest.approx(by_m, abs=1e-5), key
    assert audit_plan(broken, n_samples=1000).failures == ()
    text = summary(broken, (), ())
    assert "P1 (in the robot) stands 170.0 mm inside the keep-out volume" in text
    assert "C3 (in one) touches or reaches into the body of C1" in text


def _without(document, limit):
    told = document["evaluation"]["violations"]
    document["evaluation"]["violations"] = [v for v in told if v["limit"] != limit]


def _first(document, limit):
    told = document["evaluation"]["violations"]
    return next(violation for violation in told if violation["limit"] == limit)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: _without(d, "keep_out"), "P1 keep_out robot: is broken, and isn't"),
        (lambda d: _without(d, "body"), "C3 body the body of C1: is broken, and"),
        (lambda d: _without(d, "clearance"), "C2 clearance the body of C1: is broken"),
        (lambda d: _first(d, "floor").update(by_m=0.03), "P1 floor : claimed 0.03 m"),
        (lambda d: _first(d, "body").update(device="C1"), "C1 body the floor: is clai"),
        (lambda d: _first(d, "box").update(device="C1"), "C1 box box: claimed 0.9 m"),
        (
            lambda d: d["certificates"]["cameras"]["candidates"].update(lower_bound=1),
            "certificates.cameras.status: 'infeasible' and bounds are claimed",
        ),
        (lambda d: d["cameras"][0].pop("existing"), "['C1'] don't stand in an eval"),
    ],
)
def test_false_claims_of_an_evaluation_are_named(broken, change, sentence):
    document = broken.to_document()
    change(document)
    plan = RigPlan.from_document(document, broken.surface)
    found = audit_plan(plan, n_samples=400).failures
    assert any(sentence in failure for failure in found), found


def test_rings_that_were_to_stay_are_held_to_what_they_were(
    folder, plate, planned, with_little_work
):
    rig, _ = planned
    with with_little_work(every_pose=True):
        seen = made(plate, rig, fixed=read_mounted(folder / "plan", rig))
    document = seen.to_document()
    document["projectors"][0]["ring_radii"][3] *= 1.001
    document["projectors"][1]["rings"]["spacing"] = "curvature"
    plan = RigPlan.from_document(document, seen.surface)
    found = audit_plan(plan, n_samples=400).failures
    for sentence in ("P1.ring_radii: claimed", "P2.rings.spacing: 'curvature' is cl"):
        assert any(sentence in failure for failure in found), found
