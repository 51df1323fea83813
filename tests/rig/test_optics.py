"""Thin-lens optics against ray construction and makers' own tables."""

import math

import numpy as np
import pytest

from geometry.devices import PinholeModel
from planning.rig import optics
from planning.scene.lights import light_of

LENSES = [
    (0.012, 11.0, 3.45e-6, 1.15),
    (0.025, 4.0, 5e-6, 0.6),
    (0.019, 1.6, 6e-5, 1.2),
]


def blur_by_construction(focal, f_number, focus, distance):
    """Width on the sensor of the cone of light from a point, by similar triangles."""
    sensor = 1.0 / (1.0 / focal - 1.0 / focus)
    image = 1.0 / (1.0 / focal - 1.0 / distance)
    return focal / f_number * abs(image - sensor) / image


@pytest.mark.parametrize(("focal", "f_number", "blur", "focus"), LENSES)
def test_blur_is_the_circle_of_confusion_at_both_ends(focal, f_number, blur, focus):
    near, far = optics.depth_of_field(focal, f_number, blur, focus)
    assert focal < near < focus < far
    for end in (near, far):
        assert blur_by_construction(focal, f_number, focus, end) == pytest.approx(blur)
        assert optics.blur_diameter(focal, f_number, focus, end) == pytest.approx(blur)


def test_focused_at_the_hyperfocal_distance_everything_beyond_half_is_sharp():
    h = 0.012**2 / (11.0 * 3.45e-6) + 0.012
    near, far = optics.depth_of_field(0.012, 11.0, 3.45e-6, h)
    assert near == pytest.approx(h / 2)
    assert far == math.inf


def test_depth_grows_when_the_lens_is_stopped_down():
    open_near, open_far = optics.depth_of_field(0.012, 2.4, 3.45e-6, 1.15)
    near, far = optics.depth_of_field(0.012, 11.0, 3.45e-6, 1.15)
    assert near < open_near < open_far < far


def test_known_depth_of_a_16_mm_lens():
    """`evidence.md`: 16 mm, 3.45 um, 600 mm: 13 mm of depth at f/1.4, 76 mm at f/8."""
    for f_number, depth in ((1.4, 0.013), (8.0, 0.076)):
        near, far = optics.depth_of_field(0.016, f_number, 3.45e-6, 0.6)
        assert far - near == pytest.approx(depth, abs=5e-4)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan])
def test_arguments_must_be_positive(bad):
    for place in range(3):
        arguments = [0.012, 11.0, 3.45e-6]
        arguments[place] = bad
        with pytest.raises(ValueError, match="must be positive"):
            optics.depth_of_field(*arguments, 1.0)
    with pytest.raises(ValueError, match="beyond the focal length"):
        optics.depth_of_field(0.012, 11.0, 3.45e-6, min(bad, 0.012))


@pytest.mark.parametrize(
    ("offset", "row"),
    [(0.0, 383.5), (100.0, 767.5), (-100.0, -0.5), (50.0, 575.5)],
)
def test_offset_of_100_percent_puts_the_axis_on_the_lower_edge(offset, row):
    assert optics.principal_row(768, offset) == pytest.approx(row)


def test_offset_follows_the_definition_printed_by_optoma():
    """WUXGA: shifting up 720 pixels gives an offset of 720/600 x 100 % = 120 %."""
    assert optics.principal_row(1200, 120.0) == pytest.approx(599.5 + 720.0)


@pytest.mark.parametrize("cy", [383.5, 877.0, -300.0])
@pytest.mark.parametrize("turn", [0.0, 0.14, 0.4])
def test_cone_holds_the_image_from_every_turned_axis(cy, turn):
    k = np.array([[1500.0, 0, 511.5], [0, 1400.0, cy], [0, 0, 1]])
    u, v = np.meshgrid(np.linspace(-0.5, 1023.5, 41), np.linspace(-0.5, 767.5, 41))
    rays = np.column_stack(
        [(u.ravel() - 511.5) / 1500, (v.ravel() - cy) / 1400, np.ones(u.size)]
    )
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    around = np.linspace(0, 2 * np.pi, 721)
    axes = np.column_stack(
        [
            np.sin(turn) * np.cos(around),
            np.sin(turn) * np.sin(around),
            np.full_like(around, np.cos(turn)),
        ]
    )
    widest = np.arccos(np.clip(rays @ axes.T, -1, 1)).max()
    device = PinholeModel(k, (1024, 768), (0.5, 2.0))
    tangent = light_of(device).image_ring(turn)
    assert np.tan(widest) <= tangent + 1e-12
    assert np.tan(widest) == pytest.approx(tangent, rel=1e-4)


def test_cone_of_a_half_space_has_no_tangent():
    k = np.array([[100.0, 0, 511.5], [0, 100.0, 383.5], [0, 0, 1]])
    device = PinholeModel(k, (1024, 768), (0.5, 2.0))
    assert light_of(device).image_ring(0.2) == math.inf
