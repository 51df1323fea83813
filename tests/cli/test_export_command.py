"""`plan export`: several formats at once, what it prints, and how it ends."""

import json
import sys

import pytest
from click.testing import CliRunner
from support.exported_plans import exported_plan

from planning.cli import console
from planning.cli.declared.export_declared import FORMATS, MITSUBA
from planning.cli.main import commands
from planning.handover.export import export_formats


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    exported_plan().save(folder / "plan.json")
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A plan that every camera format holds but for lens shift."""
    folder = tmp_path_factory.mktemp("plain")
    exported_plan(parallel=False, distorted=False).save(folder / "plan.json")
    return folder


def export(*words):
    return CliRunner().invoke(commands, ["export", *map(str, words), "--quiet"])


def test_the_command_line_names_the_formats_that_there_are():
    assert FORMATS == (*(form.name for form in export_formats.FORMATS), MITSUBA)


def test_each_format_gets_a_folder_beside_the_plan(plain):
    done = export(plain, "--to", "csv,opencv", "--to", "usd", "--to", "csv")
    assert done.exit_code == 0, done.output
    names = sorted(path.name for path in (plain / "export").iterdir())
    assert names == ["csv", "opencv", "usd"]
    assert "rig.yaml, README.txt" in done.output
    assert "frame: axes and origin of the mesh file" in done.output
    readme = (plain / "export" / "csv" / "README.txt").read_text()
    assert "  nothing of this plan" in readme
    assert not list(plain.glob("export/*/.*"))


def test_what_a_format_lacks_ends_with_1_and_costs_no_other(folder, tmp_path):
    done = export(folder, "--to", "step,colmap,gltf", "-o", tmp_path, "--json")
    assert done.exit_code == 1
    step, colmap, gltf = json.loads(done.stdout)["exports"]
    assert step["left_out"] == []
    assert colmap["left_out"] == ["P2: left out, COLMAP has no parallel light"]
    assert [line.split(":")[0] for line in gltf["left_out"]] == ["P1, C2", "C1"]
    for entry in (step, colmap, gltf):
        for name in entry["files"]:
            assert (tmp_path / entry["format"] / name).is_file()
    readme = (tmp_path / "colmap" / "README.txt").read_text()
    assert "P2: left out, COLMAP has no parallel light" in readme
    lines = export(folder, "--to", "step,colmap", "-o", tmp_path).output
    assert "  P2: left out, COLMAP has no parallel light\n" in lines


def _stopped(*_, **__):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("stops", "left"),
    [(0, "nothing was written"), (2, "OUT has csv, opencv, complete")],
)
def test_an_interrupted_export_names_what_is_complete(
    plain, tmp_path, monkeypatch, stops, left
):
    names = ["csv", "opencv", "usd", "ros"]
    (form,) = [each for each in export_formats.FORMATS if each.name == names[stops]]
    monkeypatch.setattr(type(form), "files", _stopped)
    monkeypatch.setattr(console, "leave", sys.exit)
    done = export(plain, "--to", ",".join(names), "-o", tmp_path)
    assert done.exit_code == 130
    assert left.replace("OUT", str(tmp_path)) in " ".join(done.output.split())


def test_an_interrupted_family_says_how_many_heads_there_are(tmp_path, monkeypatch):
    def written(path, **_):
        if path.name == "head-03.obj":
            raise KeyboardInterrupt
        path.write_text("")

    monkeypatch.setattr("planning.cli.other_commands.write_sample", written)
    monkeypatch.setattr(console, "leave", sys.exit)
    words = ["sample", "--family", "5", "-o", str(tmp_path / "heads")]
    done = CliRunner().invoke(commands, words)
    assert done.exit_code == 130
    assert "heads has 2 of 5 heads" in " ".join(done.output.split())
    assert len(list((tmp_path / "heads").iterdir())) == 2


def test_a_family_beside_other_meshes_says_that_they_are_planned_with_it(tmp_path):
    words = ["sample", "--faces", "500", "-o", str(tmp_path / "heads"), "--family"]
    first = CliRunner().invoke(commands, [*words, "3"])
    assert first.output.endswith("plans one rig for all\n")
    again = CliRunner().invoke(commands, [*words, "2"])
    assert again.output.endswith("plans one rig for all and 1 other there\n")


def test_files_of_an_older_export_go_and_a_users_stay(folder, plain, tmp_path):
    export(folder, "--to", "aim,ros", "-o", tmp_path)
    (tmp_path / "ros" / "mine.txt").write_text("notes")
    assert (tmp_path / "aim" / "P2.png").exists()
    export(plain, "--to", "aim,ros", "-o", tmp_path)
    assert not (tmp_path / "aim" / "P2.png").exists()
    assert (tmp_path / "ros" / "mine.txt").read_text() == "notes"


def test_another_frame_is_named_in_every_format(plain, tmp_path):
    words = ["--to", "csv,drawing,step", "--frame", "-100,20,0,90,0,0"]
    done = export(plain, *words, "-o", tmp_path)
    assert done.exit_code == 0, done.output
    told = "origin at the mesh's -100, 20, 0 mm, axes turned by azimuth 90"
    for name in ("csv", "drawing", "step"):
        assert told in (tmp_path / name / "README.txt").read_text()
    assert told in (tmp_path / "csv" / "mounts.csv").read_text()
    again = export(plain, *words[:2], "--frame", "floor", "-o", tmp_path)
    assert "on the floor under the object's centre" in again.output


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--to", "obj"], 2, "'obj' is none of opencv, colmap"),
        (["--to", "csv,"], 2, "'' is none of"),
        (["--to", "csv", "--frame", "1,2"], 2, "must be X,Y,Z in mm"),
        (["--to", "csv", "--albedo", "0.4"], 2, "--albedo goes with --to mitsuba"),
        (["--to", "csv", "-o", "plan.json/x"], 2, "can't write"),
    ],
)
def test_wrong_words_end_with_2(words, code, message, plain, monkeypatch):
    monkeypatch.chdir(plain)
    done = export(plain, *words)
    # As the program itself turns a usage error into its exit code.
    assert (done.exit_code or getattr(done.exception, "exit_code", 0)) == code
    assert message in done.output + str(done.exception)


def test_a_broken_plan_ends_with_3(plain, tmp_path):
    text = (plain / "plan.json").read_text().replace('"diverging"', '"bent"')
    (tmp_path / "plan.json").write_text(text)
    done = export(tmp_path, "--to", "csv")
    assert done.exit_code == 3
    assert not (tmp_path / "export").exists()


def test_mitsuba_alone_goes_where_it_went_and_says_what_it_lacks(
    folder, tmp_path, monkeypatch
):
    asked = []

    def write_scenes(scanner, place, surface, *, ambient):
        asked.append((scanner, surface, ambient))
        (place / "README.txt").write_text("scenes\n")
        return [place / "P1.xml"]

    name = "planning.handover.export.mitsuba_export.write_scenes"
    monkeypatch.setattr(name, write_scenes)
    words = ["--to", "mitsuba", "--albedo", "0.3", "--frame", "0,0,1000"]
    done = export(folder, *words, "-o", tmp_path / "scenes")
    assert done.exit_code == 1
    assert f"{tmp_path / 'scenes'}: P1.xml with 3 cameras each" in done.output
    assert "C1: without distortion" in done.output
    [(scanner, surface, _)] = asked
    assert surface.albedo == 0.3
    assert not any(any(camera.distortion) for camera in scanner.cameras)
    # The frame's origin is a metre above the mesh's.
    assert scanner.mesh.centre[2] < -0.9
    heights = [device.centre[2] for device in (*scanner.projectors, *scanner.cameras)]
    assert max(heights) < 0.1
    assert scanner.projectors[0].world_from_ring[2, 3] == pytest.approx(heights[0])


def test_mitsuba_s_scenes_tell_one_frame(plain, tmp_path):
    done = export(plain, "--to", "mitsuba", "--frame", "0,0,1000", "-o", tmp_path)
    assert done.exit_code == 0, done.output
    readme = (tmp_path / "README.txt").read_text()
    assert "Lengths are metres, in the frame named below." in readme
    assert readme.endswith("Frame: axes of the mesh, origin at its 0, 0, 1000 mm\n")
