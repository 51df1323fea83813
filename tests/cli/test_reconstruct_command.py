"""`plan reconstruct` from files to files: exit codes, streams, the cloud."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import planning
from geometry.rays.proximity import closest_points
from planning.cli.main import commands
from planning.model.plan import RigPlan


@pytest.fixture(scope="module")
def folder(rigs, tmp_path_factory) -> Path:
    """A plan of one projector and two cameras in files; its mesh is in inches."""
    body = rigs.bumpy_sphere(0.05, subdivisions=4)
    cameras = rigs.two_small_cameras()
    lamp = rigs.diverging("P1", rigs.direction(-30.0, 5.0), 0.055, 6.2e-3)
    plan = rigs.plan_of(
        body,
        [lamp],
        cameras,
        check=rigs.CHECK | {"tau_m": 6.2e-3},
        seed=3,
        meshes=[rigs.MESH_TABLE | {"unit": "in", "scale_to_m": 0.0254}],
    )
    place = tmp_path_factory.mktemp("reconstruct")
    plan.save(place / "plan.json")
    return place


def run(*words):
    """Run `plan reconstruct` in this process; return exit code, stdout, stderr."""
    result = CliRunner().invoke(commands, ["reconstruct", *map(str, words)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture(scope="module")
def simulated(folder):
    words = ["-o", folder / "one", "--save-captures", folder / "captures"]
    return run(folder / "plan.json", *words, "--quiet")


def test_a_second_sequence_in_other_room_light(folder, simulated):
    words = ["--second-sequence", "--ambient", "0.3", "-o", folder / "two", "--json"]
    code, out, _ = run(folder / "plan.json", *words, "--quiet")
    both = json.loads(out)
    first, radii = both["first_sequence"], both["second_ring_radii"]["P1"]
    assert (both["ambient"], first["ambient"], code) == (0.3, 0.3, 0)
    for count in ("n_points", "n_merged"):
        assert 1.7 * first[count] < both[count] < 2.3 * first[count]
    own = RigPlan.load(folder / "plan.json").projectors[0].ring_radii
    assert len(own) - 3 <= len(radii) <= len(own)
    assert not np.intersect1d(np.round(own, 9), np.round(radii, 9)).size
    shares = [next(c["fraction"] for c in one["completeness"]) for one in (first, both)]
    assert shares[1] >= shares[0]


def header_of(path: Path) -> list[str]:
    return path.read_bytes().split(b"end_header\n")[0].decode().splitlines()


def test_simulation_writes_a_cloud_and_says_what_it_found(folder, simulated):
    code, out, err = simulated
    assert (code, err) == (0, "")
    for words in (
        "P1 with C2: ",
        "accuracy against the mesh: rms 0.0",
        "completeness of the target predicted measured: ",
        "cloud.ply",
        "sigma along the normal: violet 0.000",
        "every limit of the check is kept",
    ):
        assert words in out
    assert [path.name for path in (folder / "one").iterdir()] == ["cloud.ply"]


def test_saved_images_give_the_same_file_in_a_process_of_its_own(folder, simulated):
    home = str(Path(planning.__file__).resolve().parents[1])
    words = ["reconstruct", "plan.json", "--captures", "captures", "-o", "two"]
    done = subprocess.run(
        [sys.executable, "-c", "from planning.cli.main import main; main()", *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": home, "PYTHONWARNINGS": "ignore"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert "plan: pair 2 of 2" in done.stderr
    assert "plan: " not in done.stdout
    one, two = ((folder / name / "cloud.ply").read_bytes() for name in ("one", "two"))
    assert one == two


def test_another_reader_finds_the_cloud_on_the_mesh_with_its_colours(folder, simulated):
    """In inches, as the mesh file: 5 cm are 1.97."""
    path = folder / "one" / "cloud.ply"
    cloud = trimesh.load(path)
    assert isinstance(cloud, trimesh.PointCloud)
    surface = RigPlan.load(folder / "plan.json").surface.mesh
    distance = closest_points(surface, 0.0254 * np.asarray(cloud.vertices)).distances
    assert np.abs(distance).max() < 0.5e-3
    assert len(np.unique(cloud.colors, axis=0)) > 100
    rows = rows_of(path)
    assert len(rows) == len(cloud.vertices) > 1000
    lightness = cloud.colors[:, :3] @ np.array([0.2126, 0.7152, 0.0722])
    order = np.argsort(rows["sigma"])
    assert np.all(np.diff(lightness[order]) > -2.0)
    ratio = np.median(np.abs(distance)) / (0.0254 * np.median(rows["sigma"]))
    assert 0.5 < ratio / 0.6745 < 1.6


def rows_of(path: Path) -> np.ndarray:
    """Read the rows by what the header says, with code of this test's own."""
    kinds = {"double": "<f8", "float": "<f4", "uchar": "u1"}
    words = [line.split() for line in header_of(path)]
    fields = [(word[2], kinds[word[1]]) for word in words if word[0] == "property"]
    content = path.read_bytes().split(b"end_header\n", 1)[1]
    return np.frombuffer(content, dtype=fields)


def test_captures_are_held_against_the_mesh(folder, simulated, tmp_path):
    """As they were measured, and moved onto it; in the mesh's unit, inches."""
    images = ["--captures", folder / "captures", "--quiet", "--json"]
    limits = ["--deviation-limits", "-0.05,0.1"]
    code, out, _ = run(folder / "plan.json", *images, "-o", tmp_path / "fit")
    assert code == 0
    fit = json.loads(out)["deviation"]
    assert np.allclose(fit["mesh_from_measured"], np.eye(4), atol=2e-4)
    assert fit["limits_m"] is None
    words = ["--align", "none", *limits, "-o", tmp_path / "none"]
    code, out, _ = run(folder / "plan.json", *images, *words)
    plain = json.loads(out)["deviation"]
    assert plain["mesh_from_measured"] == np.eye(4).tolist()
    assert plain["limits_m"] == pytest.approx([-5e-5, 1e-4])
    assert sum(row["n_points"] for row in plain["regions"]) == plain["n_points"]
    rows = rows_of(tmp_path / "none" / "deviation.ply")
    away_m = 0.0254 * rows["deviation"]
    places = 0.0254 * np.stack([rows[a] for a in "xyz"], axis=1)
    surface = RigPlan.load(folder / "plan.json").surface.mesh
    assert np.allclose(closest_points(surface, places).distances, away_m, atol=1e-8)
    assert plain["rms_m"] == pytest.approx(np.sqrt(np.mean(away_m**2)), rel=1e-4)
    outside = np.mean((away_m < -5e-5) | (away_m > 1e-4))
    assert plain["outside"] == pytest.approx(outside, abs=2 / len(rows))
    # Blue is inside, red outside, white on the mesh.
    assert np.all(rows["blue"][away_m < -5e-5] > rows["red"][away_m < -5e-5])
    assert np.all(rows["red"][away_m > 5e-5] > rows["blue"][away_m > 5e-5])
    header = header_of(tmp_path / "none" / "deviation.ply")
    assert header[2] == "comment ringrig cloud"
    assert any("colour RdBu by deviation, -0.0019685 to 0.003937" in h for h in header)


def test_an_older_map_does_not_stay(folder, simulated, tmp_path):
    images = ["--captures", folder / "captures", "--quiet", "-o", tmp_path]
    run(folder / "plan.json", *images)
    assert {path.name for path in tmp_path.iterdir()} == {"cloud.ply", "deviation.ply"}
    run(folder / "plan.json", "--quiet", "-o", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"cloud.ply"}


@pytest.mark.parametrize("limits", ["0", "0.1,0.2", "a", "1,2,3", "nan", "-1,inf", ""])
def test_limits_are_about_zero(folder, limits):
    code, _, err = run(folder / "plan.json", "--deviation-limits", limits)
    assert code == 2
    assert "about zero" in err


def test_the_header_tells_unit_and_colours(folder, simulated):
    path = folder / "one" / "cloud.ply"
    header = header_of(path)
    assert header[:3] == [
        "ply",
        "format binary_little_endian 1.0",
        "comment ringrig cloud",
    ]
    assert "comment unit in, 0.0254 m; axes of the mesh" in header
    rows = rows_of(path)
    low, high = np.quantile(rows["sigma"], [0.02, 0.98])
    colours = next(line for line in header if "viridis" in line)
    said = colours.split("by sigma, ")[1].split(":")[0].split(" to ")
    assert [float(word) for word in said] == pytest.approx([low, high], rel=1e-4)
    length = np.linalg.norm(np.stack([rows[f"n{a}"] for a in "xyz"]), axis=0)
    known = length > 0.5
    assert np.allclose(length[known], 1.0, atol=1e-6)
    assert np.all(length[~known] == 0.0)
    assert known.mean() > 0.9
    # Outward, as the ball is seen from outside.
    outward = sum(rows[a] * rows[f"n{a}"] for a in "xyz")
    assert np.all(outward[known] > 0.0)
    assert np.all(np.isfinite(rows["sigma"]))
    assert np.all(rows["sigma"] > 0.0)


def test_a_missing_pair_exits_1_with_a_smaller_cloud(folder, simulated, tmp_path):
    shutil.copytree(folder / "captures" / "C1", tmp_path / "captures" / "C1")
    words = ["--captures", tmp_path / "captures", "-o", tmp_path / "out", "--quiet"]
    code, out, err = run(folder / "plan.json", *words)
    assert (code, err) == (1, "")
    assert "not met: P1 with C2: left out: " in out
    assert "NOT reconstructed as planned: " in out
    rows = rows_of(tmp_path / "out" / "cloud.ply")
    assert 500 < len(rows) < len(rows_of(folder / "one" / "cloud.ply"))
    code, out, err = run(folder / "plan.json", *words, "--json")
    document = json.loads(out)
    assert (code, document["passed"]) == (1, False)
    assert "P1 with C2: left out" in document["failures"][0]
    assert document["unit"] == "in"
    assert document["n_merged"] == len(rows)
    assert [pair["n_points"] > 0 for pair in document["pairs"]] == [True, False]


def test_no_cloud_stays_where_none_is_confirmed(folder, simulated, tmp_path):
    """Each camera's images stand under the name of the other."""
    for name, other in (("C1", "C2"), ("C2", "C1")):
        place = tmp_path / "captures" / name / "P1"
        shutil.copytree(folder / "captures" / other / "P1", place)
        for path in sorted(place.glob("*-root-*")):
            number, rest = path.name.split("-", 1)
            shift = 2 if name == "C2" else -2
            path.rename(
                place / f"{int(number) + shift:02d}-{rest.replace(other, name)}"
            )
    out_folder = tmp_path / "out"
    shutil.copytree(folder / "one", out_folder)
    mine = out_folder / "mine.ply"
    mine.write_text("ply\n")
    words = ["--captures", tmp_path / "captures", "-o", out_folder, "--quiet"]
    code, out, _ = run(folder / "plan.json", *words)
    assert code == 1
    assert "no other pair confirms them" in out
    assert "none was written" in out
    assert [path.name for path in out_folder.iterdir()] == ["mine.ply"]


def test_no_cloud_stays_where_no_image_can_be_used(folder, simulated, tmp_path):
    """But a folder that was mistyped costs nothing."""
    out_folder, captures = tmp_path / "out", tmp_path / "captures"
    shutil.copytree(folder / "one", out_folder)
    shutil.copy(out_folder / "cloud.ply", out_folder / "deviation.ply")
    words = ["-o", out_folder, "--quiet", "--captures"]
    assert run(folder / "plan.json", *words, captures)[0] == 3
    assert (out_folder / "cloud.ply").exists()
    shutil.copytree(folder / "captures", captures)
    for path in captures.glob("*/*/00-white.png"):
        path.unlink()
    code, _, err = run(folder / "plan.json", *words, captures)
    assert code == 3
    assert "can't be used either" in err
    assert list(out_folder.iterdir()) == []


@pytest.mark.long
def test_a_calibration_moves_devices_in_simulation_and_captures(
    folder, simulated, tmp_path
):
    document = json.loads((folder / "plan.json").read_text())
    pose = np.array(document["cameras"][0]["world_from_device"])
    pose[:3, 3] += 4e-3 * pose[:3, 0]
    device = {"id": "C1", "world_from_device": pose.tolist()}
    calibration = {"format": "ringrig-calibration", "version": 1, "devices": [device]}
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(calibration))
    images = ["--save-captures", tmp_path / "captures"]
    words = ["--calibration", path, "-o", tmp_path / "one", "--quiet"]
    code, out, _ = run(folder / "plan.json", *words, *images)
    assert code == 0, out
    images = ["--captures", tmp_path / "captures"]
    words = ["--calibration", path, "-o", tmp_path / "two", "--quiet"]
    assert run(folder / "plan.json", *words, *images)[0] == 0
    one, two = (tmp_path / name / "cloud.ply" for name in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()
    words = ["-o", tmp_path / "three", "--quiet"]
    code, out, _ = run(folder / "plan.json", *words, *images)
    assert code == 1
    assert "P1 with C1: doubtful: where P1 with C2 measured the same spots, " in out


def test_a_cloud_of_someone_else_is_not_removed(folder, simulated, tmp_path):
    from planning.verify.reconstruction.check.cloud_file import remove_cloud

    other = tmp_path / "cloud.ply"
    other.write_text("ply\nformat ascii 1.0\ncomment mine\n")
    assert not remove_cloud(other)
    assert other.exists()
    assert not remove_cloud(tmp_path / "nothing.ply")


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--captures", "no"], 3, "no: no such folder"),
        (["--captures", "one"], 3, "must be called C1, C2, it holds cloud.ply"),
        (["--calibration", "no.json"], 3, "no.json: no such file"),
        (["--captures", "a", "--save-captures", "b"], 2, "not both"),
        (["-o", "plan.json/x"], 2, "can't write to plan.json/x"),
        (["--save-captures", "plan.json/x"], 2, "can't write to plan.json/x"),
        (["--threads", "0"], 2, "not in the range"),
    ],
)
def test_errors_are_one_line_with_the_documented_code(
    folder, simulated, words, code, message, monkeypatch
):
    monkeypatch.chdir(folder)
    found, out, err = run("plan.json", "--quiet", *words)
    assert (found, out) == (code, "")
    assert message in " ".join(err.split())


def test_an_interrupted_run_says_that_images_are_left(folder, tmp_path, monkeypatch):
    def rendered(*_, save, **__):
        (save.path / "00-white.png").write_bytes(b"")
        raise KeyboardInterrupt

    command = "planning.cli.checks.reconstruct_command"
    monkeypatch.setattr(f"{command}.reconstruct_rendered", rendered)
    monkeypatch.setattr("planning.cli.console.leave", sys.exit)
    code, _, err = run(folder, "-o", tmp_path / "x", "--save-captures", tmp_path / "y")
    assert code == 130
    assert f"{tmp_path / 'y'} has the images" in " ".join(err.split())


@pytest.mark.long
def test_a_rig_is_refined_said_and_written_as_a_calibration(rigs, folder, simulated):
    """C2 stands 0.6 mm beside its place; one projector lights all."""
    plan = RigPlan.load(folder / "plan.json")

    def beside(document):
        document["cameras"][1]["world_from_device"][0][3] += 6e-4

    (folder / "off").mkdir()
    rigs.changed(plan, beside).save(folder / "off" / "plan.json")
    truth = ["--truth", folder / "off" / "plan.json", "--quiet", "--json"]
    found = {}
    for name, words in (
        ("blind", []),
        ("refined", ["--refine"]),
        ("again", ["--calibration", folder / "refined" / "refined.json"]),
    ):
        place = ["-o", folder / name]
        _, out, _ = run(folder / "plan.json", *truth, *words, *place)
        found[name] = json.loads(out)
    refined = found["refined"]["refined"]
    assert refined["moved"][0]["id"] == "C2"
    assert refined["named"][0].startswith("C2 looks as if")
    assert refined["after_px"] < 0.5 * refined["before_px"]
    rms = {name: each["accuracy_rms_m"] for name, each in found.items()}
    assert rms["refined"] < 0.5 * rms["blind"]
    assert rms["again"] == pytest.approx(rms["refined"], rel=0.05)
