"""Mounts: where threads and flanges stand, and what a mount can be set to."""

import numpy as np
import pytest

from planning import load_rig
from planning.model.errors import RigError
from planning.model.mounts import Mount
from planning.scene.mounts import device_from_mount

LEVEL = "[camera.mount]\noffset_mm = [0, 30, -40]\naxis = [0, 2, 0]\n"


@pytest.fixture
def rig_of(tmp_path):
    def build(text):
        path = tmp_path / "rig.toml"
        path.write_text(f'base = "default"\n{text}', encoding="utf-8")
        return load_rig(path)

    return build


def test_a_rig_file_says_where_the_thread_is(rig_of):
    rig = rig_of(LEVEL)
    mounts = rig.mounts()
    assert mounts["projector_mount"] is None
    assert mounts["camera_mount"] == Mount((0.0, 0.03, -0.04), (0.0, 1.0, 0.0))
    figures = rig.to_document()["camera"]["figures"]
    assert figures["mount"] == {"offset_mm": [0, 30, -40], "axis": [0, 2, 0]}


@pytest.mark.parametrize(
    ("axis", "x", "z"),
    [
        # A thread below: out of the device is down, forward is forward.
        ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
        # A flange at the back: there is no forward across it, so it is the right.
        ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        ((0.0, 0.6, -0.8), (0.0, 0.8, 0.6), (0.0, 0.6, -0.8)),
    ],
)
def test_the_frame_of_a_mount_points_out_and_forward(axis, x, z):
    frame = device_from_mount(Mount((0.01, 0.02, 0.03), axis))
    assert frame[:3, 0] == pytest.approx(x)
    assert frame[:3, 2] == pytest.approx(z)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    assert frame[:3, 3] == pytest.approx([0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LEVEL.replace("axis = [0, 2, 0]\n", ""), "camera.mount.axis` is missing"),
        (LEVEL.replace("[0, 2, 0]", "[0, 0, 0]"), "must not be zero"),
        (LEVEL.replace("axis", "axes"), "did you mean axis"),
    ],
)
def test_bad_mounts_are_refused(rig_of, text, message):
    with pytest.raises(RigError, match=message):
        rig_of(text)
