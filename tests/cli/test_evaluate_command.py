"""`plan evaluate` and `plan --fixed` as a designer types them."""

import json
import sys

import pytest
from support.little_work import draw_fewer
from support.plain_shapes import box

from planning.cli.main import main
from planning.model.plan import RigPlan
from planning.verify.verification import verify_plan

POSES = (
    "name,kind,x_mm,y_mm,z_mm,aim_x_mm,aim_y_mm,aim_z_mm\n"
    "light,projector,0,-1080,0,0,0,0\neye,camera,250,-1050,0,0,0,0\n"
)


@pytest.fixture
def plan(monkeypatch, capsys, tmp_path):
    """Run `plan` in this process, in a folder with a plate; code, stdout, stderr."""
    plate = box((100.0, 10.0, 100.0), divisions=4)
    lines = [f"v {x} {y} {z}" for x, y, z in plate.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in plate.faces + 1]
    (tmp_path / "plate.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "mounted.csv").write_text(POSES)
    monkeypatch.chdir(tmp_path)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["plan", *words])
        with pytest.raises(SystemExit) as caught:
            main()
        return caught.value.code or 0, *capsys.readouterr()

    return run


@pytest.mark.long
def test_a_rig_as_it_stands_has_a_folder_like_a_plans(plan, tmp_path, monkeypatch):
    draw_fewer(monkeypatch, claims=3000, overlaps=3000)
    words = ["plate.obj", "--poses", "mounted.csv", "--target", "surface", "--json"]
    # 13 degrees are little for what a calibration leaves.
    words += ["--accuracy", "1"]
    code, out, _ = plan(
        "evaluate", *words, "--no-check", "--no-patterns", "--no-report"
    )
    folder = tmp_path / "plate-evaluation"
    assert code == 1
    assert {path.name for path in folder.iterdir()} == {
        *("plan.json", "surface.npz", "rig.png")
    }
    document = json.loads(out)
    assert document["evaluation"]["path"] == "mounted.csv"
    assert "1 projector lights" in document["missed"][0]
    # One side of a plate faces them.
    assert document["coverage"]["target"]["measured_m2"] == pytest.approx(0.01, rel=0.1)
    check = verify_plan(RigPlan.load(folder / "plan.json"))
    assert check.audit.failures == ()
    assert check.reconstruction is not None
    # As good as this light can be: the requirements are what was reached.
    shares = ["--dominant-coverage", "0.3", "--coverage", "0.3"]
    shares += ["--min-reachable", "0.1", "--region-coverage", "0"]
    shares += ["--no-check", "--no-patterns", "--no-report"]
    assert plan("evaluate", *words, *shares)[0] == 0


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["evaluate", "plate.obj"], 2, "Missing option '--poses'"),
        (["evaluate", "--poses", "mounted.csv"], 2, "give --mesh FILE"),
        (
            ["evaluate", "plate.obj", "--poses", "mounted.csv", "--max-cameras", "2"],
            2,
            "No such option '--max-cameras'",
        ),
        (["evaluate", "plate.obj", "--poses", "no.csv"], 3, "no.csv: no such file"),
        (["evaluate", "plate.obj", "--poses", "mounted.csv:it"], 3, "no device 'it'"),
        (
            ["evaluate", "plate.obj", "--poses", "mounted.csv:eye"],
            3,
            "0 projectors and 1 camera stand",
        ),
        (
            ["plate.obj", "--max-projectors", "1", "--fixed", "mounted.csv:light,x"],
            3,
            "mounted.csv: has no device 'x'; its devices are light, eye",
        ),
    ],
)
def test_what_cant_be_evaluated_is_refused(plan, tmp_path, words, code, sentence):
    found, _, told = plan(*words)
    assert (found, sentence in told) == (code, True), told
    assert not (tmp_path / "plate-evaluation").exists()
