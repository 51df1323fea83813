"""`plan --pareto` and `plan --take` as a designer types them."""

import csv
import json
import signal

import pytest
from click.testing import CliRunner
from PIL import Image
from support.little_work import work_little
from support.plain_shapes import box
from support.small_job import RIG

from planning.cli.main import commands
from planning.model.plan import RigPlan

ASKED = ["--target", "surface", "--accuracy", "1", "--region-coverage", "0"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plate, which has two sides, and a rig of few candidates."""
    folder = tmp_path_factory.mktemp("plate")
    plate = box((0.1, 0.01, 0.1), divisions=4)
    lines = [f"v {x} {y} {z}" for x, y, z in 1e3 * plate.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in plate.faces + 1]
    (folder / "plate.obj").write_text("\n".join(lines) + "\n")
    (folder / "few.toml").write_text(RIG)
    return folder


@pytest.fixture(scope="module")
def plan(folder):
    """Run `plan` in this process, in the folder: exit code, stdout, stderr."""

    def run(*words):
        quick = ["--rig", "few.toml", "--quiet", "--threads", "1"]
        before = signal.getsignal(signal.SIGINT)
        try:
            with pytest.MonkeyPatch.context() as patch:
                patch.chdir(folder)
                work_little(patch)
                ended = CliRunner().invoke(
                    commands, ["plate.obj", *quick, *ASKED, *words]
                )
        finally:
            signal.signal(signal.SIGINT, before)
        if not isinstance(ended.exception, SystemExit | None):
            raise ended.exception
        return ended.exit_code, ended.stdout, ended.stderr

    return run


@pytest.fixture(scope="module")
def front(plan):
    """The front of up to two projectors and two cameras, in plate-front."""
    return plan("--pareto", "--max-projectors", "2", "--max-cameras", "2", "--json")


def test_a_front_is_one_object_and_three_files(front, folder):
    code, out, _ = front
    document = json.loads(out)
    names = ["pareto.csv", "pareto.npz", "pareto.png"]
    assert sorted(p.name for p in (folder / "plate-front").iterdir())[:3] == names
    assert [f"plate-front/{name}" for name in names] == sorted(document["files"])
    counts = [(p["projectors"], p["cameras"]) for p in document["points"]]
    assert counts == [(1, 1), (1, 2), (2, 1), (2, 2)]
    one, *_, four = document["points"]
    # One sees one side, and edges; two of each see both.
    assert one["measured_m2"] < 0.6 * document["area_m2"] < four["measured_m2"]
    assert four["meets"]
    assert not one["meets"]
    assert code == 0
    rows = [*csv.DictReader((folder / "plate-front/pareto.csv").read_text().split())]
    assert len(rows) == 4
    assert float(rows[3]["measured_share"]) == pytest.approx(
        four["measured_m2"] / document["area_m2"], abs=1e-4
    )
    with Image.open(folder / "plate-front" / "pareto.png") as picture:
        assert picture.width > 2 * 300
        assert len(picture.getcolors(1 << 24)) > 10


def test_a_table_of_100_columns_and_exit_1_where_no_point_is_enough(plan):
    words = ["--max-projectors", "1", "--max-cameras", "1", "-o", "short"]
    code, out, _ = plan("--pareto", *words)
    assert code == 1
    lines = out.splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[0].endswith("NOT CHECKED")
    assert lines[3].split()[:2] == ["1", "1"]
    assert "TAKE     none meets what is asked" in out


@pytest.mark.long
def test_a_point_is_planned_into_the_fronts_folder(front, plan, folder):
    code, out, _ = plan("--take", "2,2", "--no-check", "--no-report", "--no-patterns")
    assert code == 0
    assert "NOT CHECKED" in out
    taken = RigPlan.load(folder / "plate-front" / "plan.json")
    assert (len(taken.projectors), len(taken.cameras)) == (2, 2)
    assert (folder / "plate-front" / "pareto.npz").exists()


def test_a_folder_in_the_matrix_place_is_told_before_the_work(
    plan, folder, monkeypatch
):
    monkeypatch.setattr("planning.cli.plans.front_command.plan_front", None)
    (folder / "taken" / "pareto.npz").mkdir(parents=True)
    code, out, told = plan("--pareto", "-o", "taken")
    assert (code, out) == (2, "")
    assert "taken/pareto.npz is a folder, and a file is to be there" in told
    assert "Errno" not in told


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["--take", "3,1"], 2, "has 1 to 2 projectors and 1 to 2 cameras"),
        (["--take", "2,2", "-o", "elsewhere"], 2, "elsewhere keeps no front"),
        (["--take", "two,2"], 2, "'two,2' must be P,C"),
        (["--take", "0,2"], 2, "'0,2' must be P,C"),
        (["--take", "2,2", "--pareto"], 2, "--pareto or --take, not both"),
        (["--take", "2,2", "--max-cameras", "3"], 2, "the point says how many"),
        (["--take", "2,2", "--max-heads", "3"], 2, "a front is of single devices"),
        (["--pareto", "--max-projectors", "0"], 2, "give 1 or more"),
        (["--pareto", "--cameras-by", "paper"], 2, "no rig of fewer cameras"),
        (["--take", "2,2", "--seed", "1"], 3, "made for another seed"),
        (["--take", "2,2", "--light", "parallel"], 3, "made for another rig"),
        (["--take", "2,2", "--coverage", "0.5"], 3, "another set of requirements"),
        (["--pareto", "--survive", "1"], 3, "a front with survive = 1"),
        (["--pareto", "--pattern", "none"], 3, "a front with pattern 'none'"),
    ],
)
def test_what_cant_be_is_told_in_a_line(words, code, sentence, front, plan):
    ended, out, told = plan(*words)
    assert (ended, out) == (code, "")
    # Of click's own usage, which `main` leaves out, the last line alone.
    assert sentence in told.strip().splitlines()[-1]
