"""`plan calibrate`: what it prints and writes, and how it ends."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from support.handmade import build_plan

from planning.cli.main import commands


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    build_plan().save(folder / "plan.json")
    return folder


@pytest.fixture
def calibrate(folder):
    def run(*words):
        return CliRunner().invoke(commands, ["calibrate", str(folder), *words])

    return run


def test_images_are_printed_and_written(calibrate, folder):
    done = calibrate("--quiet", "--threads", "1", "--accuracy", "0.1")
    assert done.exit_code == 0, done.output
    written = json.loads((folder / "calibration-images.json").read_text())
    n = len(written["images"])
    assert f"IMAGES   {n} of a flat board" in done.output
    assert "12 x 9 marks, 80 x 60 mm between the outermost" in done.output
    left = written["left"]
    assert f"{1e3 * left['p95_without_one_m']:.3f} with any one image" in done.output
    assert left["p95_m"] <= left["p95_without_one_m"] <= written["limit_m"]
    assert left["devices"].keys() == {"P1", "P2", "C1", "C2"}
    for image in written["images"]:
        turn = np.array(image["world_from_board"])[:3, :3]
        assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-8)
        assert np.linalg.det(turn) == pytest.approx(1.0)


def test_what_no_board_reaches_ends_with_1(calibrate, tmp_path):
    words = ["--accuracy", "1e-6", "--json", "-o", str(tmp_path / "few.json")]
    done = calibrate(*words, "--quiet", "--marks", "4x3")
    assert done.exit_code == 1
    left = json.loads(done.stdout)["left"]
    assert not left["suffices"]
    assert left["of_stated"] is None


@pytest.mark.parametrize(
    "words",
    [
        ["--marks", "3x"],
        ["--marks", "3.5x4"],
        ["--marks", "1000x1000"],
        ["--board", "0x20"],
        ["--board", "nanx20"],
        ["--mark-px", "0"],
    ],
)
def test_no_board_is_usage(calibrate, words):
    assert calibrate(*words).exit_code == 2
