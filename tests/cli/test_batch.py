"""Many parts: which they are, what is kept of each, and how a batch goes on."""

import csv
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest
from click.testing import CliRunner
from support.little_work import LITTLE, found_path
from support.plain_shapes import box

from planning.cli.batch import batch_command, part_task, runners
from planning.cli.batch.index_page import write_index
from planning.cli.batch.ledger import Row, is_whole, read_rows, row_of, write_rows
from planning.cli.batch.part_task import PartEnd, PartTask, plan_part
from planning.cli.batch.parts import find_parts
from planning.cli.batch.sent_files import part_files, rig_files
from planning.cli.main import commands
from planning.model.errors import InputError
from planning.report.summary.shortfall import missing

RIG = """
base = "default"
name = "few candidates"
[placement]
n_candidate_projectors = 40
n_candidate_cameras = 40
n_reference_projectors = 600
n_reference_cameras = 400
"""
FAST = ("--max-projectors", "5", "--cameras-by", "cover", "--no-check", "--no-patterns")
FAST += ("--target", "surface", "--dominant-coverage", "0.6")


def run(*words):
    return CliRunner().invoke(commands, ["batch", *map(str, words)])


def rows(out):
    with (out / "batch.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Two parts, one of them broken, planned by the command itself."""
    place = tmp_path_factory.mktemp("batch")
    (place / "few.toml").write_text(RIG)
    parts = place / "parts"
    (parts / "sub").mkdir(parents=True)
    shape = box((100.0, 60.0, 30.0))
    lines = [f"v {x} {y} {z}" for x, y, z in shape.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in shape.faces + 1]
    (parts / "sub" / "block.obj").write_text("\n".join(lines))
    (parts / "broken.stl").write_text("no mesh at all")
    words = (parts, "-o", place / "out", "--rig", place / "few.toml", *FAST)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(part_task, "_PLAN", LITTLE + part_task._PLAN)
        patch.setenv("PYTHONPATH", found_path())
        ended = run(*words, "--no-report")
    assert ended.exit_code == 1, ended.stderr
    return place, ended


def test_every_part_is_told_and_the_others_are_planned(done):
    place, ended = done
    broken, block = rows(place / "out")
    assert (broken["part"], broken["exit"], broken["verdict"]) == (
        *("broken.stl", "3", "failed"),
    )
    assert "not a usable STL" in broken["message"]
    assert (block["part"], block["folder"]) == ("sub/block.obj", "sub/block")
    assert block["verdict"] == "met, NOT CHECKED"
    assert float(block["measured"]) >= 0.95
    assert int(block["cameras_least"]) <= int(block["cameras"])
    assert "1 of 2 parts" in ended.stdout
    assert "FAILED   broken.stl" in ended.stdout
    page = (place / "out" / "index.html").read_text()
    assert "sub/block.obj" in page
    assert "http" not in page.split("</style>")[1]


def test_a_part_is_called_by_its_place_in_the_batch(done):
    place, _ = done
    plan = (place / "out" / "sub" / "block" / "plan.json").read_text()
    assert '"path": "sub/block.obj"' in plan
    assert str(place) not in plan.replace("surface.npz", "")


def _counted(monkeypatch):
    begun = []

    def planned(task):
        begun.append(task.name)
        return PartEnd(task.name, 3, "not again", 0.0, {})

    monkeypatch.setattr(runners, "plan_part", planned)
    return begun


def test_a_later_run_leaves_what_is_finished(done, monkeypatch):
    place, _ = done
    begun = _counted(monkeypatch)
    words = (place / "parts", "-o", place / "out", "--rig", place / "few.toml", *FAST)
    ended = run(*words, "--no-report")
    assert begun == ["broken.stl"]
    assert "from an earlier run" in ended.stderr
    assert "1 of 2 parts" in ended.stdout


CHANGES = ("option", "rig", "mesh", "again", "damaged", "cut", "gone")


@pytest.mark.parametrize("how", CHANGES)
def test_what_changed_is_planned_again(done, tmp_path, monkeypatch, how):
    place, _ = done
    begun = _counted(monkeypatch)
    again = tmp_path / "copy"
    os.system(f"cp -r '{place}' '{again}'")
    words = [again / "parts", "-o", again / "out", "--rig", again / "few.toml", *FAST]
    words.append("--no-report")
    if how == "option":
        words += ["--coverage", "0.9"]
    elif how == "rig":
        (again / "few.toml").write_text(RIG + "[limits]\nmax_sigma_mm = 0.4\n")
    elif how == "mesh":
        with (again / "parts" / "sub" / "block.obj").open("a") as file:
            file.write("# another\n")
    elif how == "again":
        words.append("--again")
    elif how == "damaged":
        (again / "out" / "sub" / "block" / "surface.npz").write_bytes(b"damaged")
    elif how == "cut":
        os.truncate(again / "out" / "sub" / "block" / "rig.png", 1000)
    else:
        (again / "out" / "sub" / "block" / "rig.png").unlink()
    run(*words)
    assert sorted(begun) == ["broken.stl", "sub/block.obj"]


def test_a_part_that_fails_now_doesn_t_show_its_older_plan(done, tmp_path, monkeypatch):
    again = tmp_path / "copy"
    shutil.copytree(done[0], again)
    (again / "out" / "sub" / "block" / "report.html").write_text("of the older plan")
    shown = ('href="sub/block/report.html"', "<img")
    words = (again / "parts", "-o", again / "out", "--rig", again / "few.toml", *FAST)
    _counted(monkeypatch)
    for more, n in (("--no-report", 1), ("--again", 0)):
        run(*words, more)
        page = (again / "out" / "index.html").read_text()
        assert [page.count(word) for word in shown] == [n, n]


def test_batches_into_one_folder_keep_each_other_s_rows(done, tmp_path, monkeypatch):
    again = tmp_path / "copy"
    shutil.copytree(done[0], again)
    for name in ("c", "d"):
        (again / name).mkdir()
        (again / name / f"{name}.stl").write_text("no mesh")
    asked = ("-o", again / "out", "--rig", again / "few.toml", *FAST, "--no-report")

    def planned(task):
        if task.name == "c.stl":
            # Meanwhile another one begins and ends: of a part that this one left, too.
            run(again / "d", again / "parts", *asked, "--seed", "1")
        return PartEnd(task.name, 3, task.name, 0.0, {})

    monkeypatch.setattr(runners, "plan_part", planned)
    _, block = rows(again / "out")
    run(again / "c", again / "parts", *asked, "--jobs", 1)
    told = {row["part"]: row["message"] for row in rows(again / "out")}
    names = ("broken.stl", "c.stl", "d.stl", "sub/block.obj")
    assert told == {name: name for name in names}
    assert rows(again / "out")[-1]["digest"] == block["digest"]


@pytest.mark.parametrize("words", [["--again"], ["--coverage", "0.9"]])
def test_a_part_that_failed_since_isn_t_planned_again(
    done, tmp_path, monkeypatch, words
):
    again = tmp_path / "copy"
    shutil.copytree(done[0], again)
    asked = (again / "parts", "-o", again / "out", "--rig", again / "few.toml", *FAST)
    (_, before), begun = rows(again / "out"), _counted(monkeypatch)
    for _ in range(2):
        run(*asked, "--no-report", *words)
        _, failed = rows(again / "out")
        assert (failed["verdict"], failed["measured"]) == ("failed", "")
    begun.clear()
    run(*asked, "--no-report")
    _, block = rows(again / "out")
    assert begun == ["broken.stl"]
    assert block == before | {"seconds": ""}


@pytest.mark.parametrize("how", ["stands", "gone", "taken"])
def test_a_run_over_some_parts_keeps_the_rows_of_plans_that_stand(
    done, tmp_path, monkeypatch, how
):
    again, _ = tmp_path / "copy", _counted(monkeypatch)
    shutil.copytree(done[0], again)
    broken, block = rows(again / "out")
    # Where another part's plan goes, that of an older row doesn't stand.
    name = "sub/block.stl" if how == "taken" else "other.stl"
    (again / "one" / "sub").mkdir(parents=True)
    (again / "one" / name).write_text("no mesh")
    if how == "gone":
        shutil.rmtree(again / "out" / "sub")
    run(again / "one", "-o", again / "out", "--rig", again / "few.toml", *FAST)
    kept = [row for row in rows(again / "out") if row["part"] != name]
    assert kept == ([broken, block] if how == "stands" else [broken])
    page = (again / "out" / "index.html").read_text()
    assert f"Batch of {len(kept) + 1} parts" in page


def test_an_interrupted_batch_keeps_what_ended(done, tmp_path, monkeypatch):
    place, _ = done
    files = {
        path.name: path.read_bytes()
        for path in (place / "out" / "sub" / "block").iterdir()
        if path.is_file()
    }

    def planned(task):
        if task.name == "broken.stl":
            return PartEnd(task.name, 0, "", 1.0, files)
        raise KeyboardInterrupt

    monkeypatch.setattr(runners, "plan_part", planned)
    monkeypatch.setattr(batch_command, "stop_parts", lambda: None)
    monkeypatch.setattr(runners, "stop_parts", lambda: None)
    out = tmp_path / "out"
    ended = run(place / "parts", "-o", out, "--jobs", 1, *FAST)
    assert ended.exit_code == 130
    assert [row["part"] for row in rows(out)] == ["broken.stl"]


def test_an_interrupted_later_run_keeps_what_was_finished(done, tmp_path, monkeypatch):
    place, _ = done
    again = tmp_path / "copy"
    shutil.copytree(place, again)

    def planned(task):
        raise KeyboardInterrupt

    monkeypatch.setattr(runners, "plan_part", planned)
    monkeypatch.setattr(batch_command, "stop_parts", lambda: None)
    monkeypatch.setattr(runners, "stop_parts", lambda: None)
    words = (again / "parts", "-o", again / "out", "--rig", again / "few.toml", *FAST)
    before = rows(again / "out")
    ended = run(*words, "--no-report", "--jobs", 1)
    assert ended.exit_code == 130
    assert rows(again / "out") == before
    begun = _counted(monkeypatch)
    run(*words, "--no-report")
    assert begun == ["broken.stl"]


def test_a_folder_that_cant_be_written_is_one_parts_failure(
    done, tmp_path, monkeypatch
):
    place, _ = done
    plan = place / "out" / "sub" / "block"
    files = {path.name: path.read_bytes() for path in plan.iterdir() if path.is_file()}
    monkeypatch.setattr(
        runners, "plan_part", lambda task: PartEnd(task.name, 0, "", 1.0, files)
    )
    (tmp_path / "broken" / "patterns").mkdir(parents=True)
    (tmp_path / "broken" / "patterns" / "notes.txt").write_text("somebody's")
    ended = run(place / "parts", "-o", tmp_path, "--jobs", 1, *FAST)
    assert ended.exit_code == 1, ended.stderr
    broken, block = rows(tmp_path)
    assert (broken["verdict"], block["exit"]) == ("failed", "0")
    assert "isn't of a plan" in broken["message"]
    assert "FAILED   broken.stl" in ended.stdout
    assert "1 of 2 parts" in ended.stdout


def test_a_process_that_is_killed_is_begun_again_and_then_told(monkeypatch, tmp_path):
    count = tmp_path / "count"
    monkeypatch.setattr(
        part_task,
        "_PLAN",
        f"import os; open({str(count)!r}, 'a').write('x'); os.kill(os.getpid(), 9)",
    )
    end = plan_part(PartTask("a.stl", {"a.stl": b""}, {}, (), 1))
    assert end.code == -signal.SIGKILL
    assert "killed by signal 9, 2 times" in end.message
    assert count.read_text() == "xx"


# Two parts that begin and stay, in a batch that plans nothing.
STAYS = """
import sys
from planning.cli.batch import part_task
from planning.cli.main import main
before, _ = part_task._PLAN.split("from planning.cli.main")
part_task._PLAN = before + "open('begun', 'w'); import time; time.sleep(300)"
main()
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_batch_that_is_ended_leaves_no_part_and_no_folder_behind(tmp_path, how):
    (tmp_path / "parts").mkdir()
    (tmp_path / "now").mkdir()
    for name in ("a.stl", "b.stl"):
        (tmp_path / "parts" / name).write_bytes(b"")
    words = ["batch", "parts", "-o", "out", "--max-projectors", "3", "--jobs", "2"]
    batch = subprocess.Popen(
        [sys.executable, "-c", STAYS, *words],
        env=os.environ | {"TMPDIR": "now", "PYTHONPATH": found_path()},
        cwd=tmp_path,
        stderr=subprocess.DEVNULL,
    )
    begun = "now/ringrig-*/part/begun"
    assert soon(lambda: len(list(tmp_path.glob(begun))) == 2)
    batch.send_signal(how)
    batch.wait(timeout=60)
    assert soon(lambda: not list((tmp_path / "now").iterdir()))


def test_folders_go_where_nobody_waits_for_their_threads(monkeypatch):
    monkeypatch.setattr(part_task, "_stopped", threading.Event())
    with part_task._folder() as folder:
        part_task.stop_parts()
        assert not folder.exists()


def soon(holds):
    """Whether something holds within a minute."""
    ends = time.monotonic() + 60.0
    while not holds() and time.monotonic() < ends:
        time.sleep(0.05)
    return holds()


def test_a_table_is_read_as_it_was_written(done, tmp_path):
    place, _ = done
    before = read_rows(place / "out")
    write_rows(before.values(), tmp_path)
    assert read_rows(tmp_path) == before
    block = before["sub/block.obj"]
    assert is_whole(block, place / "out")
    assert not is_whole(replace(block, content="0"), place / "out")
    (tmp_path / "batch.csv").write_text("no table")
    assert read_rows(tmp_path) == {}


@pytest.mark.parametrize(
    ("name", "edited"),
    [("lit", "33.9%"), ("measured", "-inf"), ("measured_asked", "x"), ("exit", "one")],
)
def test_a_row_that_was_edited_is_no_row_and_the_others_are(tmp_path, name, edited):
    good = [Row(part, part, 0, "met", lit="0.9") for part in ("a", "c")]
    bad = replace(good[0], part="b", **{name: edited})
    write_rows([*good, bad], tmp_path)
    assert [*read_rows(tmp_path).values()] == good
    write_index(read_rows(tmp_path).values(), tmp_path)


def test_a_row_tells_how_many_are_needed_not_how_many_there_may_be(tmp_path, handmade):
    def short(document):
        for proof in document["certificates"].values():
            proof["needed"] = {"count": 7, "lower_bound": 6}

    plan = handmade.tampered(handmade.build_plan(), short)
    (tmp_path / "a").mkdir()
    handmade.save(plan, tmp_path / "a")
    row = row_of(PartEnd("a.stl", 1, "", 2.0, {}), "a", tmp_path, "x")
    assert (row.projectors_least, row.cameras_least) == ("6", "6")
    write_index([row], tmp_path)
    page = (tmp_path / "index.html").read_text()
    assert page.count(f"{len(plan.cameras)}, at least 6") == 2


def test_a_part_that_no_time_was_left_to_check_says_so(tmp_path, handmade):
    def unchecked(document):
        document["reconstruction"] = None

    plan = handmade.tampered(handmade.build_plan(), unchecked)
    assert tuple(missing(plan)) == ()
    (tmp_path / "a").mkdir()
    handmade.save(plan, tmp_path / "a")
    row = row_of(PartEnd("a.stl", 1, "", 2.0, {}), "a", tmp_path, "x")
    assert (row.verdict, row.message) == (
        "NOT MET",
        "the check wasn't made: the time limit came first",
    )


def test_the_index_rounds_down_what_its_why_does(tmp_path, handmade):
    """One page said "95.0 %" beside "94.9 % measured, 95 % asked"."""

    def short(document):
        document["requirements"]["coverage"] = 0.95
        areas = document["coverage"]["target"]
        areas["measured_m2"] = 0.94996 * areas["reachable_by_cameras_m2"]

    (tmp_path / "a").mkdir()
    handmade.save(handmade.tampered(handmade.build_plan(), short), tmp_path / "a")
    row = row_of(PartEnd("a.stl", 1, "", 2.0, {}), "a", tmp_path, "x")
    assert float(row.measured) < float(row.measured_asked) == 0.95
    write_index([row], tmp_path)
    page = (tmp_path / "index.html").read_text()
    assert page.count("94.9 %") == 2
    assert "95.0 %" not in page


def test_a_plan_is_whole_by_its_own_files_alone(done, tmp_path):
    plan = done[0] / "out" / "sub" / "block"
    files = {path.name: path.read_bytes() for path in plan.iterdir()}
    files |= {"patterns/sequence.json": b"{}", "patterns/P1/00.png": b"image"}
    for name, content in files.items():
        path = tmp_path / "a" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    row = row_of(PartEnd("a.stl", 0, "", 2.0, files), "a", tmp_path, "x")
    (tmp_path / "a" / "export").mkdir()
    (tmp_path / "a" / "cloud.ply").write_text("made later")
    assert is_whole(row, tmp_path)
    (tmp_path / "a" / "patterns" / "P1" / "00.png").unlink()
    assert not is_whole(row, tmp_path)


def test_a_part_that_failed_has_no_figures(tmp_path):
    row = row_of(PartEnd("a.stl", 5, "no time", 2.0, {}), "a", tmp_path, "x")
    assert (row.verdict, row.message, row.cameras) == ("failed", "no time", "")


def test_parts_of_one_stem_get_folders_of_their_own(tmp_path):
    for name in ("a.stl", "a.obj", "A.ply", "b.obj.gz", "c/a.stl", "notes.txt"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("x")
    parts = find_parts([str(tmp_path)])
    folders = {part.name: part.folder for part in parts}
    assert folders["b.obj.gz"] == "b"
    assert folders["c/a.stl"] == "c/a"
    assert len({folder.lower() for folder in folders.values()}) == 5
    assert "notes.txt" not in folders
    assert len(find_parts([str(tmp_path / "*.stl"), str(tmp_path / "a.stl")])) == 1


@pytest.mark.parametrize("given", ["nothing-*.obj", "empty"])
def test_no_part_is_one_line(tmp_path, monkeypatch, given):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no mesh there"):
        find_parts([given])


def test_what_a_mesh_and_a_rig_refer_to_goes_along(tmp_path):
    (tmp_path / "m.gltf").write_text('{"buffers": [{"uri": "m.bin"}, {"uri": "../x"}]}')
    (tmp_path / "m.bin").write_bytes(b"data")
    assert list(part_files(tmp_path / "m.gltf")) == ["m.gltf", "m.bin"]
    (tmp_path / "wall.stl").write_bytes(b"wall")
    rig = tmp_path / "r.toml"
    rig.write_text('[[obstacle]]\nname = "w"\nshape = "mesh"\nfile = "wall.stl"\n')
    assert rig_files(str(rig)) == {"r.toml": rig.read_bytes(), "wall.stl": b"wall"}
    assert rig_files("default") == {}


def test_a_scheduler_that_isnt_there_is_one_line(done, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(runners, "_ANSWERS_S", 1)
    place, _ = done
    words = (place / "parts", "-o", tmp_path, "--scheduler", "tcp://127.0.0.1:9")
    ended = run(*words, *FAST)
    assert ended.exit_code == 2
    assert "no scheduler answers there" in ended.stderr


@pytest.mark.parametrize("address", ["foo", "http://x:1", "tcp://"])
def test_of_what_is_no_address_no_client_is_made(tmp_path, monkeypatch, address):
    """Half made, one would wait 20 s for its own end and leave a traceback."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: pytest.fail("made"))
    (tmp_path / "a.stl").write_text("no mesh")
    words = (tmp_path / "a.stl", "-o", tmp_path / "out", "--scheduler", address)
    ended = run(*words, *FAST)
    assert ended.exit_code == 2
    assert f"--scheduler {address}: isn't an address (" in ended.stderr


@pytest.mark.filterwarnings("ignore")
def test_workers_of_a_cluster_plan_the_same(done, tmp_path):
    distributed = pytest.importorskip("distributed")
    place, _ = done
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        words = ("-o", tmp_path / "out", "--scheduler", address, *FAST)
        ended = run(place / "parts" / "broken.stl", *words)
    assert ended.exit_code == 1, ended.stderr
    assert "1 worker" in ended.stderr
    (there,) = rows(tmp_path / "out")
    assert there["exit"] == "3"
    assert "not a usable STL" in there["message"]
