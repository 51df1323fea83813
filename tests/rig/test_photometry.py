"""What a rig file says of light, and what is refused of it."""

import pytest

from planning.cli.devices.rigs_command import show_rig_command
from planning.model.errors import RigError
from planning.rig.devices.rig_devices import light_budget
from planning.rig.rig import load_rig

TABLE = """
base = "default"
[photometry]
lumens = 2000.0
albedo = 0.5
sensor = "imx250"
"""


@pytest.fixture
def budget(tmp_path):
    def read(text):
        (tmp_path / "rig.toml").write_text(text)
        rig = load_rig(tmp_path / "rig.toml")
        table = rig.table.projector
        return light_budget(rig.table, table, rig.camera_device())

    return read


def test_a_sensor_fills_in_what_is_not_written(budget):
    light = budget(TABLE)
    assert (light.full_well_e, light.read_noise_e) == (10_700.0, 2.5)
    assert budget(TABLE + "read_noise_e = 9.0").read_noise_e == 9.0
    assert light.albedo == (0.5, 0.5)
    # One refresh of the projector is what camera.exposure_ms comes nearest to.
    assert light.max_exposure_s == pytest.approx(1.0 / 60.0)
    assert light.f_number == 11.0
    assert budget(TABLE + "gain_db = 6.0206").gain == pytest.approx(2.0, rel=1e-5)


def test_a_rig_that_says_nothing_of_light_has_none(budget):
    assert budget('base = "default"') is None


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (TABLE.replace("imx250", "imx999"), "must be one of icx625, imx174, imx250"),
        (TABLE.replace('sensor = "imx250"', ""), "`photometry.full_well_e` is missing"),
        (TABLE.replace("0.5", "[0.6, 0.5]"), "must rise: darkest first"),
        (TABLE.replace("0.5", "1.2"), r"^[^\n]*photometry.albedo` = 1.2: [^\n]*$"),
        (TABLE.replace("0.5", "[0.5, 2.0]"), r"^[^\n]*photometry.albedo.1.`[^\n]*$"),
        (TABLE.replace("0.5", '"x"'), r"^[^\n]*photometry.albedo` = 'x'[^\n]*$"),
        (TABLE + "max_exposure_ms = 10.0", "shorter than a refresh"),
        ('base = "default"\n[limits]\nnoise_px = 0.0', "leaves no noise at all"),
    ],
)
def test_light_that_cannot_be_is_refused(budget, text, told):
    with pytest.raises(RigError, match=told):
        budget(text)


def test_noise_may_be_the_lights_alone(budget):
    budget(TABLE + "[limits]\nnoise_px = 0.0")


def test_presets_of_sensors_are_listed_with_their_sources(capsys):
    assert show_rig_command("imx250", sources=True) == 0
    text = capsys.readouterr().out
    assert "full_well_e = 10700.0" in text
    assert "SNRmax 40.3 dB" in text
