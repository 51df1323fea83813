"""Devices that stand already: in every plan, never moved, and counted as given."""

import copy
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from support.factories import EXACT, make_projector, make_requirements, make_scene
from support.plain_shapes import box
from support.written import requirements_of

from geometry.shapes.primitives import sphere
from planning import load_rig, plan_rig
from planning.model.devices.bodies import Existing
from planning.model.devices.planned import PlannedCamera
from planning.model.errors import InfeasibleLimitsError, PlanFileError, RigError
from planning.model.plan import RequirementError, RigPlan
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import plan_projectors
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.all_poses import Effort
from planning.proofs.marginals import marginals
from planning.proofs.selection import CandidateCover, select_fewest
from planning.report.claims.claims import make_claims
from planning.report.claims.judged import Devices
from planning.report.summary.summary import summary
from planning.rig.wishes import Wishes
from planning.verify.audit.audit import audit_plan

CENTRE = np.array([0.3, -0.2, 0.1])
OLD = (
    '[[existing]]\nname = "old projector"\nkind = "projector"\n'
    "position_mm = [100, -1200, 300]\naim_mm = [0, 20, 10]\nroll_deg = 15\n"
)
# The camera's body reaches across the upper part of the projector's beam.
BODIES = (
    "[existing.body]\nsize_mm = [700, 60, 60]\ncentre_mm = [350, -140, -31]\n"
    "[projector.body]\nsize_mm = [300, 120, 250]\ncentre_mm = [0, -20, -126]\n"
    "[camera.body]\nsize_mm = [60, 60, 120]\ncentre_mm = [0, 0, -61]\n"
)
POSED = (
    '[[existing]]\nname = "old camera"\nkind = "camera"\n'
    "pose_mm = [[1, 0, 0, 50], [0, 0, 1, -1400], [0, -1, 0, 20], [0, 0, 0, 1]]\n"
)


@pytest.fixture
def required_of(tmp_path):
    def build(text, **wishes):
        path = tmp_path / "rig.toml"
        path.write_text(f'base = "default"\n{text}', encoding="utf-8")
        asked = Wishes(**({"max_projectors": 3} | wishes))
        return load_rig(path).requirements(CENTRE, 0.1, asked, tau_m=0.003)

    return build


# ---- rig files


def test_aim_and_pose_are_where_the_file_says(required_of):
    required = required_of(OLD + POSED)
    (projector,) = required.existing_of("projector")
    pose = np.array(projector.world_from_device)
    assert pose[:3, 3] == pytest.approx(CENTRE + [0.1, -1.2, 0.3], abs=1e-5)
    device = load_rig().projector_device()
    local = pose[:3, :3].T @ (np.array([0.0, 0.02, 0.01]) - [0.1, -1.2, 0.3])
    pixel = device.camera_matrix @ (local / local[2])
    assert pixel[:2] == pytest.approx([511.5, 383.5], abs=1e-6)
    (camera,) = required.existing_of("camera")
    assert np.array(camera.world_from_device) == pytest.approx(
        np.array([[1, 0, 0, 0.35], [0, 0, 1, -1.6], [0, -1, 0, 0.12], [0, 0, 0, 1]]),
        abs=1e-12,
    )
    assert requirements_of(required.to_document()) == required
    assert "existing" not in required_of("").to_document()
    assert "existing" not in load_rig().to_document()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (OLD.replace("aim_mm = [0, 20, 10]\n", ""), "needs position_mm and aim_mm"),
        (OLD.replace("[0, 20, 10]", "[100, -1200, 300]"), "must not be its position"),
        (OLD.replace('"projector"', '"lamp"'), r"existing\[0\].kind.*lamp"),
        (OLD.replace("roll_deg", "role_deg"), "did you mean roll_deg"),
        (OLD + OLD, "existing names 'old projector' twice"),
        (POSED + "roll_deg = 3\n", "has pose_mm beside"),
        (POSED.replace("[1, 0,", "[1.01, 0,"), "must be a rotation.*0.02"),
        (POSED.replace("[1, 0,", "[-1, 0,"), r"mirrored \(determinant -1, .*; turn"),
        (POSED.replace("[0, 0, 0, 1]", "[0, 0, 0, 2]"), "last row .* must be 0 0 0 1"),
    ],
)
def test_bad_entries_are_refused(required_of, text, message):
    with pytest.raises(RigError, match=message):
        required_of(text)


def test_more_devices_than_are_allowed_serve_nothing(required_of):
    two = OLD + OLD.replace("old", "second").replace("[100,", "[110,")
    assert len(required_of(two, max_projectors=2).existing) == 2
    with pytest.raises(
        InfeasibleLimitsError,
        match=r"max_projectors = 1 is less than the 2 projectors .* raise --max-proj",
    ) as caught:
        required_of(two, max_projectors=1)
    assert caught.value.exit_code == 4
    with pytest.raises(InfeasibleLimitsError, match="max_cameras = 1 is less"):
        required_of(POSED + POSED.replace("old", "second"), max_cameras=1)


# ---- covers


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("given", [1, 2])
def test_covers_hold_what_is_given_and_are_the_fewest_that_do(seed, given):
    covers = np.random.default_rng(seed).random((40, 9)) < 0.3
    covers[:, 0] &= np.arange(40) < 3  # so bad that no free cover would take it
    cover = CandidateCover(covers, 0.85, n_existing=given)
    found = select_fewest(cover)
    fewest = next(
        k
        for k in range(given, 10)
        for rest in combinations(range(given, 9), k - given)
        if covers[:, [*range(given), *rest]].any(axis=1).sum() >= found.required
    )
    assert set(range(given)) <= set(found.chosen.tolist())
    assert len(found.chosen) == found.lower_bound == fewest
    others = marginals(cover, found)
    assert min(others.by_count) == given
    assert all(set(range(given)) <= set(c.tolist()) for c in others.by_count.values())
    assert others.greedy >= fewest
    assert all(others.n_covered[n][1] < found.required for n in range(given, fewest))


def test_two_at_one_place_are_refused_with_their_names(required_of):
    """Of bodies at one pose neither would be in the other's way; both can't stand."""
    twin = OLD.replace("old projector", "its twin").replace("roll_deg = 15", "")
    words = "'old projector' and 'its twin' stand at the same place"
    with pytest.raises(InfeasibleLimitsError, match=words):
        required_of(OLD + twin)
    beside = twin.replace("[100, -1200, 300]", "[100, -1200, 301]")
    assert len(required_of(OLD + beside).existing) == 2


# ---- the bound over all poses


def ball_scene(existing):
    """A sphere of which 48 % are asked: two caps of 60 degrees, a quarter each."""
    ball = sphere(0.08, subdivisions=4)
    rig = load_rig("default", light="parallel")
    required = make_requirements(ball, rig, max_projectors=9)
    required = replace(
        required,
        projector=replace(required.projector, min_tangent_angle=0.0),
        dominant_coverage=0.48,
        existing=tuple(existing),
    )
    scene = make_scene(ball, required)
    radii = np.array([0.1, 0.45])
    return scene, make_projector(rig, radii)


def shining(name, towards, aside=0.0):
    """Parallel light along -towards, its beam a distance aside of the ball."""
    z = -np.array(towards, dtype=float)
    x = np.cross([0.3, 0.5, 0.8], z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = -1.1 * z + aside * x
    return Existing(name, "projector", tuple(tuple(row) for row in pose.tolist()))


@pytest.mark.long
@pytest.mark.parametrize(
    ("existing", "count", "idle"),
    [
        ([shining("front", [1, 0, 0])], 2, False),
        ([shining("front", [1, 0, 0]), shining("back", [-1, 0, 0])], 2, True),
        # One that lights nothing is given all the same: two more are needed.
        ([shining("blind", [1, 0, 0], aside=5.0)], 3, False),
    ],
)
def test_the_fewest_over_all_poses_count_those_that_are_given(existing, count, idle):
    scene, template = ball_scene(existing)
    stage = plan_projectors(scene, (template,), 300, rounds=1)
    assert stage.certificate.given == len(existing)
    effort = Effort(finest=6, maps=6, budget=1e9, shadows=np.inf, most_samples=600)
    stage = prove_fewest(scene, stage, (template,), effort)
    proof = stage.certificate
    assert (proof.count, proof.status) == (count, "optimal")
    entry = proof.continuous
    assert (entry.lower_bound, entry.status) == (count, "proved")
    assert entry.n_reached == entry.n_samples >= 600
    assert (entry.n_cells == 0) == idle
    assert (proof.one_fewer is None) == idle
    if not idle:
        assert entry.one_fewer_upper_bound_m2 < proof.required_m2
    standing = [p for p in stage.projectors if p.existing]
    assert [p.existing for p in standing] == [e.name for e in existing]
    widened = {p.existing: p for p in widen_margins(scene, stage) if p.existing}
    for device in existing:
        pose = widened[device.name].world_from_device
        assert np.array_equal(pose, np.array(device.world_from_device))
    assert not any(p.existing for p in stage.reference[len(existing) :])


def test_nothing_is_proved_where_no_sample_of_the_first_draw_is_reached():
    scene, template = ball_scene([])
    stage = plan_projectors(scene, (template,), 300, rounds=1)
    stages = stage.candidates.stages.copy()
    stages[:100] = 0
    dark = replace(stage, candidates=replace(stage.candidates, stages=stages))
    effort = Effort(finest=6, maps=6, budget=1e9, shadows=0.0, most_samples=100)
    assert dark.candidates.reached.any()
    proved = prove_fewest(scene, dark, (template,), effort)
    assert proved.certificate == dark.certificate
    assert proved.certificate.continuous is None


# ---- a whole plan


@pytest.fixture(scope="module")
def planned(tmp_path_factory, with_little_work):
    """A plate, seen from both sides; a projector and a camera before it already."""
    path = tmp_path_factory.mktemp("rig") / "old.toml"
    path.write_text(
        'base = "default"\n'
        + EXACT
        + OLD
        + OLD.replace('"old projector"', '"old camera"')
        .replace('"projector"', '"camera"')
        .replace("[100, -1200, 300]", "[-300, -880, 250]")
        + BODIES
        + "[requirements]\ncoverage = 0.8\ndominant_coverage = 0.8\n"
        "min_reachable = 0.1\nregion_coverage = 0\n"
        "[placement]\nn_candidate_projectors = 600\n"
        "n_candidate_cameras = 400\nn_reference_projectors = 600\n"
        "n_reference_cameras = 400\n"
    )
    plate = box((0.1, 0.01, 0.1), divisions=4)
    try:
        with with_little_work():
            return plan_rig(
                plate,
                load_rig(path),
                max_projectors=3,
                target="surface",
                cameras_by="cover",
                check=False,
            )
    except RequirementError as missed:
        return missed.plan


def test_a_body_in_its_beam_leaves_a_projector_little_to_light(planned):
    (old, *new), areas = (
        planned.to_document()["projectors"],
        planned.to_document()["coverage"]["target"],
    )
    assert old["lit_area_m2"] < 0.2 * min(entry["lit_area_m2"] for entry in new)
    assert areas["lit_m2"] == pytest.approx(0.02, rel=0.01)
    proof = planned.to_document()["certificates"]["projectors"]
    assert proof["excluded_pairs"]["projector_body"] > 400
    assert "bodies of chosen devices" in proof["bounds_leave_out"]
    names = [
        d["id"]
        for kind in ("projectors", "cameras")
        for d in planned.to_document()[kind]
    ]
    assert sorted(planned.to_document()["coverage"]["blocked_by_body_m2"]) == sorted(
        names
    )


def test_they_stay_are_marked_and_the_audit_agrees(planned):
    assert audit_plan(planned, n_samples=4000).failures == ()
    centre = np.array(planned.requirements.workspace.centre)
    for kind, name, place in (
        ("projectors", "old projector", [0.1, -1.2, 0.3]),
        ("cameras", "old camera", [-0.3, -0.88, 0.25]),
    ):
        entries = planned.to_document()[kind]
        (entry,) = [e for e in entries if e.get("existing")]
        assert entry["name"] == name
        stands = np.array(entry["world_from_device"])[:3, 3] - centre
        assert stands == pytest.approx(place, abs=1e-5)
        assert len(entries) >= 2
        proof = planned.to_document()["certificates"][kind]
        assert proof["given"] == 1
        assert proof["count"] == len(entries)
    text = summary(planned, (), ())
    assert text.count("given 1 existing") >= 3
    assert "existing: old camera" in text


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: d["cameras"][0].pop("existing"), "[] are marked existing, but"),
        (
            lambda d: d["requirements"].pop("existing"),
            "holds [], but rig.existing has ['old camera', 'old projector']",
        ),
        (
            lambda d: d["certificates"]["cameras"].pop("given"),
            "certificates.cameras.given: 0 is claimed, but 1",
        ),
        (lambda d: _push(d, 2e-3), "that of the existing 'old projector' is"),
        (
            lambda d: _push(d, 2e-3, everywhere=True),
            "stands 2 mm from where rig.existing has 'old projector'",
        ),
        (lambda d: _set(d, "aim_mm", [0, 25, 10]), "misses the image centre"),
        (lambda d: _set(d, "roll_deg", 14.0), "is rolled by 15 degrees, rig.existing"),
        (lambda d: _set(d, "kind", "camera"), "is a projector, but rig.existing"),
        (
            lambda d: d["projectors"][0].update(lit_area_m2=0.01),
            "P1.lit_area_m2: claimed 0.01",
        ),
        (
            lambda d: d["coverage"]["blocked_by_body_m2"].update(C1=0.004),
            "coverage.blocked_by_body_m2.C1: claimed 0.004 m², recomputed",
        ),
        (
            lambda d: d["coverage"].pop("blocked_by_body_m2"),
            "blocked_by_body_m2: must hold an area for each of ['P1', 'P2', 'P3', 'C1'",
        ),
        (
            lambda d: d["cameras"][1]["body"].update(half_m=[0.03, 0.03, 0.05]),
            "C2.body.half_m: claimed (0.03, 0.03, 0.05), but size_mm is",
        ),
        (lambda d: d["cameras"][1].pop("body"), "C2.body: None is claimed, but the"),
        (
            lambda d: d["requirements"]["existing"][1].pop("body"),
            "requirements.existing.1.body: None is claimed",
        ),
        (
            lambda d: d["certificates"]["cameras"].pop("bounds_leave_out"),
            "cameras.bounds_leave_out: is missing",
        ),
        (lambda d: _beside(d, 0.2), "P1.body: overlaps the body of P3"),
        (
            lambda d: d["cameras"][1]["body"].update(half_m=[0.03, 0.03, 1.1]),
            "C2.body: touches the object",
        ),
        (
            lambda d: d["requirements"]["workspace"].update(floor_m=0.02),
            "P3.body: reaches",
        ),
    ],
)
def test_false_claims_about_them_are_named(planned, change, sentence):
    document = planned.to_document()
    change(document)
    found = audit_plan(
        RigPlan.from_document(document, planned.surface), n_samples=500
    ).failures
    assert any(sentence in failure for failure in found), found


def test_a_count_that_is_no_number_is_refused(planned):
    document = planned.to_document()
    document["certificates"]["projectors"]["but_for_bodies"] = "many"
    with pytest.raises(PlanFileError, match=r"but_for_bodies = 'many' should be"):
        RigPlan.from_document(document, planned.surface)


def _push(document, by_m, *, everywhere=False):
    pose = document["projectors"][0]["world_from_device"]
    pose[0][3] += by_m
    document["projectors"][0]["world_from_ring"][0][3] += by_m
    if everywhere:
        document["requirements"]["existing"][0]["world_from_device"] = pose


def _beside(document, by_m):
    """The third projector a little beside the first."""
    pose = copy.deepcopy(document["projectors"][0]["world_from_device"])
    pose[0][3] += by_m
    document["projectors"][2]["world_from_device"] = pose


def _set(document, key, value):
    document["rig"]["existing"][0][key] = value


def test_a_projector_that_lights_nothing_has_no_margin():
    scene, template = ball_scene(())
    ball = shining("at the ball", [1.0, 0.0, 0.0])
    idle = shining("beside it", [1.0, 0.0, 0.0], aside=0.6)
    poses = [np.array(e.world_from_device) for e in (ball, idle)]
    lamps = tuple(
        replace(template, world_from_device=pose, world_from_ring=pose)
        for pose in poses
    )
    eye = PlannedCamera("C1", lamps[0].world_from_device, load_rig().camera_device())
    claims = make_claims(scene, Devices(lamps, (eye,), lamps, (eye,)))
    lights, nothing = claims.min_margin_rad
    assert lights is not None
    assert 0.0 <= lights < 0.1
    assert nothing is None
    assert claims.lit_area_m2[1] == 0.0


def test_the_summary_says_who_does_nothing_and_asks_no_one_to_register_it(planned):
    document = planned.to_document()
    assert "none of the target" not in summary(planned, (), ())
    document["projectors"][0]["lit_area_m2"] = 0.0
    document["cameras"][0]["seen_area_m2"] = 0.0
    names = [entry["id"] for entry in document["cameras"]]
    document["camera_groups"] = [names[:1], names[1:]]
    text = summary(RigPlan.from_document(document, planned.surface), (), ())
    assert "P1 lights none of the target" in text
    assert "C1 measures none of the target" in text
    assert "don't overlap" not in text
    document["cameras"][0]["seen_area_m2"] = 1e-4
    text = summary(RigPlan.from_document(document, planned.surface), (), ())
    assert "don't overlap" in text
