"""A plan's folder changes as a whole, whatever comes in between."""

import json
import os
import signal
import sys

import pytest
from click import UsageError
from click.testing import CliRunner
from PIL import Image
from support.exported_plans import exported_plan

from planning.cli import output_folder
from planning.cli.console import writable
from planning.cli.main import commands
from planning.cli.output_folder import exchanged, uninterrupted
from planning.cli.plans.saved_plans import SavedPlans
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch

MANIFEST = '{"format": "ringrig-patterns"}'


def fill(folder, text):
    (folder / "plan.json").write_text(text)
    (folder / "patterns").mkdir()
    (folder / "patterns" / "sequence.json").write_text(MANIFEST)
    (folder / "patterns" / f"{text}.png").write_text(text)


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "out"
    with exchanged(place) as fresh:
        fill(fresh, "old")
    (place / "cloud.ply").write_text("ply\nformat\ncomment ringrig cloud\n")
    (place / "captures").mkdir()
    (place / "captures" / "mine.txt").write_text("mine")
    return place


def contents(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


NEW = ["captures/mine.txt", "patterns/new.png", "patterns/sequence.json", "plan.json"]


@pytest.mark.parametrize("exchange", [True, False])
def test_the_new_plan_replaces_the_old_and_leaves_what_others_put_there(
    folder, exchange, monkeypatch
):
    if not exchange:
        monkeypatch.setattr(output_folder, "_exchange", lambda one, other: False)
    with exchanged(folder) as fresh:
        fill(fresh, "new")
        # Until the end the old plan stands.
        assert (folder / "plan.json").read_text() == "old"
    assert contents(folder) == NEW
    assert [p.name for p in folder.parent.iterdir()] == ["out"]
    assert oct(folder.stat().st_mode)[-3:] == oct(0o777 & ~umask())[-3:]


def umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_the_current_folder_keeps_its_place(folder, monkeypatch):
    monkeypatch.chdir(folder)
    with exchanged(folder) as fresh:
        fill(fresh, "new")
    assert contents(folder) == NEW
    assert os.path.samefile(folder, ".")


def test_an_error_leaves_the_old_plan(folder):
    before = contents(folder)

    def fails():
        with exchanged(folder) as fresh:
            fill(fresh, "new")
            raise ValueError("full")

    with pytest.raises(ValueError, match="full"):
        fails()
    assert contents(folder) == before
    assert [p.name for p in folder.parent.iterdir()] == ["out"]


def test_patterns_and_clouds_of_others_are_safe(folder):
    (folder / "cloud.ply").write_text("ply of mine")
    with exchanged(folder) as fresh:
        fill(fresh, "new")
    assert (folder / "cloud.ply").read_text() == "ply of mine"
    (folder / "patterns" / "sequence.json").unlink()
    with pytest.raises(FileExistsError, match="isn't of a plan"), exchanged(folder):
        raise AssertionError("nothing is written")
    assert (folder / "patterns" / "new.png").exists()


@pytest.mark.parametrize("name", ["plan.json", "surface.npz", "rig.png", "patterns"])
def test_another_makers_folder_is_safe_and_told_before_the_work(tmp_path, name):
    (tmp_path / name).mkdir()
    (tmp_path / name / "mine.txt").write_text("mine")
    with pytest.raises(FileExistsError, match=f"{name} isn't of a plan; move it"):
        SavedPlans(tmp_path, print, patterns=False)
    with pytest.raises(FileExistsError, match="isn't of a plan"), exchanged(tmp_path):
        raise AssertionError("nothing is written")
    assert contents(tmp_path) == [f"{name}/mine.txt"]


def test_a_folder_changes_where_nothing_can_stand_beside_it(folder, monkeypatch):
    def may(path, mode):
        return path != folder.parent

    monkeypatch.setattr(output_folder.os, "access", may)
    with exchanged(folder) as fresh:
        assert fresh.parent == folder
        fill(fresh, "new")
    assert contents(folder) == NEW


def test_what_a_killed_run_left_is_cleaned_up(folder):
    """A kill after folders changed places, and one between two moves."""
    left = folder.with_name(".out.ringrig-abc")
    folder.rename(left)
    left.with_name(".out.ringrig-abc-old").mkdir()
    left.rename(left.with_name(".out.ringrig-def-old"))
    left.with_name(".out.ringrig-abc-old").rmdir()
    other = folder.with_name(".out.ringrig-old")
    other.mkdir()
    os.utime(other, (1.0, 1.0))
    with exchanged(folder) as fresh:
        # The old plan is back while the new one is made.
        assert (folder / "plan.json").read_text() == "old"
        fill(fresh, "new")
    assert contents(folder) == NEW
    assert [p.name for p in folder.parent.iterdir()] == ["out"]


@pytest.mark.parametrize("name", ["part [1]", 250 * "n", 125 * "ü"])
def test_a_folder_of_any_name_is_written_and_found_again(tmp_path, name):
    folder = tmp_path / name
    with exchanged(folder) as fresh:
        fill(fresh, "old")
    # As a kill between two moves leaves it.
    folder.rename(f"{fresh}-old")
    with exchanged(folder) as fresh:
        assert (folder / "plan.json").read_text() == "old"
        fill(fresh, "new")
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_a_name_that_no_system_takes_is_refused_before_the_work(tmp_path):
    refused = pytest.raises(UsageError, match="choose another folder")
    with refused, writable(tmp_path / (300 * "n")):
        raise AssertionError("the work began")


@pytest.mark.parametrize(
    ("output", "rule"), [("", "give a file's name"), ("plan.json/x", "folder")]
)
@pytest.mark.parametrize(
    "command", ["report PLAN", "calibrate --accuracy 1 PLAN", "sample"]
)
def test_a_file_that_cant_be_written_is_refused_before_the_work(
    tmp_path, monkeypatch, command, output, rule
):
    def work(*_, **__):
        raise AssertionError("the work began")

    exported_plan().save(tmp_path / "plan.json")
    monkeypatch.setattr("planning.cli.other_commands.plan_images", work)
    monkeypatch.setattr("planning.cli.other_commands.write_sample", work)
    monkeypatch.setattr("planning.cli.show_command.write_page", work)
    words = command.replace("PLAN", str(tmp_path)).split()
    done = CliRunner().invoke(commands, [*words, "-o", str(tmp_path / output)])
    assert done.exit_code == 2
    assert rule in done.output
    assert str(tmp_path) in done.output
    assert "Errno" not in done.output


def test_a_signal_waits_until_all_is_written():
    done = []

    def interrupted():
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGTERM)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == [True]


@pytest.mark.skipif(sys.platform == "win32", reason="no such call there")
def test_this_system_exchanges_folders_in_one_step(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    for place in (one, other):
        place.mkdir()
        (place / "name").write_text(place.name)
    assert output_folder._exchange(one, other)
    assert (one / "name").read_text() == "other"


@pytest.mark.long
@pytest.mark.parametrize("late", [True, False])
def test_a_plan_that_comes_too_late_leaves_the_one_before(handmade, tmp_path, late):
    """Whole, patterns and picture too; in time it takes its place."""
    old = RigPlan.load(handmade.save(handmade.build_plan(), tmp_path))
    new = RigPlan(old.document.changed(seed=old.document.seed + 1), old.surface)
    folder = tmp_path / "out"
    saved = SavedPlans(folder, lambda line: None, patterns=True)
    saved.keep(old)
    clock = Stopwatch(time_limit=1e-3 if late else 1e3)
    stands = saved.finish(new, clock)
    assert stands is (old if late else new)
    digest = stands.digest
    assert RigPlan.load(folder / "plan.json").digest == digest
    manifest = json.loads((folder / "patterns" / "sequence.json").read_text())
    assert manifest["plan"] == digest
    assert Image.open(folder / "rig.png").text["ringrig-plan"] == digest
    assert not list(tmp_path.glob(".out.*"))
