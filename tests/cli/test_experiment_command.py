"""`plan reconstruct --experiment`: its folder, its numbers, what it refuses."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from support.reconstruction_rigs import single

from planning.cli.experiment_command import experiment_of
from planning.cli.main import commands
from planning.experiments.setups import box_experiment
from planning.verify.reconstruction.faults.measured_clouds import rejection
from planning.verify.reconstruction.single_shot.single_shot import (
    reconstruct_single_shot,
)

PICTURES = {
    "cameras.png": (1280, 390),
    "viewpoints.png": (1440, 540),
    "redundancy.png": (960, 540),
    "errors.png": (960, 556),
}


def run(*arguments: str):
    return CliRunner().invoke(commands, ["reconstruct", *arguments])


@pytest.mark.long
def test_an_experiment_writes_figures_cloud_and_numbers(tmp_path):
    folder = tmp_path / "out"
    found = run(
        "--experiment", "box", "--variant", "fits", "--light", "diverging",
        "--ambient", "0.2", "--distortion", "-0.1", "--single-shot", "--prior-mm", "2",
        "--quiet", "--json", "--seed", "4", "-o", str(folder),
    )  # fmt: skip
    assert found.exit_code == 0, found.output
    document = json.loads(found.stdout)
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [*PICTURES, "cloud.ply", "result.json"]
    )
    assert sorted(document.pop("files")) == sorted(str(p) for p in folder.iterdir())
    assert json.loads((folder / "result.json").read_text()) == document
    for name, size in PICTURES.items():
        with Image.open(folder / name) as picture:
            assert picture.size == size
    merged = document["clouds"][-1]
    header = (folder / "cloud.ply").read_bytes().split(b"end_header")[0].decode()
    assert f"element vertex {merged['errors']['n']}" in header
    assert "unit mm" in header
    assert document["light"] == "diverging"
    assert document["focal_px"] == 2800.0
    assert document["ambient"] == 0.2
    assert document["distortion_k1"] == -0.1
    assert document["labels"]["right"] > 0.8 * document["labels"]["n"]
    assert merged["errors"]["rms_m"] < 0.1e-3


def test_what_is_not_said_is_as_the_paper_has_it():
    options = {"experiment": "box", "light": None, "variant": None, "distortion": None}
    experiment = experiment_of(options)
    assert (experiment.name, experiment.variant) == ("box", "printed")
    assert experiment.light == "parallel"
    assert experiment.optics.focal_px == 8000.0
    assert experiment.optics.distortion == 0.0
    assert experiment_of(options | {"experiment": "face"}).name == "face"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "give DIR/plan.json, or --experiment"),
        (("plan.json", "--experiment", "box"), "give DIR/plan.json, or --experiment"),
        (("plan.json", "--light", "parallel"), "--light doesn't go with a plan"),
        (("plan.json", "--second-sequence", "--captures", "x"), "holds one sequence"),
        (("plan.json", "--ambient", "0", "--captures", "x"), "have their own"),
        (("--experiment", "box", "--captures", "x"), "doesn't go with an experiment"),
        (("--experiment", "box", "--prior-mm", "2"), "goes with --single-shot"),
        (("plan.json", "--single-shot", "--captures", "x"), "not both"),
        (("--experiment", "box", "--single-shot", "--second-sequence"), "not both"),
        (("--experiment", "bust"), "'bust' is not one of"),
        (("--experiment", "box", "--ambient", "-1"), "-1.0 is not in the range"),
    ],
)
def test_what_does_not_go_together_is_usage(arguments, sentence):
    found = run(*arguments)
    assert found.exit_code == 2
    assert sentence in found.output


@pytest.mark.long
def test_a_plan_is_measured_from_single_images_too():
    one = single(box_experiment(variant="fits"))
    found = reconstruct_single_shot(one, tolerance_m=1e-3, seed=3)
    assert found.accuracy is not None
    assert found.accuracy.rms_m < 0.08e-3
    assert found.n_points > 2000
    (pair,) = found.pairs
    left_out = sum(pair.rejected.values())
    assert pair.n_points + left_out == pair.n_edges
    assert {"off_prior", "ambiguous"} <= pair.rejected.keys()
    vague = reconstruct_single_shot(one, tolerance_m=0.05, seed=3)
    assert vague.n_points < 0.3 * found.n_points
    assert "several rings meet the rays" in (rejection(vague.pairs) or "")
    again = reconstruct_single_shot(one, tolerance_m=1e-3, seed=3)
    np.testing.assert_array_equal(again.merged.cloud.points, found.merged.cloud.points)


@pytest.mark.parametrize("option", ["--ambient", "--distortion"])
def test_what_is_no_number_is_refused_before_the_experiment(option, tmp_path):
    words = ["reconstruct", "--experiment", "box", option, "nan", "-o", str(tmp_path)]
    result = CliRunner().invoke(commands, words)
    assert result.exit_code == 2
    assert "nan isn't a finite number" in result.output
