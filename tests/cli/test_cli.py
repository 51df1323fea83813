"""The command line as scripts see it: files, streams, exit codes, one-line errors."""

import json
import os
import re
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from support.little_work import LITTLE

import planning
from planning.cli.console import reporter
from planning.cli.main import main
from planning.cli.other_commands import write_sample
from planning.model.plan import InterruptedPlanError, RigPlan
from planning.report.drawing.rig_picture import draw_rig
from planning.report.summary.brief import COLUMNS, MOST_LINES
from planning.rig.rig import load_rig
from planning.verify.verification import verify_plan

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data"
VOLATILE = ("created", "command", "timings_s", "cost")


def run(*words, cwd, threads=None, before=""):
    """Run `plan` as a process of its own, on the package under test."""
    home = str(Path(planning.__file__).resolve().parents[1])
    tests = str(Path(__file__).resolve().parents[1])
    path = os.pathsep.join((home, tests))
    environment = os.environ | {"PYTHONPATH": path, "PYTHONWARNINGS": "ignore"}
    if threads is not None:
        environment["OMP_NUM_THREADS"] = str(threads)
        environment["OPENBLAS_NUM_THREADS"] = str(threads)
    code = before + "from planning.cli.main import main; main()"
    command = [sys.executable, "-c", code, *words]
    return subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300
    )


def in_process(monkeypatch, capsys, *words):
    """Run `plan` in this process; return exit code, stdout, stderr."""
    monkeypatch.setattr(sys, "argv", ["plan", *map(str, words)])
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    with pytest.raises(SystemExit) as caught:
        main()
    return caught.value.code or 0, *capsys.readouterr()


@pytest.fixture(scope="module")
def face(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "face.obj"
    write_sample(path, n_faces=8000)
    return path


# A head is seen from the front alone: two or so of each device do, where a calibration
# costs nothing.
RIG = """
base = "default"
name = "front"
[workspace]
shape = "cone"
axis = [0.0, -1.0, 0.0]
half_angle_deg = 40.0
[calibration]
angle_deg = 0.0
position_mm = 0.0
[requirements]
dominant_coverage = 0.85
coverage = 0.9
min_reachable = 0.5
"""


@pytest.fixture(scope="module")
def runs(face):
    """One job with 1 and with 2 threads, the second with --json.

    The check's own determinism over threads is tested with the check, that of the
    paper's route with it.
    """
    folder = face.parent
    (folder / "front.toml").write_text(RIG)
    found = []
    for threads in (1, 2):
        words = ["--mesh", "face.obj", "--max-projectors", "3", "-o", f"plan{threads}"]
        words += ["--rig", "front.toml", "--cameras-by", "cover"]
        words += ["--threads", str(threads)]
        words += ["--json", "--no-check"] * (threads == 2)
        found.append(run(*words, cwd=folder, threads=threads, before=LITTLE))
    return folder, found


def test_the_main_job_ends_with_0_and_says_what_a_designer_needs(
    runs, monkeypatch, capsys
):
    folder, (first, _) = runs
    assert first.returncode == 0, first.stderr
    lines = first.stdout.splitlines()
    assert lines[0] == "OK       2 projectors and 2 cameras measure face.obj as asked"
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= COLUMNS
    for words in ("P1 ", "C2 ", "CHECK    passed", "plan.json", "patterns", "show"):
        assert words in first.stdout
    code, shown, _ = in_process(monkeypatch, capsys, "show", folder / "plan1", "--all")
    assert code == 0
    for words in ("COVERAGE", "MARGINAL", "RINGS    P1", "COST", "CAMERAS: "):
        assert words in shown
    offered = re.findall(r"(\d+) candidate poses", shown.replace(",", ""))
    assert 160 <= int(offered[0]) <= 320
    assert int(offered[1]) == 120
    assert "plan: " not in first.stdout
    assert "cameras: candidates" in first.stderr


def test_the_same_command_gives_the_same_files_whatever_the_threads(runs):
    folder, _ = runs
    drawn = sorted(
        path.relative_to(folder / "plan1").as_posix()
        for path in (folder / "plan1" / "patterns").rglob("*.*")
    )
    cost = json.loads((folder / "plan1" / "plan.json").read_text())["cost"]
    assert len([name for name in drawn if name.endswith(".png")]) == cost["n_frames"]
    # Points were measured in the first run alone.
    pages = [(folder / f"plan{n}" / "report.html").read_text() for n in (1, 2)]
    assert ["measured error, outside positive" in page for page in pages] == [
        True,
        False,
    ]
    for name in ("surface.npz", "rig.png", *drawn):
        one, two = ((folder / f"plan{n}" / name).read_bytes() for n in (1, 2))
        assert one == two, name
    texts = []
    for n in (1, 2):
        document = json.loads((folder / f"plan{n}" / "plan.json").read_text())
        for key in VOLATILE:
            assert document.pop(key)
        assert (document.pop("reconstruction") is None) == (n == 2)
        del document["members"][0]["reconstruction"]
        texts.append(json.dumps(document))
    assert texts[0] == texts[1]


def test_verify_passes_a_good_plan_and_fails_a_spoiled_one(
    runs, tmp_path, monkeypatch, capsys
):
    folder, _ = runs
    words = "verify", "plan1", "--mesh", "face.obj", "--json"
    # Claims come out again to the last digit by the code that planned.
    good = run(*words, cwd=folder, before=LITTLE)
    assert good.returncode == 0, good.stderr + good.stdout
    assert json.loads(good.stdout)["passed"] is True
    spoiled = tmp_path / "plan.json"
    document = json.loads((folder / "plan1" / "plan.json").read_text())
    document["coverage"]["target"]["measured_m2"] *= 0.9
    spoiled.write_text(json.dumps(document))
    (tmp_path / "surface.npz").write_bytes(
        (folder / "plan1" / "surface.npz").read_bytes()
    )
    # What is false shows without the pixels, which the good plan was held against.
    audit_alone = partial(verify_plan, check_pixels=False)
    monkeypatch.setattr("planning.cli.checks.verify_command.verify_plan", audit_alone)
    code, out, err = in_process(monkeypatch, capsys, "verify", spoiled, "--quiet")
    assert (code, err) == (1, "")
    assert "measured_m2" in out


def test_json_is_one_object_and_nothing_else(runs):
    folder, (_, second) = runs
    assert second.returncode == 0, second.stderr
    document = json.loads(second.stdout)
    assert document["format"] == "ringrig-plan"
    assert document["reconstruction"] is None
    assert document.pop("missed") == []
    written = json.loads((folder / "plan2" / "plan.json").read_text())
    assert written.items() <= document.items()


def test_ctrl_c_before_a_first_plan_leaves_nothing_and_exits_130(face, tmp_path):
    code = (
        "import planning.cli.plans.plan_command as c, sys\n"
        "def stop(*a, **k): raise KeyboardInterrupt\n"
        "c.plan_rig = stop\n"
        f"sys.argv = ['plan', '--mesh', {str(face)!r}, '--max-projectors', '3']\n"
        "from planning.cli.main import main; main()"
    )
    home = str(Path(planning.__file__).resolve().parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": home},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 130
    assert not (tmp_path / "face-plan" / "plan.json").exists()


def test_a_signal_while_a_plan_is_saved_costs_no_second_saving(
    runs, tmp_path, monkeypatch, capsys
):
    folder, _ = runs
    plan, saved = RigPlan.load(folder / "plan1" / "plan.json"), []

    def made(*_, keep, **__):
        try:
            keep(plan)
        except KeyboardInterrupt:
            raise InterruptedPlanError(plan) from None

    def draw(plan, **options):
        saved.append(plan)
        os.kill(os.getpid(), signal.SIGTERM)
        return draw_rig(plan, **options)

    monkeypatch.setattr("planning.cli.plans.plan_command.plan_rig", made)
    monkeypatch.setattr("planning.cli.plans.saved_plans.draw_rig", draw)
    words = ["--mesh", folder / "face.obj", "--max-projectors", 3, "-o", tmp_path]
    code, _, _ = in_process(monkeypatch, capsys, *words)
    assert (code, saved) == (130, [plan])


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--mesh", "no.obj", "--max-projectors", 3], 3, "no such file"),
        (["--mesh", "FACE", "--unit", "m", "--max-projectors", 3], 3, "--unit mm"),
        (["--mesh", "FACE", "--max-projectors", 0], 2, "not in the range"),
        (["--mesh", "FACE", "--max-projectors", 10**23], 2, "not in the range"),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "--max-cameras", 2**54],
            2,
            "1<=x<=1000000",
        ),
        (["--mesh", "FACE"], 2, "--max-projectors"),
        (["--mesh", "FACE", "--max-projectors", 3, "--nope"], 2, "--nope"),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "--pattern", "none"],
            2,
            "which has no projector",
        ),
        (
            ["--mesh", "FACE", "--mesh", "FACE", "--max-projectors", 3, "--size-mm", 9],
            2,
            "--size-mm with 2 meshes",
        ),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "--unit", "mm", "--size-mm", 3],
            2,
            "not both",
        ),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "--coverage", "nan"],
            2,
            "coverage",
        ),
        (["--mesh", "FACE", "--max-projectors", 3, "--rig", "x.toml"], 3, "x.toml"),
        (["--max-projectors", 3], 2, "give --mesh FILE, or --ranges"),
        (["--mesh", "", "--max-projectors", 3], 2, "names no file"),
        (["--ranges", "", "--max-projectors", 3], 2, "names no file"),
        (
            ["--mesh", "FACE", "--ranges", "o.csv", "--max-projectors", 3],
            2,
            "not both: a mesh says where",
        ),
        (["--ranges", "o.csv", "--max-projectors", 3], 3, "o.csv: no such file"),
        (["--ranges", "FACE", "--max-projectors", 3], 3, "line 4: the header lacks"),
        (
            ["--ranges", "o.csv", "--max-projectors", 3, "--unit", "mm"],
            2,
            "--unit with --ranges: the file is in millimetres",
        ),
        (
            ["--ranges", "o.csv", "--max-projectors", 3, "--select", "f.txt"],
            2,
            "no faces to select",
        ),
        (
            ["--ranges", "o.csv", "--max-projectors", 3, "--target", "dominant"],
            2,
            "no dominant region",
        ),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "-o", "FACE/x"],
            2,
            "can't write",
        ),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "--time-limit", "0.001"],
            5,
            "time limit",
        ),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "--coverage", "95"],
            2,
            "95 is over 1; did you mean 95%",
        ),
        (
            ["--mesh", "FACE", "--max-projectors", 3, "--coverage", "195 %"],
            2,
            "1.95 is not in the range",
        ),
        # A file is what is planned; another one would be a second mesh.
        (["FACE"], 2, "--max-projectors"),
        (["no.obj", "--max-projectors", 3], 3, "no.obj: no such file"),
        (["--max-projectors", 3, "no.obj"], 3, "no.obj: no such file"),
        (["FACE", "--mesh", "FACE", "--max-projectors", 3, "--select", "x"], 3, "one"),
        (["verify", "no.json"], 3, "no such file"),
        (["verify", "."], 3, r"plan\.json: no such file"),
        (["reconstruct", "."], 3, r"plan\.json: no such file"),
        (["vrify"], 2, "verify"),
        (["export", "plan.json", "--to", "obj"], 2, "is none of opencv"),
        (["export", "no.json", "--to", "mitsuba"], 3, "no such file"),
        (["verify", "no.json", "--spp", "8"], 2, "--spp goes with --renderer mitsuba"),
        (["report", "plan.json"], 3, "no such file"),
        (["reconstruct", "no.json"], 3, "no such file"),
    ],
)
def test_errors_are_one_line_with_the_documented_code(
    words, code, message, face, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    words = [str(w).replace("FACE", str(face)) for w in words]
    if words[0] not in ("verify", "vrify", "export", "report", "reconstruct"):
        words += ["--quiet"]
    found, out, err = in_process(monkeypatch, capsys, *words)
    assert found == code
    assert out == ""
    assert len(err.splitlines()) == 1
    assert re.search(message, err)


def test_each_fault_of_a_rig_file_has_a_line(face, tmp_path, monkeypatch, capsys):
    (tmp_path / "rig.toml").write_text('base = "default"\n[lens]\n[limits]\nx = 1\n')
    words = [face, "--max-projectors", 3, "--rig", tmp_path / "rig.toml"]
    code, out, err = in_process(monkeypatch, capsys, *words, "-o", tmp_path / "o")
    assert (code, out) == (3, "")
    assert [line.split("`")[1] for line in err.splitlines()] == ["limits.x", "lens"]
    assert all(line.startswith("plan: ") for line in err.splitlines())


@pytest.mark.parametrize(("written", "share"), [("90%", 0.9), ("85 %", 0.85)])
def test_a_share_may_be_given_in_percent(
    written, share, face, tmp_path, monkeypatch, capsys
):
    asked = {}

    def plan_rig(*_, **options):
        asked.update(options)
        raise planning.InputError("enough")

    monkeypatch.setattr("planning.cli.plans.plan_command.plan_rig", plan_rig)
    words = [face, "--max-projectors", 3, "--coverage", written, "-o", tmp_path / "o"]
    assert in_process(monkeypatch, capsys, *words)[0] == 3
    assert asked["coverage"] == share
    assert asked["dominant_coverage"] is None


def test_an_empty_mesh_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "empty.obj").write_text("# nothing\n")
    words = ["--mesh", tmp_path / "empty.obj", "--max-projectors", 3, "--quiet"]
    code, out, err = in_process(monkeypatch, capsys, *words)
    assert (code, out) == (3, "")
    assert len(err.splitlines()) == 1
    assert "empty.obj" in err


def test_help_prints_its_examples_as_lines(tmp_path):
    lines = [line.strip() for line in run("--help", cwd=tmp_path).stdout.splitlines()]
    for command in (
        "plan --mesh face.obj",
        "plan verify face-plan",
        "plan reconstruct",
    ):
        assert sum(line.startswith(command) for line in lines) == 1


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom planning.cli.main import commands\n"
        "try:\n    commands.main(['--help'], prog_name='plan')\n"
        "except SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'trimesh', 'igl', 'cvxpy', 'casadi', 'PIL'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    home = str(Path(planning.__file__).resolve().parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": home},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert "--max-projectors" in done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_is_told_how_to_complete(shell, monkeypatch, capsys):
    code, out, _ = in_process(monkeypatch, capsys, "completion", shell)
    assert code == 0
    assert "_PLAN_COMPLETE" in out


def test_options_of_the_main_job_are_completed(monkeypatch, capsys):
    monkeypatch.setenv("COMP_WORDS", "plan --max")
    monkeypatch.setenv("COMP_CWORD", "1")
    monkeypatch.setenv("_PLAN_COMPLETE", "bash_complete")
    _, out, _ = in_process(monkeypatch, capsys)
    counts = ("projectors", "cameras", "heads")
    assert out.split() == [f"plain,--max-{kind}" for kind in counts]


def test_help_puts_every_option_into_a_group(monkeypatch, capsys):
    _, out, _ = in_process(monkeypatch, capsys, "--help")
    _, others = out.split("Others:")
    assert re.findall(r"--[a-z-]+", others.split("Examples:")[0]) == ["--help"]


def test_a_rig_is_shown_as_a_file_that_can_be_planned(monkeypatch, capsys, tmp_path):
    code, out, _ = in_process(monkeypatch, capsys, "rigs", "show", "lee-krim-2014")
    assert code == 0
    (tmp_path / "mine.toml").write_text(out)
    mine, preset = load_rig(tmp_path / "mine.toml"), load_rig("lee-krim-2014")
    assert mine.to_document() == preset.to_document()
    for words, status in ((["show", "nobody"], 3), (["show"], 2), (["new"], 2)):
        assert in_process(monkeypatch, capsys, "rigs", *words)[0] == status


def test_sample_writes_the_file_at_the_root(tmp_path, monkeypatch, capsys):
    path = tmp_path / "mine.obj"
    code, out, _ = in_process(
        monkeypatch, capsys, "sample", "-o", path, "--faces", 2000
    )
    assert code == 0
    assert "mine.obj" in out
    assert path.read_text().startswith("# Sample head")


def test_the_real_face_scan_is_planned(tmp_path):
    """In parallel light too: benchmarks/plans/main_job.py."""
    mesh = SHARED / "meshes" / "face_scan_james.obj"
    if not mesh.exists():
        pytest.skip("../shared/data isn't there")
    words = ["--mesh", str(mesh), "--max-projectors", "3"]
    done = run(*words, "-o", str(tmp_path), "--quiet", cwd=tmp_path, before=LITTLE)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "CHECK    passed" in done.stdout


def test_a_hollow_bust_exits_1_and_says_how_much_why_and_what_helps(tmp_path):
    mesh = SHARED / "meshes" / "snowden_bust_lo.obj"
    if not mesh.exists():
        pytest.skip("../shared/data isn't there")
    words = ["--mesh", str(mesh), "--unit", "in", "--max-projectors", "3", "--no-check"]
    words += ["--cameras-by", "cover", "-o", str(tmp_path), "--quiet"]
    done = run(*words, cwd=tmp_path, before=LITTLE)
    assert done.returncode == 1, done.stderr
    assert "can be lit from anywhere" in done.stdout
    assert "shadowed" in done.stdout
    assert done.stdout.startswith("NOT MET  ")
    assert "HELPS    --target outside leaves out all that lies inside" in done.stdout
    assert (tmp_path / "plan.json").exists()


def test_progress_keeps_its_indentation_and_no_control_sequence(capsys):
    reporter(quiet=False)("  14 regions of part\x1b[2K")
    assert capsys.readouterr().err == "plan:   14 regions of part\\x1b[2K\n"
