"""What the panel's pixels show, and what becomes of it under a lens."""

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import norm
from support.reconstruction_rigs import ringed

from planning.model.errors import RigError
from planning.rig.rig import load_rig
from planning.verify.reconstruction.calibration import calibrate_projector
from planning.verify.reconstruction.patterns.panel import PanelCanvas, frame_levels
from planning.verify.reconstruction.patterns.response import Response
from planning.verify.reconstruction.patterns.ring_patterns import Frame
from planning.verify.reconstruction.render.panel_light import PanelLight

WHITE = Frame(0, "white")
MEASURED = Response((0.02, 0.05, 0.2, 0.6, 0.9))


@pytest.fixture(scope="module")
def projector(rigs):
    source = rigs.diverging("P1", rigs.direction(0.0, 0.0), 0.08, 5e-3)
    source["resolution"] = [160, 100]
    source["K"] = [[224.0, 0.0, 79.5], [0.0, 224.0, 49.5], [0.0, 0.0, 1.0]]
    ball = rigs.bumpy_sphere(0.05, subdivisions=2)
    plan = rigs.plan_of(ball, [source], [rigs.camera("C1", rigs.direction(0, 20.0))])
    return calibrate_projector(plan.projectors[0])


@pytest.mark.parametrize("response", [Response(), Response(2.2), MEASURED])
def test_levels_send_the_share_that_is_meant(response):
    """A stated response is undone to half a level of what it sends."""
    shares = np.linspace(0.0, 1.0, 1001)
    steps = np.diff(response.light).max()
    sent = response.light[response.levels(shares)]
    assert np.abs(sent - shares).max() <= 0.5 * steps + 1e-12
    assert response.light[[0, -1]].tolist() == [0.0, 1.0]
    assert response.is_linear == (response.law == 1.0)


@pytest.mark.parametrize("response", [Response(), Response(2.2)])
def test_frames_and_inverses_make_up_white_in_light(projector, response):
    pattern = projector.pattern
    canvas = PanelCanvas.of(projector, pattern, {})
    white = response.light[frame_levels(canvas, pattern, WHITE, response)]
    for bit in range(pattern.n_bits):
        both = sum(
            response.light[frame_levels(canvas, pattern, frame, response)]
            for frame in (Frame(0, "bit", bit), Frame(0, "bit", bit, inverse=True))
        )
        assert np.abs(both - white).max() <= np.diff(response.light).max()


def test_an_edge_covers_a_pixel_as_wide_as_its_share_says(projector):
    """Integrated along a row, every ring edge lies where its radius is."""
    pattern = ringed(projector, np.array([0.1, 0.14, 0.2, 0.3])).pattern
    canvas = PanelCanvas.of(projector, pattern, {})
    light = frame_levels(canvas, pattern, Frame(0, "bit", 0), Response()) / 255.0
    column = np.column_stack([np.full(100, 79.5), np.arange(100.0)])
    row = int(np.hypot(*projector.ring_plane(column).T).argmin())
    pixels = np.column_stack([np.arange(160.0), np.full(160, row)])
    rho = np.hypot(*projector.ring_plane(pixels).T)
    # Bright between the first and the third edge; the row crosses them once a side.
    meant = np.interp([0.1, 0.2], rho[80:], np.arange(80.0, 160.0))
    inside = np.flatnonzero(light[row, 80:] > 0.0) + 80
    drawn = light[row, 80:].sum()
    assert len(inside) > 5
    assert drawn == pytest.approx(meant[1] - meant[0], abs=0.02)


def test_light_of_square_pixels_under_a_gaussian(rigs):
    """Against numerical integration over one pixel, and where all are alike."""
    rng = np.random.default_rng(3)
    places = rng.uniform(5.0, 9.0, (4, 2))
    light = PanelLight(places, np.array([[0.4, 0.4], [0.8, 0.5], [1.1, 1.1], [2, 3.0]]))
    window = light.window
    images = np.zeros((window.width * window.height, 2), dtype=np.float32)
    u, v = 7 - window.left, 6 - window.top
    images[v * window.width + u, 0] = 1.0
    images[:, 1] = 0.7
    found = light.gathered(images, window)
    for k, (place, spread) in enumerate(zip(places, light.spread, strict=True)):
        wanted, _ = dblquad(
            lambda y, x, p=place, s=spread: (
                norm.pdf(x, p[0], s[0]) * norm.pdf(y, p[1], s[1])
            ),
            6.5, 7.5, 5.5, 6.5,
        )  # fmt: skip
        assert found[k, 0] == pytest.approx(wanted, rel=0.02, abs=1e-4)
        assert found[k, 1] == pytest.approx(0.7, rel=1e-5)


def test_a_rig_file_states_the_response(tmp_path):
    rig = 'base = "default"\n[projector]\nresponse = {}\n'
    path = tmp_path / "rig.toml"
    path.write_text(rig.format("[0.2, 11.0, 54.1, 240.0]"))
    figures = load_rig(path).to_document()["projector"]["figures"]
    assert figures["response"] == [0.2, 11.0, 54.1, 240.0]
    for wrong in ("[0.0, 2.0, 1.0]", "[1.0]"):
        path.write_text(rig.format(wrong))
        with pytest.raises(RigError, match="never falling"):
            load_rig(path)
