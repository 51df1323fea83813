"""Dense patterns: OpenCV's Gray code bit for bit, sinusoids, and what is written."""

import json

import numpy as np
import pytest
from PIL import Image
from support.dense_rigs import camera_at, dense_scanner, projector_at

from geometry.shapes.primitives import sphere
from planning.model.light.dense_code import DenseCode
from planning.verify.reconstruction.pattern_files import write_patterns
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern
from planning.verify.reconstruction.patterns.response import Response

SIZES = [(1024, 768), (1280, 800), (1920, 1080), (37, 21), (64, 1000), (2, 3)]


@pytest.mark.parametrize("size", SIZES)
def test_frames_are_those_of_opencv(size):
    cv2 = pytest.importorskip("cv2", reason="OpenCV isn't installed")
    if not hasattr(cv2, "structured_light"):
        pytest.skip("OpenCV has no structured_light")
    pattern = DensePattern(DenseCode(shifts=0), size)
    graycode = cv2.structured_light.GrayCodePattern.create(*size)
    _, theirs = graycode.generate()
    black, white = graycode.getImagesForShadowMasks(theirs[0].copy(), theirs[0].copy())
    ours = [pattern.levels(frame, Response()) for frame in pattern.frames]
    assert np.array_equal(ours, [*theirs, white, black])
    assert len(ours) == pattern.code.n_frames(size)


@pytest.mark.parametrize("size", SIZES[:4])
def test_bits_alone_tell_every_pixel(size):
    # As OpenCV decodes: from the highest bit, each exclusive or with the one before.
    pattern = DensePattern(DenseCode(shifts=0), size)
    for axis, along in enumerate(("column", "row")):
        number = np.zeros(size[axis], dtype=int)
        bright = np.zeros(size[axis], dtype=int)
        for frame in pattern.frames:
            if frame.kind == "bit" and frame.along == along and not frame.inverse:
                bright ^= pattern.shares(frame).astype(int)
                number = 2 * number + bright
        assert np.array_equal(number, np.arange(size[axis]))


def test_sinusoids_tell_a_pixel_within_two_stripes():
    pattern = DensePattern(DenseCode(shifts=5, period_px=32), (100, 70))
    frames = [f for f in pattern.frames if f.kind == "phase" and f.along == "row"]
    light = np.array([pattern.shares(frame) for frame in frames])
    k = np.arange(5)[:, None]
    turn = np.angle((light * np.exp(2j * np.pi * k / 5)).sum(axis=0)) / (2 * np.pi)
    off = 32 * turn - np.arange(70)
    assert np.allclose(off, 32 * np.rint(off / 32), atol=1e-9)
    assert np.array_equal(pattern.stripe(1), np.arange(70) // 16)


def test_an_inverse_is_what_white_has_more_in_light():
    pattern = DensePattern(DenseCode(), (64, 48))
    response = Response(2.2)
    for frame, inverse in zip(pattern.frames[:8:2], pattern.frames[1:8:2], strict=True):
        light = [response.light[pattern.levels(f, response)] for f in (frame, inverse)]
        assert np.allclose(sum(light), 1.0)
    shift = next(f for f in pattern.frames if f.kind == "phase")
    shown = response.light[pattern.levels(shift, response)][0]
    assert np.abs(shown - pattern.shares(shift)).max() < 0.01


def test_files_hold_what_is_drawn(tmp_path):
    projector = projector_at("P1", (0.2, -0.6, 0.1), size=(64, 48))
    scanner = dense_scanner(
        sphere(0.05, subdivisions=1), [projector], [camera_at("C1", (0.0, -0.6, 0.0))]
    )
    place = write_patterns(scanner, tmp_path)
    manifest = json.loads((place / "sequence.json").read_text())
    (entry,) = manifest["projectors"]
    assert (entry["pattern"], entry["finest_px"], entry["bits"]) == ("dense", 8, [3, 3])
    assert "root" not in manifest
    assert "period_px" in manifest["phase"]
    frames = projector.dense.frames
    assert [one["kind"] for one in entry["frames"]] == [f.kind for f in frames]
    for one, frame in zip(entry["frames"], frames, strict=True):
        drawn = np.array(Image.open(place / one["png"]))
        assert np.array_equal(drawn, projector.dense.levels(frame, Response()))
