"""Angles as a designer reads them off the printout."""

import time
from dataclasses import replace

import numpy as np
import pytest
from support.plain_shapes import joined

from geometry.devices import PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from planning.model.devices.planned import PlannedCamera
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.report.summary.coverage_lines import coverage_lines
from planning.report.summary.devices.device_lines import aim_angles
from planning.report.summary.summary import body_words, summary
from planning.scene.workspace.candidates import aimed_poses

Z = np.array([0.0, 0.0, 1.0])
CAMERA = PinholeModel(
    np.array([[3000.0, 0, 999.5], [0, 3000.0, 749.5], [0, 0, 1]]),
    (2000, 1500),
    (0.5, 2),
)
SHIFTED = PinholeModel(
    np.array([[1500.0, 0, 511.5], [0, 1500.0, 880.0], [0, 0, 1]]), (1024, 768), (0.5, 2)
)


def looking(position, up=Z, roll=0.0, device=CAMERA):
    pose = aimed_poses(np.array([position]), np.zeros(3), up, device, roll=roll)[0]
    return PlannedCamera("C1", pose, device)


@pytest.mark.parametrize("device", [CAMERA, SHIFTED])
@pytest.mark.parametrize(
    ("position", "azimuth", "elevation"),
    [
        ([0.0, -1.0, 0.0], 90.0, 0.0),
        ([-1.0, 0.0, 0.0], 0.0, 0.0),
        ([1.0, 0.0, 1.0], 180.0, -45.0),
        ([-1.0, -1.0, -np.sqrt(2.0)], 45.0, 45.0),
    ],
)
def test_azimuth_and_elevation_are_those_of_the_middle_of_the_image(
    position, azimuth, elevation, device
):
    found = aim_angles(looking(position, device=device), Z)
    assert found[0] == pytest.approx(azimuth, abs=1e-6)
    assert found[1] == pytest.approx(elevation, abs=1e-6)
    assert found[2] == pytest.approx(0.0, abs=1e-6)


def test_azimuth_counts_from_the_axis_after_up():
    """With y up, from z towards x."""
    y = np.array([0.0, 1.0, 0.0])
    assert aim_angles(looking([0.0, 0.0, -1.0], y), y)[0] == pytest.approx(0.0)
    assert aim_angles(looking([-1.0, 0.0, 0.0], y), y)[0] == pytest.approx(90.0)


@pytest.mark.parametrize("degrees", [-120.0, -30.0, 45.0, 90.0])
def test_roll_turns_the_image_and_nothing_else(degrees):
    upright = aim_angles(looking([0.3, -1.0, 0.4]), Z)
    rolled = aim_angles(looking([0.3, -1.0, 0.4], roll=np.radians(degrees)), Z)
    assert rolled[:2] == pytest.approx(upright[:2])
    assert rolled[2] == pytest.approx(degrees)


def test_roll_is_clockwise_as_the_device_sees_it():
    """Rolled by +30 degrees, the world's up leans left by as much in the image."""
    camera = looking([0.0, -1.0, 0.0], roll=np.radians(30.0))
    up_in_image = camera.world_from_device[:3, :2].T @ Z
    assert up_in_image == pytest.approx([-np.sin(np.pi / 6), -np.cos(np.pi / 6)])


def test_a_device_that_looks_straight_up_has_roll_0():
    pose = look_at(np.array([0.0, 0.0, -1.0]), np.zeros(3), Z)
    azimuth, elevation, roll = aim_angles(PlannedCamera("C1", pose, CAMERA), Z)
    assert elevation == pytest.approx(90.0)
    assert (roll, np.isfinite(azimuth)) == (0.0, True)


def test_of_a_whole_surface_one_sampling_is_told(handmade):
    plan = handmade.build_plan()
    for target, columns in (("dominant", 2), ("surface", 1)):
        asked = replace(plan.requirements, target=target)
        told = RigPlan(plan.document.changed(requirements=asked), plan.surface)
        rows = [line for line in coverage_lines(told) if "reachable by pr" in line]
        assert rows[0].count("cm²") == columns
        titles = "\n".join(coverage_lines(told)).splitlines()[1].split("  ")
        assert sum("surface" in title for title in titles) == 1


@pytest.mark.parametrize(("share", "warned"), [(0.099, True), (0.101, False)])
def test_the_first_line_warns_of_an_object_lost_in_the_field(handmade, share, warned):
    plan = handmade.build_plan()
    across = 2.0 * plan.requirements.workspace.object_radius_m
    field_at_1_m = 2.0 * plan.cameras[0].device.half_rectangle(1.0).min()
    rig = plan.document.rig.changed(standoff_m=across / share / field_at_1_m)
    told = summary(RigPlan(plan.document.changed(rig=rig), plan.surface), [], [])
    first, *others = told.splitlines()
    words = f"WARNING: the object is {1e3 * across:.3g} mm across in a camera's field"
    assert (words in first) == warned
    assert not any(words in line for line in others)


def test_stages_are_timed_on_the_wall_and_on_the_processor():
    clock = Stopwatch()
    for _ in range(2):
        with clock.stage("nap", "sleeps"):
            time.sleep(0.06)
        with clock.stage("work", "works"):
            begin = time.process_time()
            while time.process_time() - begin < 0.06:
                pass
    assert clock.seconds["nap"] >= 0.12 > 0.06 > clock.processor["nap"]
    assert clock.processor["work"] >= 0.12


def test_a_stage_that_says_nothing_says_that_it_still_runs(monkeypatch):
    monkeypatch.setattr("planning.model.progress._SILENCE_S", 0.1)
    said = []
    clock = Stopwatch(said.append)
    with clock.stage("nap", "sleeps"):
        time.sleep(0.25)
    with clock.stage("talk", "talks"):
        for _ in range(5):
            time.sleep(0.05)
            clock.say("a line")
    time.sleep(0.15)
    assert said[0] == "sleeps"
    assert said[1:3] == ["  sleeps: 0 s so far"] * 2
    assert said[3:] == ["talks", *["a line"] * 5]


def test_the_summary_tells_of_bodies_that_do_not_touch(handmade, monkeypatch):
    plan = handmade.build_plan()
    alone = plan.surface.mesh
    apart = joined(alone, TriangleMesh(alone.vertices + 5.0, alone.faces))
    words = "2 bodies that share no vertex, of 50.0 %, 50.0 % of the area"
    assert (body_words(alone), body_words(apart)) == ("", words)
    assert "bodies" not in summary(plan, [], []).split("COVERAGE")[0]
    place = "planning.report.summary.summary.body_words"
    monkeypatch.setattr(place, lambda mesh: f"{len(mesh.faces)} bodies")
    told = summary(plan, [], []).splitlines()
    assert f"         {len(alone.faces)} bodies" in told
