"""Rigs that name devices of the catalogue, and cameras as OpenCV calibrated them."""

import json
import math
import tomllib
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner
from support.opencv_calibration import YAML

from planning.cli.main import commands
from planning.model.errors import RigError
from planning.rig.rig import load_rig
from planning.rig.toml.catalogue import catalogue, split_camera
from planning.rig.toml.opencv_file import read_intrinsics
from planning.rig.toml.preset_files import preset_names, preset_text
from planning.rig.toml.rig_files import read_rig
from planning.rig.toml.rig_schema import rig_schema

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "rig-files.md"
SHIPPED = Path(__file__).parents[2] / "planning/rig/presets/rig.schema.json"
FOCUS = "[camera.focus]\ndistance_mm = 1150\nf_number = 8\nblur_px = 2\n"
NAMED = 'base = "default"\nname = "mine"\n[camera]\ndevice = "{}"\n' + FOCUS
XML = """<?xml version="1.0"?>
<opencv_storage>
<image_width>2048</image_width><image_height>1536</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
<data>3512.4 0. 1017.2 0. 3511.9 771.8 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>4</rows><cols>1</cols>
<data>-0.081 0.112 3e-4 -2e-4</data></distortion_coefficients>
</opencv_storage>
"""


@pytest.fixture
def write(tmp_path):
    def written(text: str) -> Path:
        path = tmp_path / "rig.toml"
        path.write_text(text)
        return path

    return written


@pytest.mark.parametrize("kind", ["projectors", "cameras", "lenses"])
def test_every_figure_of_the_catalogue_names_its_source(kind):
    for name, entry in catalogue(kind).items():
        assert set(entry.sources) == set(entry.figures()), name
        for source in entry.sources.values():
            assert source.startswith(("read: ", "assumed: "))


def test_the_catalogue_holds_what_was_asked_for():
    lenses = {entry.focal_mm for entry in catalogue("lenses").values()}
    assert {6.0, 8.0, 12.0, 16.0, 25.0, 35.0, 50.0} <= lenses
    sizes = [math.prod(c.resolution_px) / 1e6 for c in catalogue("cameras").values()]
    assert min(sizes) < 1.4
    assert max(sizes) > 24.0
    throws = catalogue("projectors").values()
    assert sum(p.resolution_px[0] >= 3840 for p in throws) >= 2
    assert any(p.shift_percent for p in throws)
    assert len(preset_names()) >= 12


def test_a_camera_and_its_lens_make_the_device(write):
    camera = read_rig(write(NAMED.format("basler/acA2040-55um + falenses/12mm"))).camera
    assert (camera.focal_mm, camera.pixel_um) == (12.0, 3.45)
    assert camera.resolution_px == [2048, 1536]
    assert camera.range_mm == [100.0, 100000.0]
    assert "falenses.com" in camera.sources["focal_mm"]
    # Both ways to write it are the same device, and keys beside it replace figures.
    short = 'base = "default"\nname = "mine"\ncamera = "basler/acA2040-55um + 16mm"'
    assert read_rig(write(short)).camera.focal_mm == 16.0
    text = NAMED.format("basler/acA2040-55um + 16mm")
    text = text.replace("[camera.focus]", "focal_px = [4000.0, 4001.0]\n[camera.focus]")
    given = read_rig(write(text)).camera
    assert (given.focal_mm, given.focal_px) == (None, [4000.0, 4001.0])
    assert set(given.sources) < set(given.figures())


@pytest.mark.parametrize(
    ("device", "told"),
    [
        ("basler/acA2040-55u + 16mm", "did you mean basler/acA2040-55um"),
        ("basler/acA2040-55um", "a camera without a lens"),
        ("basler/acA2440-75um + falenses/16mm", "corners would be dark"),
        ("nikon/d3400 + falenses/16mm", "the lens has a mount C, the camera F"),
    ],
)
def test_devices_that_cannot_be_are_refused_beside_other_faults(write, device, told):
    text = NAMED.format(device) + "[limits]\nnoise_px = -1\n"
    with pytest.raises(RigError) as refused:
        read_rig(write(text))
    lines = str(refused.value).splitlines()
    assert len(lines) == 2
    assert told in lines[0]
    assert "limits.noise_px" in lines[1]


def test_a_lens_of_cs_mount_takes_c_lenses_and_not_the_other_way():
    assert split_camera("basler/daA2448-70um + falenses/16mm")[1].mount == "C"


def test_a_projector_shifts_as_far_as_its_lens_goes(write):
    text = 'base = "default"\nname = "mine"\n[projector]\ndevice = "benq/sx914"\n'
    text += "vertical_offset_percent = {}\n[placement]\nstandoff_mm = 1700\n"
    assert read_rig(write(text.format(125.0))).projector.vertical_offset_percent == 125
    with pytest.raises(RigError, match="goes from 115 to 125"):
        read_rig(write(text.format(0.0)))


def test_what_nobody_published_is_said(write):
    rig = load_rig("desktop-pico")
    (note, *_) = [note for note in rig.notes() if "projector" in note]
    assert "throw_ratio" in note
    assert "focus" not in note
    assert load_rig().notes() == ()
    text = 'base = "default"\nname = "mine"\ncamera = "basler/acA2040-55um + 16mm"'
    assert any("counts as sharp" in each for each in load_rig(write(text)).notes())


@pytest.mark.parametrize(
    ("name", "text", "k3"), [("c.yml", YAML, 0.5), ("c.xml", XML, 0)]
)
def test_opencv_files_override_the_lens(write, tmp_path, name, text, k3):
    (tmp_path / name).write_text(text)
    rig = f'base = "default"\nname = "mine"\n[camera]\ncalibration = "{name}"\n'
    table = read_rig(write(rig)).camera
    assert table.focal_mm is None
    model = load_rig(tmp_path / "rig.toml").camera_device()
    assert model.camera_matrix.tolist() == [
        [3512.4, 0.0, 1017.2],
        [0.0, 3511.9, 771.8],
        [0.0, 0.0, 1.0],
    ]
    assert model.distortion == (-0.081, 0.112, 3e-4, -2e-4, k3)
    assert name in table.sources["focal_px"]
    # Over a device of the catalogue too; the pixel's size stays.
    named = NAMED.format("basler/acA2040-55um").replace(
        "[camera.focus]", f'calibration = "{name}"\n[camera.focus]'
    )
    again = read_rig(write(named)).camera
    assert (again.focal_px, again.pixel_um) == ([3512.4, 3511.9], 3.45)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("cols: 5", "cols: 8", "5 values, rows x cols is 8"),
        ("data: [ -0.081", "data: [ 1, 1, 1, -0.081", "rows x cols"),
        ("0., 1.0172e+03", "0.5, 1.0172e+03", "without skew"),
        ("camera_matrix", "cam", "lacks camera_matrix"),
        ("image_width: 2048", "image_width: x", "lacks image_width"),
        ("-0.081", ".nan", "distortion_coefficients"),
        ("avg_rep", "distortion_model: equidistant\navg_rep", "'equidistant'"),
        ("2048", "1024", "resolution_px"),
    ],
)
def test_opencv_files_that_are_not_pinholes_are_refused(
    write, tmp_path, old, new, told
):
    (tmp_path / "c.yml").write_text(YAML.replace(old, new))
    rig = 'base = "default"\nname = "mine"\n[camera]\ncalibration = "c.yml"\n'
    with pytest.raises(RigError) as refused:
        read_rig(write(rig))
    assert told.split("\n")[0] in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_rational_lenses_are_refused_unless_they_are_plain(tmp_path):
    path = tmp_path / "c.yml"
    wide = YAML.replace("cols: 5", "cols: 8").replace("0.5 ]", "0.5, {} ]")
    path.write_text(wide.format("0., 0., 0."))
    assert read_intrinsics(path).distortion[4] == 0.5
    path.write_text(wide.format("0., 0.1, 0."))
    with pytest.raises(RigError, match="CALIB_RATIONAL_MODEL"):
        read_intrinsics(path)


def test_the_shipped_schema_is_that_of_the_tables_in_the_words_of_the_page():
    # Tables and page change it: write rig_schema(page) into that file.
    text = rig_schema(PAGE.read_text("utf-8"))
    assert SHIPPED.read_text("utf-8") == text
    result = CliRunner().invoke(commands, ["schema", "--of", "rig"])
    assert result.stdout == text
    schema = json.loads(text)
    for table in (schema, *schema["$defs"].values()):
        for key, entry in table.get("properties", {}).items():
            assert entry["description"], key
            assert "[mm]" in entry["description"] or not key.endswith("_mm")


def test_every_preset_validates_against_the_schema_and_faults_do_not():
    schema = jsonschema.Draft202012Validator(json.loads(SHIPPED.read_text("utf-8")))
    for name in preset_names():
        assert not list(schema.iter_errors(tomllib.loads(preset_text(name))))
    good = {"base": "default", "limits": {"max_sigma_mm": "off"}}
    assert schema.is_valid(good | {"requirements": {"coverage": "95 %"}})
    for bad in (
        {"limits": {"no_such": 1}},
        {"limits": {"max_sigma_mm": -1.0}},
        {"base": "defualt"},
        {"camera": {"focal_mm": "12"}},
    ):
        assert not schema.is_valid({"base": "default"} | bad)


def test_distortion_of_a_projector_is_told_in_pixels_and_not_planned_with():
    """At the corner, r = |(x, y)| of the ray: k1 r^3 f pixels outwards."""
    lens = {"name": "p", "resolution_px": [1000, 1000], "focal_px": [1000.0, 1000.0]}
    bent = lens | {"range_mm": [500.0, 2000.0], "distortion": [0.01, 0, 0, 0, 0]}
    rig = load_rig({"base": "default", "projector": bent})
    assert rig.projector_device().distortion == (0.0,) * 5
    (note,) = (note for note in rig.notes() if "distortion" in note)
    r = math.sqrt(2.0) * 499.5 / 1000.0
    assert f"up to {0.01 * r**3 * 1000.0:.1f} px" in note
    assert not any("distortion" in note for note in load_rig().notes())


@pytest.mark.parametrize("table", ["camera", "projector"])
@pytest.mark.parametrize(
    ("terms", "focal_px", "told"),
    [
        ([-0.35, 0, 0, 0, 0], 800.0, "44.3 degrees off the axis, 520 px .* 820 px"),
        ([-3.0, 0, 0, 0, 0], 2000.0, "18.4 degrees"),
        ([0, 0, 0.4, 0, 0], 800.0, "19.7 degrees"),
        ([-0.662, -0.197, 0, 0, 0.393], 954.0, "or nearly so"),
        # What calibrations come out as, of a wide and of narrow lenses.
        ([-0.35, 0.13, 1e-3, -5e-4, -0.018], 800.0, None),
        ([-0.28, 0.07, 2e-4, 1e-5, 0.0], 900.0, None),
        ([0.1, -0.25, 1e-3, 1e-3, 0.1], 1000.0, None),
        ([-0.35, 0, 0, 0, 0], 2400.0, None),
    ],
)
def test_a_lens_that_folds_inside_its_image_is_refused(table, terms, focal_px, told):
    lens = {"name": "l", "resolution_px": [1280, 1024], "focal_px": [focal_px] * 2}
    lens |= {"range_mm": [300.0, 3000.0], "distortion": terms}
    rig = {"base": "default", table: lens}
    if told is None:
        assert load_rig(rig).camera_device()
        return
    with pytest.raises(RigError, match=told) as refused:
        load_rig(rig)
    assert len(str(refused.value).splitlines()) == 1
    assert f"[{table}] distortion = [" in str(refused.value)
