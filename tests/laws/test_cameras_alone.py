"""`--pattern none` from mesh to audited plan, what it can't be asked with, and lies."""

import json

import pytest
from click.testing import CliRunner
from support.little_work import draw_fewer, work_little

from geometry.shapes.primitives import sphere
from planning import load_rig, plan_rig
from planning.cameras.photogrammetry import view_selection
from planning.cli.main import commands
from planning.model.errors import InputError, PlanFileError
from planning.model.plan import RigPlan
from planning.proofs import camera_bound
from planning.report.page.page import page_of
from planning.report.summary.brief import brief
from planning.report.summary.summary import summary
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.devices.camera_figures import camera_figures
from planning.verify.verification import verify_plan

RIG = """
base = "default"
name = "alone"
[placement]
n_candidate_projectors = 24
n_candidate_cameras = 24
n_reference_projectors = 600
n_reference_cameras = 400
"""
# Of a sphere little is seen by many: less is asked for, and fewer cameras do.
ASKED = {"max_projectors": 0, "pattern": "none", "target": "surface"}
ASKED |= {"coverage": 0.6, "min_reachable": 0.3, "check": False, "threads": 1}


def prove_little(patch):
    """Let covers by pairs cost little: what is proved of them has tests of its own."""
    draw_fewer(patch, cameras=400)
    patch.setattr(camera_bound, "DEFAULT", camera_bound.ROUGH)
    for name in ("_BUDGET", "_AGAIN"):
        patch.setattr(view_selection, name, 3e7)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "alone.toml"
    path.write_text(RIG)
    return load_rig(str(path))


@pytest.fixture(scope="module")
def ball():
    return sphere(0.08, subdivisions=3)


@pytest.fixture(scope="module")
def plan(ball, rig):
    with pytest.MonkeyPatch.context() as patch:
        work_little(patch)
        prove_little(patch)
        return plan_rig(ball, rig, **ASKED)


def test_there_is_no_projector_and_nothing_of_one(plan):
    document = plan.to_document()
    assert document["projectors"] == []
    assert "projectors" not in document["certificates"]
    for name in ("ring_axes", "firing_schedule", "survival", "robust"):
        assert name not in document
    assert "texture" in document["assumed"][0]
    assert document["requirements"]["min_views"] == 2
    assert document["cost"]["n_frames"] == 1
    assert plan.surface.reference_projectors.shape == (0, 4, 4)


def test_counts_and_areas_keep_their_order(plan):
    proof, areas = plan.document.certificates.cameras, plan.coverage.target
    assert 2 <= proof.continuous.lower_bound <= proof.needed.lower_bound
    assert proof.candidates.lower_bound <= len(plan.cameras) == proof.count
    assert areas.measured_m2 <= areas.reachable_by_cameras_m2 <= areas.lit_m2
    assert areas.lit_m2 == areas.area_m2
    assert areas.measured_m2 >= 0.6 * areas.reachable_by_cameras_m2
    missing = sum(plan.coverage.uncovered_by_cause.values())
    assert missing == pytest.approx(areas.area_m2 - areas.measured_m2)
    assert set(plan.coverage.sigma.terms_rms_m) == {"matches", "camera"}


def test_the_audit_confirms_every_claim(plan):
    audit = audit_plan(plan, threads=1)
    assert audit.failures == ()
    assert audit.unmet == ()
    told = verify_plan(plan, check_pixels=False, threads=1).summary()
    assert "projectors" not in told
    assert "every claim holds" in told


@pytest.mark.parametrize(
    "words",
    [
        ("accept", "{plan}"),
        ("calibrate", "{plan}"),
        ("reconstruct", "{plan}"),
        ("export", "{folder}", "--to", "mitsuba"),
    ],
)
def test_commands_that_need_projectors_say_so_in_a_line(plan, tmp_path, words):
    plan.save(tmp_path / "plan.json")
    places = {"plan": tmp_path / "plan.json", "folder": tmp_path}
    words = [word.format(**places) for word in words]
    result = CliRunner().invoke(commands, [*words, "--quiet"])
    said = result.output + str(result.exception)
    assert isinstance(result.exception, InputError | SystemExit)
    assert "pattern is 'none'" in said


def test_what_stands_there_has_projectors_where_the_plan_has(plan, handmade):
    with pytest.raises(InputError, match="projectors both, or neither"):
        verify_plan(handmade.make_plan(), truth=plan, threads=1)


def test_what_is_written_is_what_is_read(plan, tmp_path):
    plan.save(tmp_path / "plan.json")
    again = RigPlan.load(tmp_path / "plan.json")
    assert again.to_document() == plan.to_document()
    assert again.cameras_alone


def test_words_tell_of_cameras_and_texture_alone(plan):
    for text in (brief(plan, (), ()), summary(plan, (), ())):
        assert "texture" in text
        assert " lit " not in text
        assert "projector" not in text
    figures = camera_figures(plan, threads=1)
    best = [max(f.triangulation.values(), key=lambda a: a is not None) for f in figures]
    low, high = plan.requirements.triangulation.angles
    for spread in best:
        assert low <= spread[0] <= spread[2] <= high
    page = page_of(plan, threads=1)
    assert "pairs of cameras that measure it" in page


def told(change):
    """The change of a document that `change` makes."""

    def lie(plan):
        document = plan.to_document()
        change(document)
        return RigPlan.from_document(json.loads(json.dumps(document)), plan.surface)

    return lie


def scaled(*path, by):
    def change(document):
        *way, last = path
        for key in way:
            document = document[key]
        document[last] *= by

    return told(change)


def all_alone(document):
    camera = document["cameras"][0]
    camera["sole_area_m2"] = camera["seen_area_m2"]


def bound_of_99(document):
    document["certificates"]["cameras"]["candidates"]["lower_bound"] = 99


def one_measures(document):
    (row,) = (row for row in document["marginal"] if row["n_cameras"] == 1)
    row["measured_surface_m2"] = 1e-6


def row_of_two(document):
    document["certificates"]["cameras"]["by_count"][0]["count"] = 2


def cleared(key, value):
    return told(lambda document: document.update({key: value}))


@pytest.mark.long
@pytest.mark.parametrize(
    ("lie", "where"),
    [
        (scaled("coverage", "target", "measured_m2", by=1.1), "target.measured_m2"),
        (scaled("coverage", "sigma", "median_m", by=1.2), "sigma.median_m"),
        (scaled("coverage", "sigma", "noise_p95_m", by=0.8), "sigma.noise_p95_m"),
        (
            scaled("coverage", "sigma", "terms_rms_m", "camera", by=1.1),
            "terms_rms_m.camera",
        ),
        (scaled("cameras", 0, "seen_area_m2", by=1.3), "C1.seen_area_m2"),
        (
            scaled("coverage", "uncovered_by_cause", "few_views", by=1.4),
            "uncovered_by_cause",
        ),
        (told(all_alone), "C1.sole_area_m2"),
        (told(bound_of_99), "candidates.lower_bound"),
        (told(lambda d: d["requirements"].update(min_views=3)), "measured_m2"),
        (cleared("assumed", []), "assumed"),
        (told(lambda d: d["cost"].update(n_frames=2)), "cost.n_frames"),
        (told(one_measures), "marginal.cameras.1"),
        (told(row_of_two), "by_count"),
        (
            told(lambda d: d["requirements"]["triangulation"].update(max_angle=1.3)),
            "triangulation.max_angle",
        ),
    ],
)
def test_lies_are_found(plan, lie, where):
    failures = audit_plan(lie(plan), threads=1).failures
    assert any(where in failure for failure in failures), failures


def test_a_bound_that_fewer_of_the_plans_cameras_refute_is_found(plan):
    """With one camera more than it takes, the bound can't be their number."""
    extra = [*plan.document.cameras, plan.document.cameras[0].changed(id="C99")]
    n = len(extra)
    document = plan.document.changed(cameras=tuple(extra))
    proof = document.certificates.cameras
    proof = proof.changed(
        count=n,
        required_m2=0.8 * proof.required_m2,
        status="optimal",
        candidates=proof.candidates.changed(lower_bound=n, for_total=n),
        needed=proof.needed.changed(count=n, lower_bound=n),
    )
    certificates = document.certificates.changed(cameras=proof)
    false = RigPlan(document.changed(certificates=certificates), plan.surface)
    failures = audit_plan(false, threads=1).failures
    assert any(f"{n} is claimed, but {n - 1} of the plan's" in f for f in failures)


def test_a_certificate_of_no_projector_isnt_read(plan):
    document = plan.to_document()
    document["certificates"]["projectors"] = document["certificates"]["cameras"]
    with pytest.raises(PlanFileError, match=r"certificates\.projectors is there"):
        RigPlan.from_document(document, plan.surface)
    document = plan.to_document()
    document["requirements"]["pattern"] = "rings"
    with pytest.raises(PlanFileError, match=r"certificates\.projectors is missing"):
        RigPlan.from_document(document, plan.surface)


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        ({"max_projectors": 2}, "has no projector"),
        ({"max_projectors": None}, "stand"),
        ({"max_cameras": 1}, "max_cameras = 1 must be 2 or more"),
        ({"views": 1}, "views = 1 must be from 2 to 8"),
        ({"views": 9}, "views = 9 must be from 2 to 8"),
        ({"views": 4, "max_cameras": 3}, "seen by more cameras than there may be"),
        ({"survive": 1}, "the loss of a camera"),
        ({"robust": 0.9}, "leave robust out"),
        ({"cameras_by": "paper"}, "take 'cover'"),
        ({"ring_axis": "free"}, "there is no ring"),
    ],
)
def test_what_it_cant_be_asked_with_is_refused_in_a_line(ball, rig, wish, words):
    with pytest.raises(InputError, match=words) as refused:
        plan_rig(ball, rig, **(ASKED | wish))
    assert "\n" not in str(refused.value)


def test_bodies_and_standing_devices_are_refused(ball, tmp_path):
    for more, words in (
        (
            "[camera.body]\nsize_mm = [50, 50, 50]\ncentre_mm = [0, 0, -30]\n",
            r"leave \[camera\.body\] out",
        ),
        (
            '[[existing]]\nkind = "camera"\nname = "old"\n'
            "position_mm = [1100, 0, 0]\naim_mm = [0, 0, 0]\n",
            "old stand already",
        ),
    ):
        path = tmp_path / "more.toml"
        path.write_text(RIG + more)
        with pytest.raises(InputError, match=words):
            plan_rig(ball, load_rig(str(path)), **ASKED)


@pytest.mark.long
def test_obstacles_stand_in_the_way_and_the_audit_confirms_the_plan(
    ball, tmp_path, monkeypatch
):
    work_little(monkeypatch)
    prove_little(monkeypatch)
    path = tmp_path / "bench.toml"
    path.write_text(
        f'{RIG}\n[[obstacle]]\nname = "bench"\nshape = "table"\n'
        "size_mm = [600, 600, 30]\n"
    )
    plan = plan_rig(ball, load_rig(str(path)), **ASKED)
    assert [one.name for one in plan.document.rig.obstacle] == ["bench"]
    assert audit_plan(plan, threads=1).failures == ()
