"""Gray-code captures of others: a folder of images, and OpenCV's calibration."""

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from support.dense_rigs import BENT, camera_at, frames_of, projector_at, square

from planning.cli.main import commands
from planning.model.errors import CapturesError
from planning.model.light.dense_code import DenseCode
from planning.verify.reconstruction.decode.dense.dense_inspection import require_order
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern

SIZE, CODED = (640, 480), (128, 96)
PROCAM = Path(__file__).parents[4] / "shared" / "data" / "captures" / "procam"


def matrix(name, values):
    """One entry as `cv2.FileStorage` writes it."""
    rows = np.atleast_2d(values)
    text = " ".join(repr(float(value)) for value in rows.ravel())
    return (
        f'<{name} type_id="opencv-matrix">\n<rows>{rows.shape[0]}</rows>\n'
        f"<cols>{rows.shape[1]}</cols>\n<dt>d</dt>\n<data>{text}</data></{name}>\n"
    )


@pytest.fixture(scope="module")
def captured(tmp_path_factory):
    """A tilted square under Gray code, as images and a calibration; and its plane."""
    folder = tmp_path_factory.mktemp("capture")
    code = DenseCode(shifts=0)
    projector = projector_at("P1", (0.2, -0.6, 0.1), code=code, size=CODED)
    camera = camera_at("C1", (-0.1, -0.6, 0.05), focal=2400.0, size=SIZE, lens=BENT)
    frames = frames_of(square(0.12, tilt=0.2), projector, camera)
    u, v = frames.corner
    for k, part in enumerate(frames.stack):
        whole = np.full((SIZE[1], SIZE[0]), 8, dtype=np.uint8)
        whole[v : v + part.shape[0], u : u + part.shape[1]] = part
        Image.fromarray(whole).save(folder / f"gray_{k:02d}.png")
    seen = camera.world_from_device
    pose = np.linalg.inv(projector.world_from_device) @ seen
    entries = (
        ("cam_int", camera.matrix),
        ("cam_dist", np.array(BENT)),
        ("proj_int", projector.matrix),
        ("proj_dist", np.zeros(5)),
        ("R", pose[:3, :3]),
        ("T", 1e3 * pose[:3, 3:]),
    )
    body = "".join(matrix(*entry) for entry in entries)
    (folder.parent / "pair.xml").write_text(
        f'<?xml version="1.0"?>\n<opencv_storage>\n{body}</opencv_storage>\n'
    )
    normal = np.array([np.sin(0.2), -np.cos(0.2), 0.0]) @ seen[:3, :3]
    return (
        folder,
        folder.parent / "pair.xml",
        normal,
        normal @ -(seen[:3, :3].T @ seen[:3, 3]),
    )


def run(folder, calibration, output, *more):
    given = ["--captures", folder, "--calibration", calibration, "-o", output]
    size = f"{CODED[0]}x{CODED[1]}"
    words = ["reconstruct", "--dense", *given, "--projector-size", size, *more]
    return CliRunner().invoke(commands, [str(word) for word in words])


def points_of(path):
    import trimesh

    return np.asarray(trimesh.load(path).vertices)


def test_a_plane_comes_out_flat_and_where_it_is(captured, tmp_path):
    folder, calibration, normal, away = captured
    ended = run(folder, calibration, tmp_path / "out")
    assert ended.exit_code == 0, ended.output
    points = points_of(tmp_path / "out" / "cloud.ply") * 1e-3
    assert len(points) > 5_000
    off = points @ normal - away
    # A code of 128 x 96 px over 0.43 m is told to a pixel of 3.4 mm.
    assert abs(off.mean()) < 4e-4
    assert np.sqrt(np.mean(off**2)) < 4e-3
    assert "calibration is of another" not in ended.output


@pytest.mark.long
def test_white_and_black_may_come_first(captured, tmp_path):
    folder, calibration, *_ = captured
    other = tmp_path / "first"
    other.mkdir()
    files = sorted(folder.iterdir())
    for k, file in enumerate([*files[-2:], *files[:-2]]):
        (other / f"{k:03d}.png").write_bytes(file.read_bytes())
    ended = run(other, calibration, tmp_path / "out")
    assert ended.exit_code == 0
    assert "white and black come first" in ended.output
    plain = run(folder, calibration, tmp_path / "plain")
    assert plain.exit_code == 0
    assert np.array_equal(
        points_of(tmp_path / "out" / "cloud.ply"),
        points_of(tmp_path / "plain" / "cloud.ply"),
    )


def lacks_one(folder):
    (folder / "gray_05.png").unlink()


def exchange(folder, one, other):
    a, b = (folder / f"gray_{k:02d}.png" for k in (one, other))
    first, second = a.read_bytes(), b.read_bytes()
    a.write_bytes(second)
    b.write_bytes(first)


def swapped(folder):
    exchange(folder, 4, 6)


def bits_swapped(folder):
    exchange(folder, 4, 8)
    exchange(folder, 5, 9)


def smaller(folder):
    with Image.open(folder / "gray_03.png") as image:
        image.resize((64, 48)).save(folder / "gray_03.png")


def unnumbered(folder):
    (folder / "gray_00.png").rename(folder / "first.png")


def damaged(folder):
    (folder / "gray_02.png").write_bytes(b"\x89PNG and no more")


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lacks_one, r"numbers 5 are missing|27 images"),
        (swapped, r"gray_04\.png and gray_05\.png.* don't add up"),
        (bits_swapped, r"can't be the bits? of columns"),
        (smaller, r"gray_03\.png.*64 x 48|64 x 48"),
        (unnumbered, r"first\.png carry no number"),
        (damaged, r"gray_02\.png.*not a readable image"),
    ],
)
def test_what_is_wrong_is_one_line_and_exit_3(captured, tmp_path, harm, words):
    folder, calibration, *_ = captured
    other = tmp_path / "harmed"
    other.mkdir()
    for file in folder.iterdir():
        (other / file.name).write_bytes(file.read_bytes())
    harm(other)
    ended = run(other, calibration, tmp_path / "out")
    assert ended.exit_code == 3, ended.output
    assert re.search(words, ended.output), ended.output
    assert not (tmp_path / "out" / "cloud.ply").exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("proj_int", "nothing", "says the projector matrix nowhere"),
        ("<rows>3</rows>", "<rows>4</rows>", "pair.xml"),
        ("</opencv_storage>", "", "not XML"),
    ],
)
def test_a_calibration_that_lacks_something_says_what(
    captured, tmp_path, old, new, words
):
    folder, calibration, *_ = captured
    broken = tmp_path / "pair.xml"
    broken.write_text(calibration.read_text().replace(old, new))
    ended = run(folder, broken, tmp_path / "out")
    assert ended.exit_code == 3, ended.output
    assert words in ended.output


def test_the_board_of_real_captures(benchmark_module):
    """63 corners on a plane, 75 mm apart; calibration and captures are others'."""
    if not PROCAM.exists():
        pytest.skip("no ../shared/data/captures/procam")
    pytest.importorskip("cv2", reason="OpenCV isn't installed: ringrig[captures]")
    procam = benchmark_module("captures.procam")
    pair = procam.file_pair()
    seen, shown = procam.coded_corners(2, pair)
    found = procam.board(seen, shown, pair)
    assert len(found.corners) == 63
    # What their calibration bends of it is 1.2 mm; decoding alone leaves half of that.
    assert found.plane_rms_m < 1.3e-3
    assert found.neighbours_m.mean() == pytest.approx(0.075, rel=5e-3)
    assert np.median(found.residual_px) < 0.3


@pytest.mark.parametrize("turned", [False, True])
def test_a_step_along_the_border_of_a_bit_is_no_wrong_order(turned):
    """Rows 40 and 87, whose codes differ in the highest bit alone, meet at a step."""
    pattern = DensePattern(DenseCode(shifts=0), (64, 128))
    whole = np.arange(128)[:, None].repeat(64, axis=1)
    cut = np.concatenate([np.arange(41), np.arange(87, 128)])
    rows = np.zeros((128, 64), dtype=int)
    # A quarter of the width shows all rows, so that some changes are as they should be.
    rows[:, :16], rows[:82, 16:] = whole[:, :16], cut[:, None]
    lit = np.zeros((128, 64), dtype=bool)
    lit[:, :16], lit[:82, 16:] = True, True
    columns = np.arange(64)[None].repeat(128, axis=0)
    frames = [np.full((128, 64), 200.0), np.full((128, 64), 20.0)]
    for frame in pattern.frames[: pattern.white]:
        share = pattern.shares(frame)[columns if frame.along == "column" else rows]
        frames.append(20.0 + 180.0 * share)
    # Four pixels of the image for one of the panel.
    window = np.array(frames, dtype=np.float32).repeat(4, axis=1).repeat(4, axis=2)
    lit = lit.repeat(4, axis=0).repeat(4, axis=1)
    names = ["white", "black", *(frame.name for frame in pattern.frames)]
    if not turned:
        require_order(window, lit, pattern, names)
        return
    first = 2 + pattern.first_bit(1)
    order = [first + 2, first + 3, first, first + 1]
    window[first : first + 4] = window[order]
    with pytest.raises(CapturesError, match="can't be the bits"):
        require_order(window, lit, pattern, names)
