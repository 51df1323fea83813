"""`plan verify --replan`: the whole plan made again from its words, and held to it."""

import json
import shutil
import sys
from types import SimpleNamespace

import pytest
from click.testing import CliRunner
from support.little_work import work_little
from support.small_job import RIG

from planning.cache.cache import NO_CACHE
from planning.cli.checks.planned_again import PlannedAgain
from planning.cli.declared.asked_again import asked_again
from planning.cli.main import commands
from planning.cli.other_commands import write_sample
from planning.model.errors import InputError
from planning.model.plan import RigPlan
from planning.verify.held_figures import WHOLLY, hold_claims

pytestmark = pytest.mark.long

WORDS = "--mesh head.obj --rig few.toml --max-projectors 3 --cameras-by cover"


@pytest.fixture(scope="module", autouse=True)
def _little():
    with pytest.MonkeyPatch.context() as patch:
        work_little(patch)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plan whose command is what was run, where its files lie."""
    folder = tmp_path_factory.mktemp("again")
    write_sample(folder / "head.obj", n_faces=900)
    (folder / "few.toml").write_text(RIG)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        words = [*WORDS.split(), "--no-check", "--no-report", "--quiet", "-o", "plan"]
        patch.setattr(sys, "argv", ["plan", *words])
        assert CliRunner().invoke(commands, words).exit_code == 0
    return folder


@pytest.fixture(scope="module")
def plan(folder):
    return RigPlan.load(folder / "plan" / "plan.json")


@pytest.fixture(scope="module")
def made(folder, plan, tmp_path_factory):
    """From files that lie elsewhere, by two threads."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("elsewhere"))
        mesh, rig = folder / "head.obj", folder / "few.toml"
        return PlannedAgain(plan, asked_again(plan, mesh, str(rig)), quiet=True)(
            plan, 2
        )


def held(plan, made, change):
    document = plan.to_document()
    change(document)
    edited = RigPlan.from_document(document, plan.surface)
    return hold_claims(edited, lambda _plan, _threads: made, 1)


def test_nothing_but_times_and_words_is_left_to_believe(
    folder, plan, made, monkeypatch
):
    monkeypatch.chdir(folder)
    again = "planning.cli.checks.planned_again.PlannedAgain._again"
    read = RigPlan.from_document(made, plan.surface)
    monkeypatch.setattr(again, lambda _self, _threads: read)
    words = ["verify", "plan", "--replan", "--strict", "--quiet"]
    result = CliRunner().invoke(commands, words)
    assert f"claims held {WHOLLY}" in result.stdout
    # The run recorded no check, so no figure of one is believed or held.
    assert "taken on trust: bounds" not in result.stdout
    assert "FALSE" not in result.stdout


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("certificates", "projectors", "continuous", "n_cells"), 3),
        (("certificates", "projectors", "greedy_count"), 9),
        (("certificates", "projectors", "by_count", 0, "upper_bound_m2"), 1.0),
        (("rig", "camera", "figures", "pixel_um"), 3.46),
        (("rig", "n_candidate_cameras"), 41),
        (("request", "accuracy_of"), "noise"),
        (("seed",), 1),
        (("meshes", 0, "sha256"), 64 * "0"),
    ],
)
def test_what_was_taken_on_trust_shows_when_it_was_edited(plan, made, place, value):
    def edit(document):
        for name in place[:-1]:
            document = document[name]
        assert document[place[-1]] != value
        document[place[-1]] = value

    false, _ = held(plan, made, edit)
    assert any(line.startswith(".".join(map(str, place))) for line in false)


def test_parts_that_planning_doesn_t_write_are_no_part_of_the_plan(plan, made):
    fewer = json.loads(json.dumps(made))
    # Of parts that the plan's own code makes again alone, null says "not computed".
    fewer["meshes"][0]["shell"] = fewer["survival"] = None
    del fewer["requirements"]["projector"]["max_incidence"]
    false, _ = held(plan, fewer, lambda document: None)
    named = {line.split(":")[0] for line in false}
    assert named >= {"meshes.0.shell", "requirements.projector.max_incidence"}


def test_times_words_and_advice_are_no_claims(plan, made):
    def reworded(document):
        document["created"] = "2020-01-01T00:00:00Z"
        document["command"] = ["plan", "else"]
        document["timings_s"] = dict.fromkeys(document["timings_s"], 0.0)

    assert held(plan, made, reworded) == ((), WHOLLY)


def asks(plan, **changes):
    document = plan.to_document() | changes
    return RigPlan.from_document(document, plan.surface)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"command": []}, "no words of a command are recorded"),
        ({"command": ["plan", *WORDS.split(), "--pareto"]}, "one of several"),
        ({"command": ["plan", "x.obj", "--take", "2,1"]}, "one of several"),
        ({"command": ["plan", "--mesh", "x.obj", "--madness"]}, "--madness"),
        ({"command": ["plan", "verify", "x"]}, "give --max-projectors"),
        ({"command": ["plan", "--help"]}, "No such option"),
        ({"command": ["plan", "--mesh", "x\0.obj"]}, "no command line does"),
        ({"truncated": True}, "the run was cut"),
    ],
)
def test_what_can_t_be_planned_again_is_said_in_a_line(plan, changes, why):
    with pytest.raises(InputError, match=f"({why}).*without --replan"):
        asked_again(asks(plan, **changes))


def test_no_clock_cuts_it_and_nothing_stays(plan, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    words = [*WORDS.split(), "--time-limit", "9", "-o", "here"]
    limited = asks(plan, command=["plan", *words])
    asked = {}

    def planned(options, command, cache, **how):
        asked.update(options, command=list(command), cache=cache, how=how)
        plan.save(options["output"] / "plan.json")

    monkeypatch.setattr("planning.cli.checks.planned_again.planned_once", planned)
    options = asked_again(limited, mesh=tmp_path / "other.obj")
    again = PlannedAgain(limited, options, quiet=True)
    assert again(limited, 3) == plan.to_document()
    assert asked["time_limit"] is None
    assert (asked["threads"], asked["cache"]) == (3, NO_CACHE)
    assert (asked["command"], asked["how"]) == (words, {"show": False})
    assert asked["meshes"] == (str(tmp_path / "other.obj"),)
    assert not asked["output"].exists()
    assert not list(tmp_path.iterdir())


def test_members_are_held_to_their_own_and_planned_once(plan, monkeypatch):
    made = []

    def again(_self, _threads):
        made.append(1)
        told = [SimpleNamespace(to_document=lambda k=k: {"member": k}) for k in "ab"]
        return SimpleNamespace(members=told, to_document=lambda: {"member": "all"})

    monkeypatch.setattr(PlannedAgain, "_again", again)
    family = SimpleNamespace(members=(object(), object(), object()))
    planned = PlannedAgain(family, {}, quiet=True)
    told = [planned(one, 1) for one in (family, *family.members)]
    assert told == [{"member": "all"}, {"member": "a"}, {"member": "b"}, {}]
    assert made == [1]


def test_a_plan_that_doesn_t_say_its_words_exits_3(folder, tmp_path):
    shutil.copytree(folder / "plan", tmp_path / "unsaid")
    path = tmp_path / "unsaid" / "plan.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"command": []}))
    result = CliRunner().invoke(
        commands, ["verify", str(tmp_path / "unsaid"), "--replan", "--quiet"]
    )
    assert result.exit_code == 3
    assert result.stderr.count("\n") == 1
