"""Claims to the last digit, what was asked beside what was used, what is believed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from support.little_work import work_least
from support.small_job import run

from planning.cli.main import commands
from planning.cli.other_commands import write_sample
from planning.model.document.made_with import MadeWith
from planning.model.document.request_records import asked_digest
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.report.made_again import again_or_why_not
from planning.verify.again_claims import compare_again
from planning.verify.held_figures import EXACTLY
from planning.verify.no_claims import claims_alone, is_under
from planning.verify.trust import OVER_POSES, is_trusted, of_surface
from planning.verify.verification import verify_plan


@pytest.fixture(scope="module", autouse=True)
def _few():
    """Whatever claims rest on, they come out again of as many."""
    with pytest.MonkeyPatch.context() as patch:
        work_least(patch)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("held")
    write_sample(folder / "head.obj", n_faces=900)
    assert run(folder / "head.obj", folder).plan is not None
    return folder


@pytest.fixture(scope="module")
def plan(folder):
    return RigPlan.load(folder / "plan" / "plan.json")


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A plan whose cameras are asked for more than any pose measures."""
    folder = tmp_path_factory.mktemp("short")
    write_sample(folder / "head.obj", n_faces=900)
    words = ["--accuracy", "0.05", "--min-reachable", "1"]
    ended = run(folder / "head.obj", folder, words)
    assert ended.code == 1
    assert ended.plan["coverage"]["unmeasurable_by_cause"]
    return RigPlan.load(folder / "plan" / "plan.json")


def forged(plan, change):
    """A changed copy whose digests are made anew."""
    document = plan.to_document()
    change(document)
    read = RigPlan.from_document(document, plan.surface).document
    digest = asked_digest(read.request, read.requirements, read.rig)
    for part in (document["coverage"], document["certificates"]):
        part["asked"] = digest
    document["members"][0]["coverage"] = document["coverage"]
    return RigPlan.from_document(document, plan.surface)


def found(plan, again=again_or_why_not, **how):
    return verify_plan(plan, check_pixels=False, again=again, threads=1, **how)


def test_claims_come_out_again_to_the_last_digit(plan):
    honest = found(plan)
    assert honest.failures == ()
    assert honest.claims_held == EXACTLY
    assert f"claims held {EXACTLY}" in honest.summary()


@pytest.mark.long
@pytest.mark.parametrize(
    ("place", "key"),
    [
        (("coverage", "target", "lit_m2"), "coverage.target.lit_m2"),
        (("regions", 0, "mean_curvedness"), "regions.0.mean_curvedness"),
        (("projectors", 0, "rings", "gap_m", 0), "projectors.0.rings.gap_m.0"),
        (("projectors", 0, "ring_shares", "measured", 9), "ring_shares.measured.9"),
        (("marginal", 0, "lit_target_m2"), "marginal.0.lit_target_m2"),
        (("meshes", 0, "shell", "mean_wall_m"), "meshes.0.shell.mean_wall_m"),
    ],
)
def test_a_billionth_shows_where_the_audit_alone_cannot_tell(plan, place, key):
    def nudge(document):
        for name in place[:-1]:
            document = document[name]
        document[place[-1]] *= 1.0 + 1e-9

    edited = forged(plan, nudge)
    alone = found(edited, again=None)
    assert alone.failures == ()
    assert "weren't computed again" in alone.claims_held
    (failure,) = found(edited).failures
    assert failure.split(":")[0].endswith(key)
    assert "the same computation again gives" in failure


@pytest.mark.parametrize("kind", ["projector", "camera"])
def test_a_pose_that_the_rig_offers_and_nobody_may_take_shows(plan, kind):
    """What it alone reaches needn't be lit, and all figures come out as written."""
    name = f"reference_{kind}s"
    poses = getattr(plan.surface, name).copy()
    poses[1] = poses[0]
    surface = replace(plan.surface, **{name: poses})
    document = plan.to_document()
    document["surface"]["sha256"] = surface.sha256()
    again = again_or_why_not(RigPlan.from_document(document, surface), 1)
    assert (
        again["rig"][f"n_candidate_{kind}s"] < document["rig"][f"n_candidate_{kind}s"]
    )
    false = compare_again(document, {"rig": again["rig"]})
    assert len(false) == 1
    assert false[0].startswith(f"rig.n_candidate_{kind}s: claimed")


def test_poses_that_may_be_of_another_plan_are_taken_on_trust(plan):
    told = "define what can be reached"
    assert not any(told in line for line in of_surface(plan, EXACTLY))
    assert any(told in line for line in of_surface(plan, ""))
    without = plan.to_document()
    without["rig"]["camera"]["body"] = {
        "half_m": [0.1, 0.1, 0.1],
        "centre_m": [0.0, 0.0, 0.0],
    }
    bodied = RigPlan.from_document(without, plan.surface)
    (line,) = (each for each in of_surface(bodied, EXACTLY) if told in each)
    assert "(reference_cameras in" in line


@pytest.mark.long
def test_fewer_cameras_are_proved_too_few_with_rings_as_written(short):
    """Finer rings than those that were covered for let candidates reach less."""
    assert found(short, again=None).failures == ()


def test_a_target_of_next_to_no_area_is_false_and_no_crash(plan):
    def tiny(document):
        document["coverage"]["target"]["area_m2"] = 1e-308
        document["regions"][0]["area_m2"] = 1e100
        document["coverage"]["samples"] = 2**53

    assert plan.coverage.sigma is not None
    failures = found(forged(plan, tiny), again=None).failures
    assert any(line.startswith("coverage.target.area_m2") for line in failures)


@pytest.mark.long
def test_why_cameras_reach_too_little_comes_out_again(short):
    honest = found(short)
    assert honest.failures == ()
    assert any("min_reachable" in line for line in honest.unmet)

    def another(document):
        causes = document["coverage"]["unmeasurable_by_cause"]
        causes[next(iter(causes))] *= 1.0 + 1e-9

    (failure,) = found(forged(short, another)).failures
    assert "unmeasurable_by_cause" in failure


def test_made_with_something_else_claims_are_held_within_tolerances(plan):
    made = MadeWith.here().to_document()
    made["libraries"]["numpy"] = "1.0"

    def elsewhere(document):
        document["made_with"] = made
        document["coverage"]["target"]["lit_m2"] *= 1.0 + 1e-9

    other = found(forged(plan, elsewhere))
    assert other.failures == ()
    assert other.claims_held.startswith("within tolerances: made with numpy 1.0")
    assert any("last digits of claims" in line for line in other.trusted)


def test_marginal_rows_are_those_of_the_poses_they_name(plan):
    def other_poses(document):
        row = document["marginal"][0]
        row["reference"] = [(row["reference"][0] + 50) % 100]
        row["lit_target_m2"] *= 0.5

    assert any(
        line.startswith("marginal.projectors.1")
        for line in found(forged(plan, other_poses), again=None).failures
    )

    def nowhere(document):
        document["marginal"][0]["reference"] = [100_000]

    with pytest.raises(
        PlanFileError, match=r"marginal\.0\.reference names pose 100000"
    ):
        forged(plan, nowhere)


def test_a_row_of_more_devices_follows_the_one_it_adds_to(plan):
    def later(document):
        rows = [row for row in document["marginal"] if "n_cameras" in row]
        rows[-1]["n_cameras"] += 1

    (failure,) = (
        line
        for line in found(forged(plan, later), again=None).failures
        if "stands before it" in line
    )
    assert failure.startswith("marginal.cameras.")


LEFT_OUT = object()


def edit(place, value):
    def change(document):
        for name in place[:-1]:
            document = document[name]
        if value is LEFT_OUT:
            del document[place[-1]]
        else:
            document[place[-1]] = value

    return change


def test_steep_directions_are_those_that_come_out_of_the_mesh(plan):
    steep = plan.surface.steep.copy()
    face = np.flatnonzero(steep.any(axis=1))[0]
    aside = np.cross(plan.surface.mesh.face_normals[face], steep[face])
    turned = steep[face] + 1e-3 * aside
    steep[face] = turned / np.linalg.norm(turned)
    surface, document = replace(plan.surface, steep=steep), plan.to_document()
    document["surface"]["sha256"] = surface.sha256()
    edited = RigPlan.from_document(document, surface)
    assert found(edited, again=None).failures == ()
    named = {line.split(":")[0] for line in found(edited).failures}
    assert "surface.sha256" in named


@pytest.mark.long
@pytest.mark.parametrize(
    ("place", "value", "named"),
    [
        ("rig.workspace.half_angle_deg", 7.0, "requirements.workspace.half_angle"),
        ("rig.workspace.axis", [1.0, 0.0, 0.0], "requirements.workspace.axis"),
        ("rig.workspace.shape", "cone", "requirements.workspace.half_angle"),
        ("rig.workspace.floor_mm", LEFT_OUT, "rig.workspace.floor_mm"),
        ("rig.calibration.angle_deg", None, "triangulation.calibration.angle"),
        ("rig.calibration.angle_deg", LEFT_OUT, "rig.calibration.angle_deg"),
        ("rig.camera.figures.focal_mm", 24.0, "rig.camera.K"),
        ("rig.camera.figures.pixel_um", LEFT_OUT, "rig.camera.figures"),
        ("rig.camera.figures.resolution_px", [2048, 1537], "rig.camera.resolution"),
        ("rig.camera.figures.focus.f_number", 11.01, "rig.camera.range_m"),
        ("rig.projector.figures.throw_ratio", 1.49, "rig.projector.K"),
        ("rig.projector.figures.vertical_offset_percent", None, "rig.projector.K"),
        ("rig.projector.distortion", [1e-3, 0, 0, 0, 0], "rig.projector.distortion"),
        ("rig.camera.figures.body", {"size_mm": [9.0, 9.0, 9.0]}, "body.half_m"),
        ("rig.rings.tilt", LEFT_OUT, "rig.rings.tilt"),
        ("rig.rings.spacing", "wide", "rings.spacing"),
        ("requirements.workspace.half_angle", 2.0, "requirements.workspace.half_angle"),
        ("requirements.triangulation.max_angle", 7.0, "triangulation.max_angle"),
    ],
)
def test_what_was_used_is_what_the_rig_states(plan, place, value, named):
    edited = forged(plan, edit(place.split("."), value))
    failures = found(edited, again=None).failures
    assert any(line.split(":")[0].endswith(named) for line in failures), failures


@pytest.mark.parametrize(
    ("stated", "false"),
    [
        ({"position_mm": 5.0}, []),
        ({}, ["position_m"]),
        ({"position_mm": 9.0, "angle_deg": 1.0}, ["position_m", "angle"]),
    ],
)
def test_drawn_rigs_are_mounted_as_loosely_as_the_rig_states(plan, stated, false):
    asked = dict.fromkeys(("dominant_coverage", "coverage", "region_coverage"), 0.1)
    mounting = {"position_m": 0.005, "angle": 0.0, "focal": 0.0}
    asked |= {"quantile": 0.9, "mounting": mounting, "max_sigma_m": 1e-3}

    def robust(document):
        document["requirements"]["robust"] = asked
        document["rig"]["mounting"] = stated

    key = "requirements.robust.mounting."
    failures = found(forged(plan, robust), again=None).failures
    told = [line.split(":")[0] for line in failures if line.startswith(key)]
    assert told == [key + name for name in false]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("rig.rings.tilt", "much"),
        ("rig.rings.gap_m", True),
        ("rig.rings.margin_m", None),
        ("rig.workspace.half_angle_deg", [1.0]),
        ("rig.workspace.axis", {"x": 1.0}),
        ("rig.workspace.axis", [0.0, 0.0, 0.0]),
        ("rig.calibration.position_mm", "much"),
        ("requirements.triangulation.drawn_edges.camera_px", -0.6),
        ("requirements.triangulation.drawn_edges.in_focus_m", -2.5e-4),
        ("projectors.0.rings.left_out", [-1.0]),
        ("certificates.cameras.best_area.scope", "every pose"),
        ("certificates.projectors.one_fewer.scope", ""),
    ],
)
def test_what_no_rig_can_state_is_refused_when_read(plan, place, value):
    keys = [int(key) if key.isdigit() else key for key in place.split(".")]
    with pytest.raises(PlanFileError, match=r"plan again$") as refused:
        forged(plan, edit(keys, value))
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("value", [{"x": 1}, "much", [[1.0], 2.0], True])
def test_a_rig_table_that_holds_anything_is_told_and_never_crashes(plan, value):
    def change(document):
        document["rig"]["workspace"]["up"] = value
        document["rig"]["rings"]["axis"] = value

    failures = found(forged(plan, change), again=None).failures
    assert any(line.startswith("request.up: claimed 'z'") for line in failures)


def test_what_is_loosened_afterwards_is_named_with_its_pair(plan):
    def used(document):
        document["requirements"]["coverage"] = 0.5

    assert (
        "requirements.coverage: claimed 0.5, but request.coverage is 0.95"
        in found(forged(plan, used), again=None).failures
    )

    def asked_too(document):
        used(document)
        document["request"]["coverage"] = 0.5

    failures = found(forged(plan, asked_too), again=None).failures
    assert (
        "request.coverage: claimed 0.5, but rig.requirements.coverage is 0.95"
        in failures
    )
    assert not any(line.startswith("requirements.coverage") for line in failures)

    def check(document):
        document["requirements"]["check"]["max_rms_m"] = 1.0

    (failure,) = found(forged(plan, check), again=None).failures
    assert "rig.check.max_rms_mm [m] is 0.0001" in failure


@pytest.mark.parametrize(
    ("asked", "there", "used", "whose"),
    [
        (None, 5, 5, ""),
        (9, 5, 5, ""),
        (4, 5, 4, ""),
        (4, 5, 5, "request.max_cameras is 4"),
        (9, 5, 9, "rig.camera.count is 5"),
        (9, 5, 4, "rig.camera.count is 5"),
        (None, 5, None, "rig.camera.count is 5"),
        (None, None, 5, "request.max_cameras is None"),
    ],
)
def test_as_many_are_allowed_as_were_asked_and_are_there(
    plan, asked, there, used, whose
):
    def change(document):
        document["request"]["max_cameras"] = asked
        document["rig"]["camera"]["count"] = there
        document["requirements"]["max_cameras"] = used

    failures = found(forged(plan, change), again=None).failures
    told = [line for line in failures if line.startswith("requirements.max_cameras")]
    assert [line.rpartition("but ")[2] for line in told] == [whose] * bool(whose)


def test_parts_derived_from_other_requirements_say_so(plan):
    document = plan.to_document()
    document["requirements"]["coverage"] = document["request"]["coverage"] = 0.5
    document["request"]["given"].append("coverage")
    edited = RigPlan.from_document(document, plan.surface)
    named = {line.split(":")[0] for line in found(edited, again=None).failures}
    assert {"coverage.asked", "certificates.asked"} <= named
    assert "requirements.coverage" not in named


def test_a_check_says_of_which_plan_it_was(plan):
    nothing = dict.fromkeys(
        ("accuracy_rms_m", "accuracy_p95_m", "accuracy_bias_m", "predicted_missing"),
        None,
    )
    figures = {"n_points": 0, "n_merged": 0, "redundant_fraction": 0.0, **nothing}
    figures |= {"completeness": [], "pixel_noise": None, "ambient": None}
    figures |= {"passed": False, "asked": plan.coverage.asked}
    figures |= {"failures": ["no point was measured: nothing was decoded"]}

    def named(digest):
        document = plan.to_document()
        document["reconstruction"] = figures | {"plan": digest}
        edited = RigPlan.from_document(document, plan.surface)
        return {line.split(":")[0] for line in found(edited, again=None).failures}

    assert not any(key.startswith("reconstruction") for key in named(plan.digest))
    assert "reconstruction.plan" in named(None)
    assert "reconstruction.plan" in named("0" * 64)


def test_a_request_left_out_shows_where_the_code_is_the_same(plan):
    document = plan.to_document()
    del document["request"]
    for part in (document["coverage"], document["certificates"]):
        del part["asked"]
    document["members"][0]["coverage"] = document["coverage"]
    without = RigPlan.from_document(document, plan.surface)
    (failure,) = found(without).failures
    assert failure.startswith("request: is missing")
    older = found(without, again=None)
    assert older.failures == ()
    assert any(line.startswith("what was asked") for line in older.trusted)


def test_what_is_taken_on_trust_is_told_and_strict_refuses_it(folder, monkeypatch):
    def quick(plan, mesh, **how):
        return verify_plan(plan, mesh, **how | {"check_pixels": False})

    monkeypatch.setattr("planning.cli.checks.verify_command.verify_plan", quick)
    words = ["verify", str(folder / "plan"), "--quiet"]
    result = CliRunner().invoke(commands, words)
    assert result.exit_code == 0
    assert "taken on trust: bounds over all poses" in result.stdout
    assert f"give --mesh {folder / 'head.obj'}" in result.stdout
    strict = [*words, "--strict", "--json", "--mesh", str(folder / "head.obj")]
    result = CliRunner().invoke(commands, strict)
    told = json.loads(result.stdout)
    assert result.exit_code == 1
    assert told["passed"] is True
    assert told["claims_held"] == EXACTLY
    assert not any("--mesh" in line for line in told["taken_on_trust"])


def test_proofs_derives_bounds_over_all_poses_and_refuses_higher_ones(plan):
    honest = found(plan, again=None, over_poses=True)
    assert honest.failures == ()
    told = honest.summary()
    for name in ("projectors", "cameras"):
        bound = getattr(plan.document.certificates, name).continuous
        words = f"{name}: at least {bound.lower_bound} over all poses is proved"
        assert words in told
    assert OVER_POSES not in honest.trusted
    assert not any("over all poses" in line for line in honest.trusted)
    without = found(plan, again=None)
    assert OVER_POSES in without.trusted
    assert "derived again" in without.summary()
    assert "over all poses is" not in without.summary()

    def one_more(document):
        document["certificates"]["projectors"]["continuous"]["lower_bound"] += 1

    edited = replace(forged(plan, one_more), proof=plan.proof)
    (failure,) = (
        line
        for line in found(edited, again=None, over_poses=True).failures
        if "continuous.certificate" in line
    )
    assert "the certificate is of" in failure


def test_strict_holds_where_nothing_is_believed(plan):
    honest = found(plan)
    assert not honest.is_strict
    assert replace(honest, trusted=()).is_strict
    assert not replace(honest, trusted=(), failures=("one",)).is_strict


def test_keys_are_under_a_pattern_as_a_whole():
    assert is_under("rig.camera.sources.focus.blur_px", ["rig.*.sources"])
    assert not is_under("rig.camera.sourcesx", ["rig.*.sources"])
    assert is_trusted("certificates.cameras.by_count.0.upper_bound_m2")
    assert not is_trusted("certificates.cameras.count")
    named = {"rig": {"name": "mine", "name.limit": 3}, "created": "now"}
    assert claims_alone(named) == {"rig": {"name.limit": 3}}
