"""Rigs: the default against its makers' tables, and every fault with its line."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel
from support.written import requirements_of

from geometry.devices import ParallelModel, PinholeModel
from planning.experiments.paper_devices import (
    CAMERA_PX,
    FITTING,
    PIXEL_PITCH_M,
    PRINTED,
    PROJECTOR_PX,
    STANDOFF_M,
)
from planning.experiments.setups import FACE_RADII_M
from planning.model.errors import InfeasibleLimitsError, InputError, RigError
from planning.rig.rig import load_rig
from planning.rig.rig_tables import RigTable
from planning.rig.toml.laying import lay_over
from planning.rig.toml.preset_files import preset_names
from planning.rig.toml.preset_lists import list_presets
from planning.rig.toml.rig_files import read_rig
from planning.rig.wishes import Wishes

MINIMAL = """
name = "bench"
[camera]
name = "own camera"
resolution_px = [640, 480]
focal_px = [800.0, 810.0]
principal_point_px = [320.0, 241.0]
distortion = [0.1, -0.2, 0.001, 0.0, 0.05]
range_mm = [300.0, 2000.0]
[projector]
name = "own projector"
resolution_px = [1280, 800]
throw_ratio = 1.5
vertical_offset_percent = 100.0
range_mm = [500.0, 3000.0]
"""


@pytest.fixture
def write(tmp_path):
    def writer(text):
        path = tmp_path / "rig.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return writer


def require(rig, radius=0.1, **wishes):
    tau_m = wishes.pop("tau_m", 0.003)
    asked = Wishes(**({"max_projectors": 3} | wishes))
    return rig.requirements([0.0, 0.0, 0.0], radius, asked, tau_m=tau_m)


# ---- the default rig


def test_default_projector_reproduces_the_makers_table():
    """PT-LB386 manual p. 32, 4:3: diagonal, nearest distance and height of the lens.

    Distances are printed to 0.1 m and start 25 mm before the optical centre.
    """
    device = load_rig("default").projector_device()
    rows = [
        (0.762, 0.9, 0.065),
        (2.54, 3.0, 0.218),
        (5.08, 6.1, 0.435),
        (7.62, 9.1, 0.653),
    ]
    edges = np.array([[-0.5, -0.5], [1023.5, 767.5]])
    for diagonal, printed, height in rows:
        distance = 1.1974 * diagonal - 0.025
        assert distance == pytest.approx(printed, abs=0.05)
        rays = device.rays(edges)
        (left, top), (right, bottom) = (
            rays[:, :2] / rays[:, 2:] * (distance + 0.025)
        ).tolist()
        assert math.hypot(right - left, bottom - top) == pytest.approx(diagonal)
        assert -bottom == pytest.approx(height, abs=1e-3)


def test_default_camera_and_what_is_sharp():
    camera = load_rig("default").camera_device()
    assert camera.resolution == (2048, 1536)
    assert camera.camera_matrix[0, 0] == pytest.approx(12.0 / 3.45e-3)
    assert camera.camera_matrix[:2, 2].tolist() == [1023.5, 767.5]
    assert camera.range_m[0] < 0.89 < 1.64 < camera.range_m[1]


@pytest.mark.parametrize("size_mm", [40.0, 200.0, 600.0])
@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_default_plans_objects_from_40_to_600_mm(size_mm, light):
    """The visible half of a ball of that size is sharp, and its width fits."""
    rig = load_rig("default", light=light)
    radius = size_mm * 5e-4
    centre = rig.standoff_m + rig.standoff_play_m + radius
    rim = math.sqrt(centre**2 - radius**2)
    camera, projector = rig.camera_device(), rig.projector_device()
    for device in (camera, projector):
        assert device.range_m[0] <= rig.standoff_m - rig.standoff_play_m
    assert camera.range_m[1] >= rim
    assert projector.range_m[1] >= (rim if light == "diverging" else centre)
    if light == "parallel":
        assert projector.half_panel.min() >= radius
    else:
        fy = projector.camera_matrix[1, 1]
        assert projector.resolution[1] / fy * centre >= 2 * radius


@pytest.mark.parametrize("name", preset_names())
def test_every_figure_of_every_preset_names_its_source(name):
    table = read_rig(name)
    for device in (table.camera, table.projector, table.parallel_projector):
        if device is None:
            continue
        assert set(device.sources) == set(device.figures())
        for source in device.sources.values():
            assert source.startswith(("read: ", "assumed: "))


def test_presets_are_listed_with_sources():
    (default,) = [preset for preset in list_presets() if preset.name == "default"]
    roles = {"projector", "parallel_projector", "camera", "calibration"}
    assert set(default.devices) == roles
    figures = {(f.device, f.key): f for f in default.figures}
    assert figures["camera", "focus.f_number"].value == 11.0
    assert figures["projector", "throw_ratio"].source.startswith("read: Panasonic")
    beam = [f for f in default.figures if f.device == "parallel_projector"]
    assert beam
    assert all(f.source.startswith("assumed") for f in beam)


@pytest.mark.parametrize(
    ("name", "optics"), [("lee-krim-2014", PRINTED), ("lee-krim-2014-fits", FITTING)]
)
def test_the_papers_rig_is_that_of_its_experiments(name, optics):
    rig = load_rig(name)
    camera, beam = rig.camera_device(), rig.projector_device()
    assert isinstance(beam, ParallelModel)
    assert (camera.resolution, beam.resolution) == (CAMERA_PX, PROJECTOR_PX)
    assert camera.camera_matrix[0, 0] == optics.focal_px
    assert tuple(camera.camera_matrix[:2, 2]) == optics.centre_px
    assert (rig.standoff_m, beam.pixel_pitch_m) == (STANDOFF_M, PIXEL_PITCH_M)
    assert rig.ring_gap_m == FACE_RADII_M[0]


def test_default_counts_and_contract_values():
    rig = load_rig()
    assert rig.name == "default"
    placement = rig.table.placement
    assert (
        min(placement.n_candidate_projectors, placement.n_reference_projectors) >= 600
    )
    assert min(placement.n_candidate_cameras, placement.n_reference_cameras) >= 400
    assert (rig.standoff_m, rig.standoff_play_m) == (1.0, 0.05)
    assert rig.ring_gap_m is None
    assert rig.ring_offset == pytest.approx(np.deg2rad(8.0))
    asked = require(rig)
    degrees = np.rad2deg(
        [
            asked.projector.max_incidence,
            asked.projector.min_tangent_angle,
            asked.camera.max_incidence,
        ]
    )
    assert degrees.tolist() == pytest.approx([60.0, 40.0, 70.0])
    t, c = asked.triangulation, asked.check
    assert (t.min_conditioning, t.noise_px, t.min_ring_pitch_px) == (0.1, 0.1, 6.0)
    assert t.max_sigma_m == pytest.approx(3e-4)
    assert t.ring_sigma_m is None
    assert asked.camera.max_sample_distance_m is None
    assert (c.max_rms_m, c.max_p95_m, c.max_bias_m) == pytest.approx((1e-4, 3e-4, 3e-5))
    assert (c.min_completeness, c.max_predicted_missing, c.tau_m) == (0.9, 0.01, 0.003)
    assert (asked.coverage, asked.dominant_coverage, asked.min_reachable) == (
        0.95,
        0.9,
        0.9,
    )


def test_written_limits_equal_the_schema_defaults(write):
    """The preset spells its limits out; a file without them gets the same."""
    preset, bare = read_rig("default"), read_rig(write(MINIMAL))
    for section in (
        "limits",
        "requirements",
        "check",
        "placement",
        "rings",
        "workspace",
    ):
        assert getattr(preset, section) == getattr(bare, section), section


def test_nothing_calibrated_can_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        load_rig().camera_device().camera_matrix[0, 0] = 1.0


# ---- light, rings


def test_light_chooses_the_projector():
    assert isinstance(load_rig(light="diverging").projector_device(), PinholeModel)
    beam = load_rig(light="parallel").projector_device()
    assert isinstance(beam, ParallelModel)
    assert beam.half_panel.tolist() == pytest.approx([0.4096, 0.3072])


def test_unknown_light_is_refused():
    with pytest.raises(RigError, match="'laser' must be"):
        load_rig(light="laser")  # pyright: ignore[reportArgumentType]


def test_light_without_its_projector_is_refused(write):
    with pytest.raises(
        RigError, match=r"light 'parallel' needs a table \[parallel_proj"
    ):
        load_rig(write(MINIMAL), light="parallel")


def test_outer_ring_holds_every_panel_corner():
    rig = load_rig(light="parallel")
    half = rig.projector_device().half_panel
    shift = rig.ring_offset
    assert shift == pytest.approx(np.tan(np.deg2rad(8.0)))
    around = np.linspace(0, 2 * np.pi, 3601)
    corner = half - shift * np.column_stack([np.cos(around), np.sin(around)])
    assert np.hypot(*corner.T).max() == pytest.approx(rig.outer_ring_radius(), rel=1e-6)


def test_beam_radius_bounds_the_outer_ring(write):
    text = 'base = "default"\nlight = "parallel"\n[parallel_projector]\n'
    rig = load_rig(write(text + "beam_radius_mm = 200.0\n"))
    assert rig.outer_ring_radius() == pytest.approx(0.2 + rig.ring_offset)


def test_centre_ray_meets_the_image_centre():
    rig = load_rig()
    ray = rig.projector_device().middle_ray
    assert np.linalg.norm(ray) == pytest.approx(1.0)
    assert ray[1] < -0.2, "the lens is below the image, so the centre is above the axis"
    assert rig.projector_device().project(ray).tolist() == pytest.approx([511.5, 383.5])
    assert load_rig(light="parallel").projector_device().middle_ray[2] == 1.0


# ---- rig files


def test_minimal_file(write):
    rig = load_rig(write(MINIMAL))
    camera, projector = rig.camera_device(), rig.projector_device()
    assert camera.camera_matrix.tolist() == [[800, 0, 320], [0, 810, 241], [0, 0, 1]]
    assert camera.distortion == (0.1, -0.2, 0.001, 0.0, 0.05)
    assert camera.range_m == (0.3, 2.0)
    assert projector.camera_matrix[0, 0] == pytest.approx(1.5 * 1280)
    assert projector.camera_matrix[1, 2] == pytest.approx(799.5)
    sources = rig.to_document()["camera"]["sources"]
    assert sources["focal_px"] == "stated in the rig file, without a source"


def test_integers_are_numbers_too(write):
    text = MINIMAL.replace("throw_ratio = 1.5", "throw_ratio = 2")
    assert load_rig(write(text)).projector_device().focal_px == pytest.approx(2560)


def test_file_laid_over_a_preset_drops_the_sources_it_replaces(write):
    rig = load_rig(
        write(
            'base = "default"\nname = "mine"\n'
            "[camera]\nfocal_px = [3500.0, 3501.0]\n"
            "[camera.focus]\nf_number = 8.0\n"
            "[placement]\nstandoff_mm = 1100.0\n"
        )
    )
    assert rig.name == "mine"
    assert rig.standoff_m == pytest.approx(1.1)
    camera = rig.to_document()["camera"]
    assert camera["K"][0][0] == 3500.0
    assert "focal_mm" not in camera["figures"]
    assert camera["figures"]["focus"]["distance_mm"] == 1150.0
    unsaid = {k for k, s in camera["sources"].items() if s.startswith("stated")}
    assert unsaid == {"focal_px", "focus.f_number"}
    assert camera["range_m"][0] > load_rig().camera_device().range_m[0]


def test_a_preset_that_is_laid_over_another_is_a_base_too(write):
    rig = load_rig(write('base = "lee-krim-2014-fits"\n[camera]\nrange_mm = [1, 2000]'))
    fits = load_rig("lee-krim-2014-fits")
    assert rig.camera_device().range_m == (0.001, 2.0)
    assert np.array_equal(
        rig.camera_device().camera_matrix, fits.camera_device().camera_matrix
    )
    assert rig.light == "parallel"


def test_named_device_replaces_the_presets_device_whole(write):
    table = read_rig(
        write(
            'base = "default"\n[camera]\nname = "other"\nresolution_px = [100, 80]\n'
            "focal_px = [90.0, 90.0]\nrange_mm = [100.0, 3000.0]\n"
        )
    )
    assert table.camera.focus is None
    assert table.camera.sources == {}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "range_mm = [300.0, 2000.0]",
            "range_mm = [300.0, nan]",
            r"camera\.range_mm\[1\]",
        ),
        ("throw_ratio = 1.5", "throw_ratio = nan", r"projector\.throw_ratio` = nan"),
        ("throw_ratio = 1.5", "throw_ratio = inf", r"projector\.throw_ratio` = inf"),
        ("throw_ratio = 1.5", 'throw_ratio = "1.5"', "should be a valid number"),
        ("throw_ratio = 1.5", "throw_ratio = true", "should be a valid number"),
        ("throw_ratio = 1.5", "throw_ratio = -1.5", "should be greater than 0"),
        ("throw_ratio = 1.5", "throw = 1.5", "did you mean throw_ratio"),
        ("throw_ratio = 1.5\n", "", "exactly one of focal_px.*has none"),
        (
            "throw_ratio = 1.5",
            "throw_ratio = 1.5\nfocal_mm = 9.0",
            "focal_mm and throw",
        ),
        ("throw_ratio = 1.5\n", "focal_mm = 9.0\n", "needs pixel_um"),
        ("[1280, 800]", "[1280, 800, 3]", "resolution_px"),
        ("[1280, 800]", "[100000, 4001]", "must be 400000000 pixels at most"),
        ("[1280, 800]", "[1280.5, 800]", r"resolution_px\[0\]"),
        ("[300.0, 2000.0]", "[2000.0, 300.0]", "must rise"),
        ("range_mm = [300.0, 2000.0]\n", "", "needs range_mm or"),
        ('name = "own camera"\n', "", r"`camera\.name` is missing"),
        (
            "distortion = [0.1",
            "sources = {f_number = 'x'}\ndistortion = [0.1",
            "names `f_n",
        ),
        (
            "vertical_offset_percent = 100.0",
            "vertical_offset_percent = 1.0\nprincipal_point_px = [1.0, 2.0]",
            "keep one",
        ),
        ('name = "bench"', 'name = "bench"\nlight = "laser"', "light` = 'laser'"),
        ('name = "bench"', 'name = "bench"\n[limits]\nmax_sigma = 1.0', "max_sigma_mm"),
    ],
)
def test_one_fault_gives_one_line(write, old, new, message):
    assert old in MINIMAL
    with pytest.raises(RigError, match=message) as caught:
        load_rig(write(MINIMAL.replace(old, new)))
    text = str(caught.value)
    assert "\n" not in text
    assert "rig.toml: " in text


@pytest.mark.parametrize(
    ("table", "key", "home"),
    [
        ("[limits]", "coverage = 0.9", r"belongs in \[requirements\]$"),
        (
            "[limits]",
            "f_number = 2.0",
            r"in \[camera\.focus\] or \[proj",
        ),
        ("[limits]", 'along = "x"', r"belongs in \[workspace\.mounting\]$"),
        ("[limits]", 'light = "parallel"', "belongs above the first table$"),
        ("[rings]", "max_sigma_mm = 1.0", r"belongs in \[limits\]$"),
    ],
)
def test_a_key_in_the_wrong_table_is_told_where_it_belongs(write, table, key, home):
    with pytest.raises(RigError, match=home):
        load_rig(write(f"{MINIMAL}\n{table}\n{key}\n"))


def test_a_share_may_be_written_in_percent(write):
    text = MINIMAL + '[requirements]\ncoverage = "92.5 %"\nmin_reachable = "80%"\n'
    shares = read_rig(write(text)).requirements
    assert (shares.coverage, shares.min_reachable) == (0.925, 0.8)
    for wrong in ('"x%"', '"120 %"', '"0.9"', "90"):
        with pytest.raises(RigError, match=r"requirements\.coverage"):
            read_rig(write(text.replace('"92.5 %"', wrong)))


def test_every_fault_is_reported_at_once(write):
    text = MINIMAL.replace("1.5", "nan").replace("800.0", "-800.0") + "[lense]\n"
    with pytest.raises(RigError) as caught:
        load_rig(write(text))
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    for path in ("camera.focal_px[0]", "projector.throw_ratio", "lense"):
        assert sum(path in line for line in lines) == 1


@pytest.mark.parametrize("name", ["dfault", "kinect"])
def test_unknown_preset(name):
    with pytest.raises(RigError, match=r"no such preset.*default"):
        load_rig(name)


def test_files_that_cannot_be_read(tmp_path, write):
    with pytest.raises(RigError, match="no such file"):
        load_rig(tmp_path / "none.toml")
    with pytest.raises(RigError, match="no such file"):
        load_rig("none.toml")
    with pytest.raises(RigError, match="can't be read"):
        load_rig(tmp_path)
    with pytest.raises(RigError, match=r"not TOML.*line 1"):
        load_rig(write("name = = 3"))
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(RigError, match="not TOML"):
        load_rig(binary)
    with pytest.raises(RigError, match="must name a preset"):
        load_rig(write('base = "other"'))
    with pytest.raises(RigError, match="camera"):
        load_rig(write('base = "default"\ncamera = 3'))
    with pytest.raises(RigError, match="sources"):
        load_rig(write('base = "default"\n[camera]\nsources = 3'))
    with pytest.raises(RigError, match="focus"):
        load_rig(write('base = "default"\n[camera]\nfocus = 3'))


# ---- contradictions


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[placement]\nstandoff_play_mm = 1000.0", "must be less than"),
        ("[placement]\nclearance_mm = 13.0", "between housings, and no device has one"),
        ("[placement]\nn_reference_cameras = 10", "greater than or equal to 400"),
        ("[camera]\nrange_mm = [2000.0, 3000.0]", "no distance is sharp"),
        ("[camera.focus]\ndistance_mm = 5.0", "beyond the focal length"),
        (
            "[limits]\nmin_tangent_angle_deg = 30.0",
            "never binds.*= 30; raise it above 30",
        ),
        ("[limits]\nmin_angle_deg = 60.0\nmax_angle_deg = 50.0", "must be less than"),
        ("[limits]\nprojector_max_incidence_deg = 90.0", "less than 90"),
        ("[workspace]\nshape = 'cone'", "needs axis and half_angle_deg"),
        ("[workspace]\naxis = [0.0, 0.0, 1.0]", "need shape = 'cone'"),
        (
            "[workspace]\nshape = 'cone'\nhalf_angle_deg = 9.0\naxis = [0.0, 0.0, 0.0]",
            "must not be zero",
        ),
        ("[rings]\ntilt_deg = 50.0", "less than 45"),
    ],
)
def test_contradictory_rigs_are_refused(write, text, message):
    with pytest.raises(RigError, match=message):
        load_rig(write(f'base = "default"\n{text}\n'))


@pytest.mark.parametrize(("standoff", "role"), [(700, "projector"), (1700, "camera")])
def test_a_standoff_out_of_focus_serves_nothing(write, standoff, role):
    text = f'base = "default"\n[placement]\nstandoff_mm = {standoff}.0\n'
    expected = f"standoff_mm = {standoff} is outside.*{role}"
    with pytest.raises(InfeasibleLimitsError, match=expected) as caught:
        load_rig(write(text))
    assert caught.value.exit_code == 4


def test_endless_depth_of_field_needs_an_end(write):
    text = MINIMAL.replace(
        "range_mm = [300.0, 2000.0]\n",
        "pixel_um = 5.0\n"
        "focus = {distance_mm = 1000.0, f_number = 16.0, blur_px = 2.0}\n",
    )
    with pytest.raises(RigError, match="no far end; write range_mm"):
        load_rig(write(text))


def test_a_ring_axis_may_not_turn_past_the_image(write):
    text = MINIMAL.replace("throw_ratio = 1.5", "throw_ratio = 0.3")
    with pytest.raises(RigError, match="tilt_deg = 44"):
        load_rig(write(text + "[rings]\ntilt_deg = 44.0\n"))


def test_default_tangent_limit_that_does_not_bind_is_a_note(write):
    rig = load_rig(
        write('base = "default"\n[limits]\nprojector_max_incidence_deg = 45.0\n')
    )
    assert any("doesn't bind" in note for note in rig.notes())
    assert load_rig().notes() == ()


def test_steep_incidence_is_warned_of(write):
    rig = load_rig(
        write('base = "default"\n[limits]\nprojector_max_incidence_deg = 75.0\n')
    )
    assert any("errors triple" in note for note in rig.notes())


# ---- requirements


def test_wishes_override_the_rig():
    asked = require(
        load_rig(),
        max_cameras=5,
        target="surface",
        coverage=0.8,
        dominant_coverage=0.7,
        min_reachable=0.6,
        region_coverage=0.5,
        accuracy_mm=0.05,
        up="-y",
    )
    assert asked.region_coverage == 0.5
    assert (asked.max_projectors, asked.max_cameras) == (3, 5)
    assert (asked.coverage, asked.dominant_coverage, asked.min_reachable) == (
        0.8,
        0.7,
        0.6,
    )
    assert require(load_rig(), region_coverage=0.0).region_coverage == 0.0
    assert asked.target == "surface"
    assert asked.triangulation.max_sigma_m == pytest.approx(5e-5)
    assert asked.workspace.up == (0.0, -1.0, 0.0)


def test_shell_follows_the_object():
    rig = load_rig()
    asked = rig.requirements([1.0, 2.0, 3.0], 0.2, Wishes(max_projectors=1), tau_m=0.01)
    space = asked.workspace
    assert space.centre == (1.0, 2.0, 3.0)
    assert space.projector_radius_m == pytest.approx((1.15, 1.25))
    assert space.camera_radius_m == space.projector_radius_m
    assert space.half_angle == pytest.approx(math.pi)
    assert space.floor_m is None
    assert space.reference_ring_radius == rig.outer_ring_radius()
    assert space.n_reference_cameras == rig.table.placement.n_reference_cameras


def test_cone_floor_and_up(write):
    text = (
        'base = "default"\n[workspace]\nshape = "cone"\naxis = [0.0, -2.0, 0.0]\n'
        'half_angle_deg = 10.0\nfloor_mm = -300.0\nup = "-y"\n'
    )
    space = require(load_rig(write(text))).workspace
    assert space.axis == (0.0, -1.0, 0.0)
    assert space.half_angle == pytest.approx(np.deg2rad(10.0))
    assert space.up == (0.0, -1.0, 0.0)
    assert space.floor_m == pytest.approx(-0.3)
    assert require(load_rig(write(text)), up="x").workspace.up == (1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("axis", "half_angle", "floor", "feasible"),
    [
        ([0, 0, 1], 10.0, 1149.0, True),
        ([0, 0, 1], 10.0, 1151.0, False),
        ([1, 0, 0], 30.0, 574.0, True),  # 1150 cos(60 degrees) = 575
        ([1, 0, 0], 30.0, 576.0, False),
        ([0, 0, -1], 30.0, -910.0, True),  # 1050 cos(150 degrees) = -909
        ([0, 0, -1], 30.0, -908.0, False),
    ],
)
def test_floor_over_every_position_is_infeasible(
    write, axis, half_angle, floor, feasible
):
    rig = load_rig(
        write(
            f'base = "default"\n[workspace]\nshape = "cone"\naxis = {axis}\n'
            f"half_angle_deg = {half_angle}\nfloor_mm = {floor}\n"
        )
    )
    if feasible:
        assert require(rig).workspace.floor_m == pytest.approx(floor * 1e-3)
    else:
        with pytest.raises(InfeasibleLimitsError, match="lower the floor"):
            require(rig)


def test_limits_can_be_switched_off(write):
    rig = load_rig(
        write(
            'base = "default"\n[limits]\nmax_sigma_mm = "off"\n'
            'min_ring_pitch_px = "off"\nmax_sample_distance_mm = 0.5\n'
            "ring_sigma_mm = 0.02\nmin_angle_deg = 5.0\nmax_angle_deg = 60.0\n"
        )
    )
    asked = require(rig)
    assert asked.triangulation.max_sigma_m is None
    assert asked.triangulation.min_ring_pitch_px is None
    assert asked.camera.max_sample_distance_m == pytest.approx(5e-4)
    assert asked.triangulation.ring_sigma_m == pytest.approx(2e-5)
    # Angles are of coded pixels, whose rays the projector samples, too.
    assert asked.triangulation.min_angle is None
    assert asked.projector.max_sample_distance_m is None
    asked = require(rig, pattern="dense")
    assert asked.triangulation.min_angle == pytest.approx(np.deg2rad(5.0))
    assert asked.triangulation.max_angle == pytest.approx(np.deg2rad(60.0))
    assert asked.projector.max_sample_distance_m == pytest.approx(5e-4)
    assert asked.triangulation.ring_sigma_m is None
    assert asked.triangulation.min_conditioning == 0.0


@pytest.mark.parametrize(
    "wishes",
    [
        {"coverage": 0.0},
        {"coverage": 1.01},
        {"coverage": math.nan},
        {"dominant_coverage": -0.1},
        {"min_reachable": math.inf},
        {"region_coverage": -0.1},
        {"region_coverage": math.nan},
        {"accuracy_mm": 0.0},
        {"accuracy_mm": math.nan},
        {"accuracy_mm": 1e150},
        {"max_projectors": 0},
        {"max_cameras": 0},
        {"tau_m": math.nan},
        {"radius": 0.0},
        {"radius": math.nan},
        {"target": "all"},
        {"pattern": "stripes"},
        {"up": "w"},
    ],
)
def test_unusable_wishes_are_refused(wishes):
    name = next(iter(wishes)).replace("radius", "object_radius_m")
    with pytest.raises(InputError, match=name):
        require(load_rig(), **wishes)


@pytest.mark.parametrize("centre", [[0.0, 0.0], [0.0, math.nan, 0.0]])
def test_centre_must_be_a_point(centre):
    with pytest.raises(InputError, match="mesh_centre"):
        load_rig().requirements(centre, 0.1, Wishes(max_projectors=1), tau_m=0.01)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_documents_are_plain_and_say_what_was_used(light):
    rig = load_rig(light=light)
    document = json.loads(json.dumps(rig.to_document(), allow_nan=False))
    assert document == rig.to_document()
    projector, camera = document["projector"], document["camera"]
    device = rig.projector_device()
    assert (document["light"], projector["light"]) == (light, light)
    assert projector["resolution"] == list(device.resolution)
    assert projector["range_m"] == list(device.range_m)
    if light == "diverging":
        assert projector["K"] == device.camera_matrix.tolist()
        assert projector["pixel_pitch_m"] is None
    else:
        assert projector["K"] is None
        assert projector["pixel_pitch_m"] == pytest.approx(8e-4)
    assert camera["K"] == rig.camera_device().camera_matrix.tolist()
    assert camera["distortion"] == [0.0] * 5
    for figures in (projector, camera):
        assert all(
            s.startswith(("read", "assumed")) for s in figures["sources"].values()
        )

    asked = require(rig)
    again = requirements_of(asked.to_document())
    assert again == asked


# ---- docs/reference/rig-files.md


def test_example_of_the_documentation_loads(write):
    page = Path(__file__).parents[2] / "docs" / "reference" / "rig-files.md"
    text = page.read_text(encoding="utf-8")
    example = text.split("```toml\n")[1].split("```")[0]
    rig = load_rig(write(example))
    assert rig.name == "my bench"
    assert rig.camera_device().distortion[0] == -0.081
    assert require(rig).workspace.floor_m == -0.25
    assert (
        rig.to_document()["camera"]["sources"]["focal_px"] == "calibration of 3 March"
    )


def test_rig_files_of_the_documentation_load():
    folder = Path(__file__).parents[2] / "docs" / "use" / "rigs"
    paths = sorted(folder.glob("*.toml"))
    assert len(paths) >= 4
    for path in paths:
        assert require(load_rig(path)).max_projectors, path


def test_documentation_names_every_key():
    page = (
        Path(__file__).parents[2] / "docs" / "reference" / "rig-files.md"
    ).read_text("utf-8")
    tables = [RigTable]
    while tables:
        for name, field in tables.pop().model_fields.items():
            kinds = getattr(field.annotation, "__args__", (field.annotation,))
            inner = [
                k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)
            ]
            tables += inner
            assert inner or f"`{name}`" in page or name == "sources", name


def test_tables_are_laid_over_key_by_key():
    base = {
        "rings": {"tilt_deg": 8.0, "gap_mm": 3.0},
        "camera": {
            "name": "a",
            "throw_ratio": 1.5,
            "focus": {"f_number": 2.0, "blur_px": 1.0},
            "sources": {"throw_ratio": "read", "focus.f_number": "read", "focus": "x"},
        },
    }
    before = json.dumps(base)
    merged = lay_over(
        base,
        {
            "rings": {"gap_mm": 4.0},
            "camera": {"focal_mm": 9.0, "focus": {"f_number": 4.0}},
        },
    )
    assert merged == {
        "rings": {"tilt_deg": 8.0, "gap_mm": 4.0},
        "camera": {
            "name": "a",
            "focal_mm": 9.0,
            "focus": {"f_number": 4.0, "blur_px": 1.0},
            "sources": {"focus": "x"},
        },
    }
    assert json.dumps(base) == before
