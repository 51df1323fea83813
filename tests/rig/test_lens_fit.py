"""Which optics fit an object, against closed forms and the rig's own formulas."""

import json
import math
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_rig
from support.plain_shapes import box, joined

from geometry.devices import PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.cli.lines.object_lines import optics_lines, size_lines
from planning.cli.main import main
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.light.drawn_edges import DrawnEdges
from planning.pipeline import plan_rig
from planning.rig import optics
from planning.rig.devices.edge_optics import farthest_off, straighter_focus
from planning.rig.devices.lens_fit import check_fields
from planning.rig.object_size import ObjectSize
from planning.rig.rig import load_rig

BALL = 0.13


def fit_of(rig, kind, size):
    """How the only model of a kind suits an object."""
    (model,) = rig.models(kind)
    return rig.fit(model, size)


# The default camera: 12 mm on 3.45 um, 2048 x 1536 px, 1 px of blur, 1 m +- 50 mm.
FOCAL_PX, PIXEL_M, DISTANCE = 12e-3 / 3.45e-6, 3.45e-6, 1.0 + BALL

CENTRED = """
base = "default"
name = "centred"
[projector]
name = "centred"
resolution_px = [1000, 800]
throw_ratio = 1.5
range_mm = [300.0, 3000.0]
"""


@pytest.fixture
def write(tmp_path):
    def written(text):
        (tmp_path / "rig.toml").write_text(text)
        return tmp_path / "rig.toml"

    return written


@pytest.mark.parametrize(("radius", "images"), [(0.22, 1), (0.26, 1), (0.262, 2)])
def test_an_object_that_one_image_shows_takes_one(radius, images):
    """The ball is wider than the field at its front, 0.423 m, but farther away."""
    fit = fit_of(load_rig(), "projector", ObjectSize.ball(radius))
    assert fit.field_m[1] == pytest.approx(0.4231, abs=1e-4)
    assert fit.images == images
    assert (fit.standoff_that_holds_m <= fit.standoff_m) == (images == 1)


@pytest.mark.parametrize(("near", "far"), [(0.95, 1.18), (0.3, 0.31), (1.0, 9.0)])
@pytest.mark.parametrize("focal", [0.012, 0.035])
def test_the_least_stop_is_sharp_from_end_to_end_and_no_wider_one_is(near, far, focal):
    stop, focus = optics.least_stop(focal, PIXEL_M, near, far)
    sharp = optics.depth_of_field(focal, stop, PIXEL_M, focus)
    assert sharp == pytest.approx((near, far))
    for other in (0.99 * focus, focus, 1.01 * focus):
        low, high = optics.depth_of_field(focal, 0.999 * stop, PIXEL_M, other)
        assert low > near or high < far
    assert optics.longest_sharp(stop, PIXEL_M, near, far) == pytest.approx(focal)


def test_depths_that_no_lens_images_are_refused():
    for near, far in ((0.01, 1.0), (1.0, 0.9), (math.nan, 1.0)):
        with pytest.raises(ValueError, match="must rise, beyond the focal length"):
            optics.least_stop(0.012, PIXEL_M, near, far)


def test_a_ball_in_a_centred_image_has_closed_forms():
    fit = fit_of(make_rig(), "camera", ObjectSize.ball(BALL))
    disc = math.pi * (BALL * FOCAL_PX / DISTANCE) ** 2
    assert fit.share == pytest.approx(disc / (2048 * 1536))
    width, height = fit.field_m
    assert (width, height) == pytest.approx((2048 / FOCAL_PX, 1536 / FOCAL_PX))
    # The cone about the ball meets the middle of the long side.
    half = math.asin(BALL / DISTANCE)
    assert fit.fitting.focal_px == pytest.approx(768 / math.tan(half))
    away = BALL / math.sin(math.atan(768 / FOCAL_PX)) - BALL
    assert fit.standoff_that_holds_m == pytest.approx(away)
    assert fit.depths_m == pytest.approx((0.95, DISTANCE + 0.05))
    assert fit.is_sharp


def test_the_longest_lens_of_a_shifted_projector_is_the_longest_that_holds_the_ball():
    fit = fit_of(make_rig(), "projector", ObjectSize.ball(BALL))
    best = fit.fitting.focal_px / fit.device.focal_px
    for factor, holds in ((0.999, True), (1.001, False), (2.0, False)):
        matrix = fit.device.camera_matrix * [[factor, 1, 1], [1, factor, 1], [1, 1, 1]]
        matrix[0, 0] *= best
        matrix[1, 1] *= best
        other = type(fit.device)(matrix, fit.device.resolution, fit.device.range_m)
        assert other.holds_ball(BALL, DISTANCE) == holds
    ratio = fit.fitting.focal_px / 1024
    assert f"a throw ratio of {ratio:.3g} would show all of it" in fit.advice()


def test_a_lens_too_long_to_be_sharp_gives_way_to_one_that_is():
    """A ball of 20 mm: what would fill the image has no depth at any stop."""
    fit = fit_of(make_rig(), "camera", ObjectSize.ball(0.01))
    near, far = fit.depths_m
    focal = fit.fitting.focal_px * PIXEL_M
    assert focal < 768 * PIXEL_M / math.tan(math.asin(0.01 / 1.01))
    assert optics.least_stop(focal, PIXEL_M, near, far)[0] == pytest.approx(22.0)
    assert "f/22" in fit.advice()
    faint = 0.55e-6 * 22.0 / PIXEL_M
    assert f"diffraction blurs {faint:.1f} px" in fit.advice()


def test_a_lens_longer_than_the_distance_is_never_called_sharp(write):
    """The object is nearer than the focal point: nothing of it has an image."""
    text = 'base = "default"\n[camera]\nfocal_mm = 960.0\n'
    with pytest.raises(InfeasibleLimitsError, match="a lens of 960 mm at no focus sha"):
        load_rig(write(text + "[camera.focus]\ndistance_mm = 2000.0\n"))


def test_parallel_light_fits_by_its_pixels():
    fit = fit_of(make_rig("parallel"), "projector", ObjectSize.ball(BALL))
    assert fit.fitting.pixel_pitch_m == pytest.approx(2 * BALL / 768)
    assert fit.share == pytest.approx(math.pi * BALL**2 / (1024 * 768 * 0.8e-3**2))
    assert fit.standoff_that_holds_m is None


def test_a_bodys_shadow_is_a_quarter_of_its_hull(write):
    """Of a box (ab + bc + ca) / 2; a notch in it casts no smaller one."""
    sides = (0.2, 0.1, 0.05)
    pair = joined(box(sides), moved(box((0.02, 0.02, 0.02)), [0.0, 0.0, 0.0]))
    fits = load_rig(write(CENTRED)).fits(pair)
    shadow = (0.2 * 0.1 + 0.1 * 0.05 + 0.05 * 0.2) / 2
    for fit, pixel in zip(fits, (1 / FOCAL_PX, 1 / 1500), strict=True):
        side = pixel * fit.middle_m
        n = np.prod(fit.device.resolution)
        assert fit.share == pytest.approx(shadow / (side * side * n), rel=1e-6)


def moved(mesh: TriangleMesh, offset) -> TriangleMesh:
    return TriangleMesh(mesh.vertices + offset, mesh.faces)


def test_a_thin_plate_has_a_shadow_too():
    plate = TriangleMesh(
        np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    fit = make_rig().fits(plate)[0]
    assert fit.size.shadow_m2 == pytest.approx(0.005, rel=1e-6)


@pytest.mark.parametrize(("radius", "told"), [(0.04, True), (0.2, False)])
def test_an_object_that_leaves_the_image_empty_is_told_what_would_fill_it(radius, told):
    lines = optics_lines(make_rig(), sphere(radius))
    assert len(lines) == (2 if told else 0)
    if told:
        focal = optics.longest_sharp(22.0, PIXEL_M, 0.95, 1.05 + radius)
        assert f"a lens of {1e3 * focal:.3g} mm would show all of it" in lines[0]
        assert "the projector's image" in lines[1]


def test_a_field_far_smaller_than_the_object_is_refused_with_what_would_fit(write):
    """64 images at most, of 0.5888 x 0.4416 m each."""
    rig = load_rig(write(CENTRED))
    check_fields(rig.fits(sphere(1.98)))
    with pytest.raises(InfeasibleLimitsError) as caught:
        plan_rig(sphere(2.0), rig, max_projectors=3, target="surface", check=False)
    message = str(caught.value)
    assert "sees 589 x 442 mm at the standoff of 1000 mm" in message
    assert f"takes {7 * 10} images, 64 at most" in message
    half = math.asin(2.0 / 3.0)
    lens = 768 * PIXEL_M / math.tan(half)
    assert f"a lens of {1e3 * lens:.3g} mm would show all of it" in message
    away = 2.0 / math.sin(math.atan(768 / FOCAL_PX)) - 2.0
    assert f"or this one from {1e3 * away:.0f} mm on" in message


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_long_part_takes_a_row_of_images_however_it_lies(turn):
    """12 m of a bar 0.2 m wide: by its ball it would be 21 x 28 images."""
    bar = box((12.0, 0.2, 0.1))
    c, s = math.cos(turn), math.sin(turn)
    rolled = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    fits = make_rig().fits(TriangleMesh(bar.vertices @ rolled.T, bar.faces))
    assert [fit.images for fit in fits] == [math.ceil(12 / 0.5888), 21]
    check_fields(fits)


@pytest.mark.parametrize(
    ("device", "figure", "message"),
    [
        ("camera", "principal_point_px = [15000.0, 767.5]", r"76\.\d degrees off"),
        ("projector", "vertical_offset_percent = 3000.0", r"82\.\d degrees off"),
    ],
)
def test_a_principal_point_where_no_lens_has_one_is_refused(
    write, device, figure, message
):
    text = f'base = "default"\n[{device}]\n{figure}\n'
    with pytest.raises(RigError, match=rf"\[{device}\].*{message}.*at most 75"):
        load_rig(write(text))


def test_a_standoff_that_is_not_sharp_says_how_to_set_the_lens(write):
    text = 'base = "default"\n[camera.focus]\ndistance_mm = 400.0\n'
    stop, focus = optics.least_stop(12e-3, PIXEL_M, 0.95, 1.05)
    with pytest.raises(InfeasibleLimitsError) as caught:
        load_rig(write(text))
    assert (
        f"a lens of 12 mm focused at {1e3 * focus:.0f} mm and stopped to "
        f"f/{stop:.2g} or more for 950 to 1050 mm" in str(caught.value)
    )
    fixed = text.replace("400.0", f"{1e3 * focus}") + f"f_number = {1.001 * stop}\n"
    low, high = load_rig(write(fixed)).camera_device().range_m
    assert low <= 0.95
    assert high >= 1.05


def test_bodies_that_do_not_touch_are_told_with_their_shares():
    small, large = box((0.01, 0.01, 0.01)), box((0.03, 0.03, 0.03))
    apart = joined(small, moved(large, [0.1, 0.0, 0.0]))
    assert [re.sub(" +", " ", line) for line in size_lines(apart)] == [
        " 2 bodies that share no vertex, of 90.0 %, 10.0 % of the area: all are "
        "planned for"
    ]
    assert list(size_lines(large)) == []


def lens(monkeypatch, capsys, *words):
    monkeypatch.setattr(sys, "argv", ["plan", "lens", *map(str, words)])
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    with pytest.raises(SystemExit) as caught:
        main()
    return caught.value.code or 0, *capsys.readouterr()


def test_plan_lens_tells_of_a_rig_that_is_not_sharp(
    write, tmp_path, monkeypatch, capsys
):
    rig = write('base = "default"\n[camera.focus]\ndistance_mm = 400.0\n')
    part = tmp_path / "part.obj"
    ball = sphere(BALL)
    lines = [f"v {x} {y} {z}" for x, y, z in 1e3 * ball.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in ball.faces + 1]
    part.write_text("\n".join(lines))
    code, out, err = lens(monkeypatch, capsys, "--mesh", part, "--rig", rig)
    assert (code, err) == (0, "")
    assert "CAMERA: Basler" in out
    assert "NOT all of it sharp" in out
    code, out, err = lens(monkeypatch, capsys, part, "--rig", rig, "--json")
    fit = json.loads(out)["camera"]
    assert not fit["is_sharp"]
    assert fit["lens"]["focal_m"] == pytest.approx(0.012)
    assert fit["lens"]["distance_m"] == pytest.approx(2 * 0.95 * 1.18 / 2.13, rel=1e-4)
    assert lens(monkeypatch, capsys, "--rig", rig)[0] == 2
    assert lens(monkeypatch, capsys, part, part)[0] == 2


def test_a_focus_that_hides_the_panels_squares_is_found():
    """Sharp on coarse pixels edges lie off; a little out of focus they don't."""
    depths = (0.9, 1.1)
    device = PinholeModel(np.diag([1000.0, 1000.0, 1.0]), (1000, 800), (0.3, 3.0))
    sharp = DrawnEdges(in_focus_m=1e-4, camera_px=0.0, focus_m=1.0, aperture_m=0.02)
    off, where = farthest_off(sharp, device, depths)
    # 0.1 of a pixel's blur: all of the first harmonic but a fifth.
    stairs = np.exp(-0.02 * np.pi**2) / (np.sqrt(2.0) * np.pi)
    assert (off, where) == pytest.approx((stairs, 1.0), rel=1e-3)
    better = straighter_focus(sharp, device, depths, 0.02)
    assert farthest_off(better, device, depths)[0] <= 0.02
    assert not depths[0] <= better.focus_m <= depths[1]
    fixed = replace(sharp, focus_m=None)
    assert straighter_focus(fixed, device, depths, 0.02) is None
