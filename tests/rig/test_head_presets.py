"""Presets of real heads: what is stated of them agrees with their own geometry."""

import pytest
from support.head_figures import HEADS, figures_of, sigma_at

from planning import load_rig
from planning.rig.rig_tables import RigTable
from planning.rig.toml.preset_files import preset_names
from planning.rig.toml.preset_lists import list_presets
from planning.rig.toml.rig_files import read_rig

# What their makers don't state, or where it wasn't found.
NO_BASELINE = {"gom-atos-core-300", "shining3d-einscan-sp"}
NO_POINTS = {"mech-eye-pro-s"}
NO_NOISE = set(HEADS) - {"photoneo-phoxi-l", "zivid-2plus-m60"}


@pytest.fixture(scope="module", params=list(HEADS))
def head(request):
    rig = load_rig(request.param)
    return request.param, rig, figures_of(rig)


def test_heads_of_at_least_four_makers_are_all_the_presets_with_a_head():
    assert len(set(HEADS.values())) >= 4
    found = {name for name in preset_names() if read_rig(name).head is not None}
    assert found == set(HEADS)
    roles = {each.name: each.devices for each in list_presets()}
    assert roles["zivid-2plus-m60"]["head"] == "Zivid 2+ M60"


def test_the_devices_image_the_stated_volume_sharply_and_in_pairs(head):
    _, rig, found = head
    assert found.depths[0] < found.depths[1] < found.depths[2]
    assert min(found.covered) >= 0.9
    assert not [note for note in rig.notes() if "measuring volume" in note]
    assert rig.standoff_m == pytest.approx(found.depths[1])
    assert found.depths[0] <= rig.standoff_m - rig.standoff_play_m
    assert rig.standoff_m + rig.standoff_play_m <= found.depths[2]


def test_the_baseline_is_the_stated_one(head):
    name, rig, found = head
    stated = rig.head.figures.baseline_m
    if stated is None:
        assert name in NO_BASELINE
        pytest.skip("its maker states no baseline, or none was found")
    assert name not in NO_BASELINE
    assert found.baseline == pytest.approx(stated, rel=5e-3)


def test_points_are_as_far_apart_as_stated(head):
    name, rig, found = head
    stated = rig.head.figures.point_distance_m
    if stated is None:
        assert name in NO_POINTS
        pytest.skip("its maker states no distance of points, or none was found")
    assert name not in NO_POINTS
    assert 0.8 < found.point_distance / stated < 1.25


def test_the_noise_is_of_the_stated_size(head):
    """Within three: makers filter and average, the formulas know one sequence."""
    name, rig, _ = head
    figures = rig.head.figures
    if figures.noise_m is None:
        assert name in NO_NOISE
        pytest.skip("its maker states no noise of a point, or none was found")
    assert name not in NO_NOISE
    assert 1.0 / 3.0 < sigma_at(rig, figures.at_m) / figures.noise_m < 3.0


def test_its_limits_let_it_measure_its_volume(head):
    """Of coded pixels: the angle and the noise that it has anywhere on its axis."""
    _, rig, found = head
    limits = rig.table.limits
    assert max(found.sigma) <= 1e-3 * limits.max_sigma_mm
    assert found.sigma[0] < found.sigma[1] < found.sigma[2]


@pytest.mark.parametrize("name", list(HEADS))
def test_every_figure_of_a_head_names_its_source(name):
    table: RigTable = read_rig(name)
    assert table.head is not None
    written = set(table.head.figures())
    assert set(table.head.sources) == written
    for source in table.head.sources.values():
        assert source.startswith(("read: ", "assumed: "))
    # Of each something was read.
    sources = [*table.head.sources.values(), *table.camera.sources.values()]
    assert any(source.startswith("read: ") or "read in" in source for source in sources)
