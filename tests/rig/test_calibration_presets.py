"""What a rig file states of its calibration, by itself or by the name of a preset."""

import math

import pytest

from planning import load_rig
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.errors import RigError
from planning.rig.toml.preset_lists import list_calibrations

# Read in the report and the issue that the sources name, and in ISO 2768-1.
SIGMA0_PX, DOTS_PX = 0.178095, 7.4693 * 313.241
DOT_SHEET = (
    math.sqrt(3.0) * math.degrees(SIGMA0_PX / DOTS_PX),
    math.sqrt(3.0) * 0.170 * math.sqrt(1.0 - 0.991**2),
)
CHECKERBOARD = (math.sqrt(3.0) * math.degrees(0.167784 / 753.53041302), 0.1)
AS_MOUNTED = (20.0 / 60.0, 1.2)


@pytest.fixture
def stated(tmp_path):
    """The calibration of a rig file that is laid over `default`."""

    def table(text: str):
        path = tmp_path / "rig.toml"
        path.write_text(f'name = "r"\nbase = "default"\n{text}')
        return load_rig(path).table.calibration

    return table


@pytest.mark.parametrize(
    ("name", "figures"),
    [
        ("dot-sheet", DOT_SHEET),
        ("checkerboard", CHECKERBOARD),
        ("as-mounted", AS_MOUNTED),
    ],
)
def test_presets_follow_from_what_was_read(stated, name, figures):
    table = stated(f'[calibration]\nfrom = "{name}"')
    assert table.description.startswith(f"{name}: ")
    assert (table.angle_deg, table.position_mm) == pytest.approx(figures, rel=0.02)


def test_presets_say_where_every_figure_is_from():
    presets = {preset.name: preset for preset in list_calibrations()}
    assert set(presets) == {"dot-sheet", "checkerboard", "as-mounted"}
    for preset in presets.values():
        assert {figure.key for figure in preset.figures} == {"angle_deg", "position_mm"}
        for figure in preset.figures:
            assert figure.source.startswith(("derived: ", "assumed: "))


def test_default_counts_on_the_dot_sheet_and_its_plans_keep_it(stated):
    rig = load_rig("default")
    errors = rig.table.calibration.errors()
    assert errors == CalibrationErrors(math.radians(0.0075), 4e-5)
    assert rig.to_document()["calibration"]["sources"].keys() == {
        "angle_deg",
        "position_mm",
    }
    assert stated("").errors() == errors


def test_own_figures_replace_the_presets_and_their_sources(stated):
    table = stated("[calibration]\nangle_deg = 0.01")
    assert (table.angle_deg, table.position_mm) == (0.01, 0.04)
    assert table.sources.keys() == {"position_mm"}
    assert table.description == ""
    other = stated(
        '[calibration]\nfrom = "checkerboard"\nposition_mm = 0.2\n'
        '[calibration.sources]\nposition_mm = "3 March"'
    )
    assert (other.angle_deg, other.position_mm) == (0.022, 0.2)
    assert other.sources["position_mm"] == "3 March"
    assert other.sources["angle_deg"].startswith("derived")
    assert stated("[calibration]\nangle_deg = 0\nposition_mm = 0").errors() is None


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('from = "dots"', "from = 'dots' must be one of as-mounted, checkerboard"),
        ("from = 3", "from = 3 must be one of"),
        ('sources = { focal_percent = "x" }', "names `focal_percent`"),
    ],
)
def test_what_is_no_calibration_is_refused(stated, text, fault):
    with pytest.raises(RigError, match=fault):
        stated(f"[calibration]\n{text}")
