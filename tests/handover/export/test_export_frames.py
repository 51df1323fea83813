"""`--frame`: other origins and axes change numbers, never what devices see."""

from dataclasses import replace

import numpy as np
import pytest
from support.exported_plans import FLOOR_M, exported_plan, points_before

from geometry.poses import inverse, transform
from planning.handover.export.export_frames import FrameError, frame_of
from planning.handover.export.exported_rig import ExportedRig
from planning.model.devices.bodies import Box


@pytest.fixture(scope="module")
def plan():
    return exported_plan()


@pytest.fixture(scope="module")
def workspace(plan):
    axes = ((1, 0, 0), (0, 0, 1), (0, -1, 0))
    wall = Box("wall", (0.0, 1.0, 0.2), (1.0, 0.5, 1e-4), axes)
    return replace(
        plan.requirements.workspace, centre=(0.1, 0.2, 0.3), mounting=(wall,)
    )


def test_a_shift_moves_the_origin_alone(workspace):
    move = frame_of("100,-20,3", workspace).frame_from_mesh
    np.testing.assert_array_equal(move[:3, :3], np.eye(3))
    np.testing.assert_allclose(move @ [0.1, -0.02, 0.003, 1.0], [0, 0, 0, 1])


@pytest.mark.parametrize(
    ("angles", "ahead", "above"),
    [
        # Up is +z: azimuth turns x towards y, tilt raises it, roll turns about it.
        ("90,0,0", [0, 1, 0], [0, 0, 1]),
        ("0,90,0", [0, 0, 1], [-1, 0, 0]),
        ("0,0,90", [1, 0, 0], [0, -1, 0]),
    ],
)
def test_angles_turn_the_axes_about_up(angles, ahead, above, workspace):
    axes = inverse(frame_of(f"0,0,0,{angles}", workspace).frame_from_mesh)
    np.testing.assert_allclose(axes[:3, 0], ahead, atol=1e-15)
    np.testing.assert_allclose(axes[:3, 2], above, atol=1e-15)


def test_without_angles_axes_stay_parallel_whatever_is_up(workspace):
    lying = replace(workspace, up=(0.0, -1.0, 0.0))
    move = frame_of("0,0,0,0,0,0", lying).frame_from_mesh
    np.testing.assert_allclose(move, np.eye(4), atol=1e-15)


def test_the_floor_and_mounting_planes_have_names(workspace):
    floor = inverse(frame_of("floor", workspace).frame_from_mesh)
    np.testing.assert_allclose(floor[:3, 3], [0.1, 0.2, 0.3 + FLOOR_M])
    wall = inverse(frame_of("wall", workspace).frame_from_mesh)
    np.testing.assert_allclose(wall[:3, 3], [0.1, 1.2, 0.5])
    np.testing.assert_allclose(wall[:3, 2], [0.0, -1.0, 0.0])


@pytest.mark.parametrize(
    "text", ["1,2", "1,2,x", "1,2,nan", "1,2,3,4,5", "1e12,0,0", "ceiling", ""]
)
def test_other_words_are_refused(text, workspace):
    with pytest.raises(FrameError, match=r"must be X,Y,Z in mm.*'wall'"):
        frame_of(text, workspace)


def test_a_plan_without_floor_says_so(workspace):
    with pytest.raises(FrameError, match="no floor"):
        frame_of("floor", replace(workspace, floor_m=None))


def test_a_frame_changes_no_pixel_and_no_distance(plan):
    space = plan.requirements.workspace
    plain = ExportedRig.of(plan, frame_of(None, space))
    turned = ExportedRig.of(plan, frame_of("9,-8,7,33,-21,140", space))
    move = turned.frame.frame_from_mesh
    for one, other in zip(plain.devices, turned.devices, strict=True):
        points = points_before(one, 50)
        pixels = other.project(transform(move, points))
        np.testing.assert_allclose(pixels, one.project(points), atol=1e-9)
        far = [
            np.linalg.norm(rig.datums - device.world_from_device[:3, 3], axis=1)
            for rig, device in ((plain, one), (turned, other))
        ]
        np.testing.assert_allclose(*far)
    assert plain.datums[:, 2] == pytest.approx(FLOOR_M)
    low, high = plan.surface.mesh.bounds
    corners = {tuple(np.round(point[:2], 9)) for point in plain.datums}
    assert corners == {
        tuple(np.round([x, y], 9)) for x in (low[0], high[0]) for y in (low[1], high[1])
    }
