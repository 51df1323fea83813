"""Names and folders of a batch's parts, and the files that go along with them."""

import csv
import json
import os
import re
import tempfile
from pathlib import Path, PurePosixPath

import pytest
from click.testing import CliRunner
from support.opencv_calibration import YAML

from planning.cli.batch import part_task, parts_bar, runners
from planning.cli.batch.part_task import PartEnd, PartTask, plan_part
from planning.cli.batch.parts import find_parts
from planning.cli.batch.sent_files import rig_files
from planning.cli.declared import plan_checks
from planning.cli.main import commands
from planning.model import installed
from planning.model.document import made_with

# Instead of a plan: what a rig file's text leads to from where the part is planned.
READS = """
import json, sys
from planning.rig.rig import load_rig
rig = load_rig(sys.argv[sys.argv.index("--rig") + 1], checked=False)
found = [(rig.folder / each.file).read_text() for each in rig.table.obstacle]
found += rig.table.camera.focal_px if not found else []
print(json.dumps(found), file=sys.stderr)
sys.exit(3)
"""
OBSTACLE = """
base = "default"
[[obstacle]]
name = "arm"
shape = "mesh"
file = {file}
centre_mm = [0, 0, -2500]
"""
CALIBRATED = """
base = "default"
[camera]
calibration = {file}
"""


def run(*words):
    words = (*words, "--max-projectors", 4, "--jobs", 1)
    return CliRunner().invoke(commands, ["batch", *map(str, words)])


def rows(out):
    with (out / "batch.csv").open() as file:
        return list(csv.DictReader(file))


def made(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(os.fsencode(name))
    return folder


@pytest.fixture
def begun(monkeypatch):
    """Names and mesh files of the parts that a batch would plan."""
    tasks = []

    def planned(task):
        tasks.append((task.name, os.fsdecode(next(iter(task.mesh.values())))))
        return PartEnd(task.name, 3, "not planned", 0.0, {})

    monkeypatch.setattr(runners, "plan_part", planned)
    return tasks


@pytest.fixture
def reads(monkeypatch, tmp_path):
    """Parts read their rig, in temporary folders below one of the test's own."""
    temporary = tmp_path / "some" / "where"
    temporary.mkdir(parents=True)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setattr(part_task, "_PLAN", READS)
    return temporary


AWKWARD = (
    "тест/work/x.obj",
    "деталь.obj",
    "テスト/部品.obj",
    "!!/?!.obj",
    "!!/??.obj",
    "!!.obj",
)
AWKWARD += (" -x.obj", "-y-/-.obj", "?/!/a.obj", "b/.../a.obj")
AWKWARD += (
    "batch.csv/a.obj",
    "index.html.obj",
    "हिन्दी.obj",
    "\u00e9.obj",
    "e\u0301.obj",
)


def test_folders_are_below_the_output_whatever_parts_are_called(tmp_path):
    parts = find_parts([str(made(tmp_path, *AWKWARD))])
    folders = {part.name: part.folder for part in parts}
    assert len(set(folders.values())) == len(parts) == len(AWKWARD)
    for folder in folders.values():
        words = folder.split("/")
        assert not {"", ".", ".."} & {*words}, folder
        assert words[0] not in ("batch.csv", "index.html")
        assert PurePosixPath(folder).as_posix() == folder
    assert folders["тест/work/x.obj"] == "тест/work/x"
    assert folders["テスト/部品.obj"] == "テスト/部品"
    assert folders["हिन्दी.obj"] == "हिन्दी"
    assert folders["!!/?!.obj"] == "part/part.obj"


def test_what_macos_leaves_beside_meshes_is_no_part_and_no_member(tmp_path):
    made(tmp_path, "a.obj", "._a.obj", "sub/b.stl", "sub/._b.stl.gz", ".c.zip")
    assert [one.name for one in find_parts([str(tmp_path)])] == ["a.obj", "sub/b.stl"]
    assert plan_checks._files(str(tmp_path)) == [str(tmp_path / "a.obj")]
    # Who names one means it.
    assert len(find_parts([str(tmp_path / "._a.obj")])) == 1


def test_a_long_name_leaves_room_for_the_folder_beside_it(tmp_path):
    made(tmp_path, f"{'長' * 80}.obj", f"{'長' * 79}.obj")
    one, other = (part.folder for part in find_parts([str(tmp_path)]))
    assert one != other
    assert all(len(folder.encode()) < 200 for folder in (one, other))


def test_no_plans_folder_holds_another_ones(tmp_path):
    made(tmp_path, "a.obj", "a/patterns.obj", "A/plan.stl", "c.obj/b.obj", "c.ply")
    folders = [part.folder.lower() for part in find_parts([str(tmp_path)])]
    assert len({*folders}) == 5
    above = {str(each) for folder in folders for each in PurePosixPath(folder).parents}
    assert not above & {*folders}
    assert "a/patterns" in folders


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_shows_how_many_ended_and_what_runs(
    tmp_path, monkeypatch, begun, terminal
):
    monkeypatch.setattr(parts_bar, "shows_bar", lambda *, quiet: terminal)
    for name, value in (("FORCE_COLOR", "1"), ("TERM", "xterm"), ("COLUMNS", "100")):
        monkeypatch.setenv(name, value)
    ended = run(made(tmp_path / "in", "a.obj", "b.obj"), "-o", tmp_path / "out")
    shown = re.sub(r"\x1b\[[^A-Za-z]*[A-Za-z]", "", ended.stderr)
    lines = [f"plan: {name}: failed: not planned" for name in ("a.obj", "b.obj")]
    first, second = (shown.index(line) for line in lines)
    assert (" 0/2 a.obj" in shown[:first]) == terminal
    assert (" 1/2 b.obj" in shown[first:second]) == terminal
    assert ("/2" in shown) == terminal


@pytest.mark.parametrize(
    "words",
    [
        *(("--region-coverage", "0.0"), ("--seed", "0"), ("--survive", "0")),
        *(("--coverage", "0.98"), ("--joint",), ("--target", "outside")),
    ],
)
def test_each_part_is_asked_what_the_batch_is(tmp_path, monkeypatch, words):
    asked = []

    def planned(task):
        asked.append(task.words)
        return PartEnd(task.name, 3, "not planned", 0.0, {})

    monkeypatch.setattr(runners, "plan_part", planned)
    run(made(tmp_path / "in", "a.obj"), "-o", tmp_path / "out", *words)
    ((*told,),) = asked
    assert sorted(told) == sorted(("--max-projectors", "4", *words))


@pytest.mark.parametrize(
    "words",
    [
        ("--unit", "mm", "--size-mm", "100"),
        ("--max-heads", "2"),
        ("--pattern", "dense", "--ring-axis", "free"),
        ("--pattern", "none"),
    ],
)
def test_options_that_exclude_each_other_are_refused_at_once(tmp_path, begun, words):
    made(tmp_path / "in", "a.obj", "b.obj")
    ended = run(tmp_path / "in", "-o", tmp_path / "out", *words)
    assert (ended.exit_code, begun) == (2, [])
    assert not (tmp_path / "out").exists()
    assert words[0] in ended.stderr


@pytest.mark.parametrize("room", ["verify", "handover", "experiments", "cli", "steps"])
def test_rows_and_workers_are_of_the_same_code_in_all_rooms(
    tmp_path, monkeypatch, begun, room
):
    made(tmp_path, "in/a.obj", f"planning/{room}/a.py")
    home = tmp_path / "planning" / "model" / "installed.py"
    monkeypatch.setattr(installed, "__file__", str(home))
    monkeypatch.setattr(made_with, "_here", made_with._here.__wrapped__)
    told = []
    for _ in range(2):
        run(tmp_path / "in", "-o", tmp_path / "out")
        told += [runners._version(), rows(tmp_path / "out")[0]["asked"]]
        (tmp_path / "planning" / room / "a.py").write_text("another")
    assert len({*told}) == 4


@pytest.mark.parametrize("given", [".", "..", "link"])
def test_what_plans_hold_is_no_part(tmp_path, monkeypatch, begun, given):
    monkeypatch.chdir(made(tmp_path, "in/a.obj", "in/out/a/cloud.ply") / "in")
    (tmp_path / "in" / "link").symlink_to(tmp_path)
    run(given, "-o", "../in/out")
    assert [Path(name).name for name, _ in begun] == ["a.obj"]


def test_two_files_of_one_name_are_two_parts(tmp_path, monkeypatch, begun):
    monkeypatch.chdir(
        made(tmp_path, "a/x.obj", "b/x.obj", "c/sub/y.obj", "d/sub/y.obj")
    )
    given = ["b/x.obj", "a/x.obj", "c", "d"]
    ended = run(*given, "-o", "out")
    names = ["a/x.obj", "b/x.obj", "c/sub/y.obj", "d/sub/y.obj"]
    assert begun == [(name, name) for name in names]
    assert "0 of 4 parts" in ended.stdout
    assert [row["folder"] for row in rows(Path("out"))] == [n[:-4] for n in names]
    assert find_parts(given[::-1]) == find_parts(given)


def test_a_part_that_is_named_by_itself_is_the_one_of_its_folder(tmp_path):
    files = ("left/lid.obj", "right/lid.obj", "bracket.obj", "bracket.stl")
    place = str(made(tmp_path, *(f"parts/{name}" for name in files)) / "parts")
    whole = find_parts([place])
    known = {part.name: part.folder for part in whole}
    for part in whole:
        (alone,) = find_parts([f"{place}/{part.name}"], known=known)
        assert (alone.name, alone.folder) == (part.name, part.folder)
    # Another folder's is another part, and a later file takes nobody's folder.
    made(tmp_path, "else/lid.obj", "parts/left/lid.stl")
    (other,) = find_parts([str(tmp_path / "else" / "lid.obj")], known=known)
    assert (other.name, other.folder) == ("lid.obj", "lid")
    folders = {part.name: part.folder for part in find_parts([place], known=known)}
    assert folders == {**known, "left/lid.stl": "left/lid.stl"}


def test_files_that_no_folder_tells_apart_are_numbered(tmp_path):
    # The same path in words, another one by a link.
    made(tmp_path, "x.obj", "far/x.obj", "far/in/y.obj")
    (tmp_path / "link").symlink_to(tmp_path / "far" / "in")
    given = [str(tmp_path / "x.obj"), f"{tmp_path}/link/../x.obj"]
    parts = find_parts(given)
    assert len(parts) == len({part.name for part in parts}) == 2
    assert all(part.name.endswith("x.obj") for part in parts)


def test_a_name_is_told_in_one_line(tmp_path, begun):
    made(tmp_path / "in", "new\nline.obj", "a\rb.obj", "c\u2028d.obj")
    made(tmp_path / "in", os.fsdecode(b"caf\xe9.obj"))
    (tmp_path / "in" / "gone\nfor ever.obj").symlink_to(tmp_path / "nothing")
    ended = run(tmp_path / "in", "-o", tmp_path / "out")
    assert [name for name, _ in begun] == [
        *("a\\rb.obj", "c\\u2028d.obj", "caf\\udce9.obj", "new\\nline.obj"),
    ]
    told = [line for line in ended.stdout.splitlines() if line.startswith("FAILED")]
    assert len(told) == 5
    assert "FAILED   new\\nline.obj: not planned" in told
    assert len(ended.stdout.splitlines()) == 7
    assert len([x for x in ended.stderr.splitlines() if "of 5)" in x]) == 5
    assert len(rows(tmp_path / "out")) == 5


@pytest.mark.parametrize(
    "file",
    [
        *('"../../arm.obj"', '"x/../../../arm.obj"', '"HERE/arm.obj"'),
        *("'HERE/arm.obj'", '"""HERE/\\u0061rm.obj"""'),
    ],
)
def test_what_a_rig_names_stays_in_the_temporary_folder(tmp_path, reads, file):
    made(tmp_path, "deep/er/x/rig", "part.obj", "arm.obj")
    os.utime(tmp_path / "arm.obj", (0, 0))
    rig = tmp_path / "deep" / "er" / "cell.toml"
    written = file.replace("HERE", str(tmp_path))
    rig.write_text(f"# it's {written}" + OBSTACLE.format(file=written))
    before = {*tmp_path.rglob("*")}
    run(tmp_path / "part.obj", "-o", tmp_path / "out", "--rig", rig)
    (row,) = rows(tmp_path / "out")
    assert row["message"] == '["arm.obj"]'
    assert (tmp_path / "arm.obj").stat().st_mtime == 0
    after = {each for each in tmp_path.rglob("*") if "out" not in each.parts}
    assert after == before


def test_a_worker_writes_nowhere_else(tmp_path, reads):
    end = plan_part(PartTask("a", {"a": b"", str(tmp_path / "b"): b""}, {}, (), 1))
    assert end.code == 2
    assert "give no whole path" in end.message
    assert not (tmp_path / "b").exists()
    end = plan_part(PartTask("a", {"a": b"1", "b/../a": b"2"}, {}, (), 1))
    assert "two files of one place" in end.message


def test_a_calibration_goes_along_and_counts(tmp_path, reads):
    made(tmp_path, "part.obj", "cell/none")
    rig, out = tmp_path / "cell" / "cell.toml", tmp_path / "out"
    rig.write_text(CALIBRATED.format(file='"../cam.yml"'))
    asked = set()
    for focal in (2500.0, 2600.0):
        lens = YAML.replace("3.5124e+03", f"{focal}").replace("3511.9", f"{focal}")
        (tmp_path / "cam.yml").write_text(lens)
        run(tmp_path / "part.obj", "-o", out, "--rig", rig)
        (row,) = rows(out)
        assert row["message"] == f"[{focal}, {focal}]"
        asked.add(row["asked"])
    assert len(asked) == 2


def test_a_list_of_cameras_brings_all_calibrations(tmp_path):
    made(tmp_path, "one.yml", "other.yml")
    rig = tmp_path / "cell.toml"
    rig.write_text(
        'camera = [{calibration = "one.yml"}, {calibration = "other.yml"}, "a camera"]'
        '\nprojector = {calibration = "one.yml"}'
    )
    assert [*rig_files(str(rig))] == ["cell.toml", "one.yml", "other.yml"]


def test_a_file_that_a_rig_names_in_vain_is_one_line(tmp_path, begun):
    made(tmp_path, "part.obj")
    rig = tmp_path / "cell.toml"
    rig.write_text(OBSTACLE.format(file='"gone.obj"'))
    ended = run(tmp_path / "part.obj", "-o", tmp_path / "out", "--rig", rig)
    assert (ended.exit_code, begun) == (3, [])
    (line,) = ended.stderr.splitlines()
    assert "gone.obj: can't be read (No such file or directory)" in line
    assert "is looked for beside it" in line


def test_what_is_wrong_with_the_rig_is_told_before_any_part(tmp_path, begun):
    made(tmp_path, "part.obj")
    rig = tmp_path / "cell.toml"
    for text, told in (("nonsense = 3", "`nonsense` is not a known key"), ("= 3", "")):
        rig.write_text(text)
        ended = run(tmp_path / "part.obj", "-o", tmp_path / "out", "--rig", rig)
        assert (ended.exit_code, begun) == (3, [])
        assert told in ended.stderr
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("uri", ["../m%20x.bin", "{}/m x.bin"])
def test_buffers_stay_in_the_temporary_folder(tmp_path, monkeypatch, reads, uri):
    made(tmp_path, "in/other.obj", "m x.bin")
    os.utime(tmp_path / "m x.bin", (0, 0))
    gltf = {"buffers": [{"uri": uri.format(tmp_path)}]}
    (tmp_path / "in" / "m.gltf").write_text(json.dumps(gltf))
    tells = "import sys; print(open('../m x.bin').read(), file=sys.stderr); sys.exit(3)"
    monkeypatch.setattr(part_task, "_PLAN", tells)
    run(tmp_path / "in" / "m.gltf", "-o", tmp_path / "out")
    (row,) = rows(tmp_path / "out")
    expected = "m x.bin" if uri[0] == "." else "must be named from the mesh's folder"
    assert expected in row["message"]
    assert (tmp_path / "m x.bin").stat().st_mtime == 0
    assert not any(reads.rglob("*.bin"))


def test_a_part_without_room_is_that_parts_failure(tmp_path, reads):
    # Told in one line, it is longer than a file's name may be.
    made(tmp_path / "in", "\u2028" * 60 + ".obj", "a.obj")
    ended = run(tmp_path / "in", "-o", tmp_path / "out", "--rig", "default")
    assert ended.exit_code == 1
    verdicts = [row["verdict"] for row in rows(tmp_path / "out")]
    assert verdicts == ["failed", "failed"]
    assert "File name too long" in rows(tmp_path / "out")[0]["message"]
