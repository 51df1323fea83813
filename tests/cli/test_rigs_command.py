"""`plan rigs` and what hangs on it; `plan play` on a screen that nobody looks at."""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image, ImageGrab

from planning.cli.main import commands
from planning.rig.rig import load_rig
from planning.rig.toml.preset_files import preset_names, preset_text


def plan(*words: str, **more) -> "tuple[int, str, str]":
    result = CliRunner().invoke(commands, [*words], **more)
    return result.exit_code, result.stdout, result.stderr


def test_rigs_are_a_line_each_and_shown_as_their_files():
    code, told, _ = plan("rigs")
    assert code == 0
    for name in preset_names():
        assert sum(line.startswith(f"{name} ") for line in told.splitlines()) == 1
    assert len(told.splitlines()) < 40
    assert plan("rigs", "show", "jewellery")[1] == preset_text("jewellery")
    sources = plan("rigs", "show", "default", "--sources")[1]
    assert "throw_ratio = 1.49675\n      read: Panasonic" in sources


def test_devices_are_listed_and_shown_with_their_sources():
    told = plan("rigs", "devices")[1]
    assert "sony/a7-iii" in told
    assert "1998 USD" in told
    assert "a7-iii" not in plan("rigs", "devices", "lenses")[1]
    assert "read: BenQ SX914" in plan("rigs", "show", "benq/sx914")[1]
    code, _, told = plan("rigs", "show", "benq/sx915")
    assert code == 3
    assert "did you mean benq/sx914" in told


@pytest.mark.parametrize(
    "words",
    [
        ("--object-mm", "120"),
        ("--object-mm", "300", "--throw-ratio", "1.5", "--projector-px", "1024x768"),
        (
            "--object-mm",
            "1200",
            "--projector",
            "optoma/uhd40",
            "--sensor-px",
            "5320x4600",
        ),
        ("--camera", "sony/a7-iii + sony/50mm", "--distance-mm", "1500"),
    ],
)
def test_a_new_rig_is_one_to_plan_with(tmp_path, words):
    path = tmp_path / "bench.toml"
    code, told, _ = plan("rigs", "new", "-o", str(path), *words)
    assert code == 0
    assert f"--rig {path}" in told
    assert "doesn't plan" not in told
    rig = load_rig(path)
    assert rig.name == "bench"
    near, far = rig.camera_device().range_m
    assert near <= rig.standoff_m - rig.standoff_play_m
    assert far >= rig.standoff_m + rig.standoff_play_m
    code, _, told = plan("rigs", "new", "-o", str(path), *words)
    assert code == 2
    assert "exists" in told


def test_a_new_rig_asks_again_for_what_cannot_be(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "planning.cli.devices.new_rig_command._is_terminal", lambda: True
    )
    path = tmp_path / "mine.toml"
    answers = ["-3", "200", "nosuch/projector", "1.2", "1280x800", "0"]
    answers += ["flir/bfs-u3-32s4", "flir/bfs-u3-32s4m + falenses/16mm", "", ""]
    code, _, told = plan(
        "rigs", "new", "-o", str(path), input="\n".join(answers) + "\n"
    )
    assert code == 0
    for hint in ("must be a positive number", "is none of", "did you mean flir"):
        assert hint in told
    table = load_rig(path).table
    assert table.projector.resolution_px == [1280, 800]
    assert table.camera.focal_mm == 16.0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "give at least --object-mm"),
        (("--projector", "a/b", "--throw-ratio", "1"), "not both"),
        (
            (
                *("--object-mm", "900", "--distance-mm", "200"),
                *("--throw-ratio", "1", "--sensor-px", "64x48"),
            ),
            "no usual",
        ),
        (("--object-mm", "150", "--distance-mm", "300"), "focused from 912 to 9124 mm"),
        (("--object-mm", "15cm"), "isn't a number"),
        (("--pixel-um", "9"), "--pixel-um goes with --sensor-px"),
        (
            ("--camera", "basler/acA2440-75um + 16mm", "--focal-mm", "25"),
            "leave --focal-mm out",
        ),
        (("--projector", "a/b"), "no projector 'a/b'"),
    ],
)
def test_a_new_rig_of_nothing_is_refused(tmp_path, words, told):
    code, _, error = plan("rigs", "new", "-o", str(tmp_path / "a.toml"), *words)
    assert code in (2, 3)
    # Click's own page stands before what is wrong with the usage.
    assert told in error.splitlines()[-1]
    assert not list(tmp_path.iterdir())


def test_a_new_rig_says_what_binds_its_distance(tmp_path):
    words = ("--object-mm", "232", "--projector", "benq/sx914")
    told = plan("rigs", "new", "-o", str(tmp_path / "a.toml"), *words)[1]
    assert "the least at which the projector can be focused" in told
    words = ("--object-mm", "232", "--throw-ratio", "1.5")
    told = plan("rigs", "new", "-o", str(tmp_path / "b.toml"), *words)[1]
    assert "the least at which one image of the projector holds the object" in told


def test_no_lens_is_chosen_whose_pixels_lose_the_edges(tmp_path):
    # At 320 mm a drawn edge is 0.26 mm wide and more, 6 pixels of a 25 mm lens.
    words = ("--object-mm", "60", "--projector", "ti/dlplcr4710")
    words += ("--sensor-px", "2448x2048")
    told = plan("rigs", "new", "-o", str(tmp_path / "a.toml"), *words)[1]
    assert "a 16 mm lens: the longest usual one" in told
    assert "aren't found" not in told
    path = str(tmp_path / "b.toml")
    assert (
        "aren't found" in plan("rigs", "new", "-o", path, *words, "--focal-mm", "25")[1]
    )


@pytest.fixture
def patterns(tmp_path):
    """Return a folder with patterns of a projector of 64 x 48 px, for two cameras."""
    folder, frames = tmp_path / "plan" / "patterns", []
    (folder / "P1").mkdir(parents=True)
    for number, (name, camera) in enumerate(
        [("white", None), ("root-C1", "C1"), ("root-C2", "C2")]
    ):
        png = f"P1/{number:02d}-{name}.png"
        levels = np.random.default_rng(number).integers(0, 255, (48, 64), np.uint8)
        Image.fromarray(levels).save(folder / png)
        frames.append({"png": png, "camera": camera})
    entry = {"id": "P1", "resolution": [64, 48], "frames": frames}
    (folder / "sequence.json").write_text(json.dumps({"projectors": [entry]}))
    return folder


@pytest.fixture
def screen(monkeypatch):
    """Open a screen of 200 x 100 px."""
    pytest.importorskip("tkinter")
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb, so no screen to show frames on")
    read, write = os.pipe()
    words = ["Xvfb", "-displayfd", str(write), "-screen", "0", "200x100x24"]
    # Without it the screen goes away with whoever looked at it last.
    words += ["-noreset", "-nolisten", "tcp"]
    server = subprocess.Popen(words, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    # It writes its number in pieces.
    with os.fdopen(read) as answer:
        display = f":{answer.readline().strip()}"
    monkeypatch.setenv("DISPLAY", display)
    for _ in range(100):
        with contextlib.suppress(OSError):
            assert ImageGrab.grab(xdisplay=display).size == (200, 100)
            break
        time.sleep(0.1)
    yield display
    server.terminate()
    server.wait()


def test_frames_are_shown_pixel_by_pixel_and_captured(patterns, screen, tmp_path):
    grab = tmp_path / "grab.py"
    grab.write_text(
        "import sys\nfrom PIL import ImageGrab\n"
        "image = ImageGrab.grab(bbox=(30, 20, 94, 68), xdisplay=sys.argv[1])\n"
        "image.convert('L').save(sys.argv[2])\n"
    )
    folder = tmp_path / "captures"
    words = ["play", str(patterns.parent), "P1", "--at", "30,20", "--hold", "0.1"]
    words += ["--folder", str(folder)]
    command = f"{sys.executable} {grab} {screen} {{file}}"
    code, told, error = plan(*words, "--cameras", "C2", "--capture", command)
    assert (code, error.count("captures")) == (0, 2)
    assert "--captures" in told
    # The layout of docs/use/captures.md: root discs of other cameras are left out.
    taken = sorted(path.relative_to(folder) for path in folder.rglob("*.png"))
    assert [str(path) for path in taken] == [
        "C2/P1/00-white.png",
        "C2/P1/02-root-C2.png",
    ]
    for path in taken:
        shown, drawn = folder / path, patterns / "P1" / path.name
        assert np.array_equal(Image.open(shown), Image.open(drawn))
    code, _, error = plan(*words, "--cameras", "C2", "--capture", command)
    assert code == 2
    assert "holds images already" in error
    code, _, error = plan(*words, "--cameras", "C1", "--capture", "true {file}")
    assert code == 3
    assert "wrote no" in error
    code, _, error = plan(*words[:3], "--at", "150,0", "--hold", "0")
    assert code == 3
    assert "don't fit the desktop of 200 x 100 px" in error


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("P2",), 3, "the plan has P1"),
        (("P1", "--folder", "f"), 2, "together"),
        (("P1", "--folder", "f", "--capture", "grab"), 2, "{file} must stand"),
        (("P1", "--folder", "f", "--capture", "grab {file}"), 2, "{camera} must say"),
        (
            ("P1", "--folder", "f", "--capture", "x {file}", "--cameras", "C3"),
            2,
            "no 'C3'",
        ),
        (("P1", "--hold", "0"), 3, "no window can be opened"),
    ],
)
def test_what_cannot_be_played_is_said(patterns, monkeypatch, words, code, told):
    pytest.importorskip("tkinter")
    monkeypatch.setenv("DISPLAY", ":no")
    ended, _, error = plan("play", str(patterns.parent), *words)
    assert ended == code
    # Click's own page stands before what is wrong with the usage.
    assert told in error.splitlines()[-1]


def test_several_cameras_make_a_list_with_counts(tmp_path):
    """`--camera NAME:N` again and again; what follows the colon is a number."""
    path, one = tmp_path / "shelf.toml", "basler/acA2040-55um + 16mm"
    words = ("rigs", "new", "--object-mm", "200", "-o", str(path))
    listed = ("--camera", f"{one}:2", "--camera", "basler/acA2440-75um")
    code, told, _ = plan(*words, *listed)
    assert code == 0
    assert "of basler/acA2440-75um:" in told
    first, second = load_rig(path).models("camera")
    assert (first.table.device, first.table.count) == (one, 2)
    assert second.table.device.startswith("basler/acA2440-75um + ")
    assert second.table.count is None
    for wrong in (f"{one}:0", f"{one}:many"):
        other = (*words[:-1], str(tmp_path / "other.toml"))
        code, _, told = plan(*other, "--camera", wrong)
        assert code == 2
        assert "how many there are, from 1 to 1000" in told
