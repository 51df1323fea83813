"""Poses inside the object are counted, and a workspace that holds no other refused."""

import numpy as np
import pytest
from support.factories import make_requirements, make_rig, make_scene

from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedCamera
from planning.report.advice.standing_inside import standing_inside

PLACES = [[0.0, 0, 0], [0.29, 0, 0], [0, -0.2, 0.1], [0.31, 0, 0], [0, 0, 1.3]]


@pytest.mark.parametrize(("chosen", "inside"), [(slice(None), 3), (slice(3, 5), 0)])
def test_poses_within_a_ball_stand_inside(chosen, inside):
    ball = sphere(0.3)
    rig = make_rig()
    scene = make_scene(ball, make_requirements(ball, rig, max_projectors=1))
    cameras = []
    for place in PLACES[chosen]:
        pose = np.eye(4)
        pose[:3, 3] = place
        cameras.append(PlannedCamera("", pose, rig.camera_device()))
    words = standing_inside(scene, cameras)
    assert words.startswith(f"; {inside} of 5 poses stand inside" if inside else "")
    assert bool(words) == bool(inside)


RIG = """
[placement]
standoff_mm = 150.0
standoff_play_mm = 50.0
n_candidate_projectors = 40
n_candidate_cameras = 40
n_reference_projectors = 600
n_reference_cameras = 400
[camera]
name = "near"
resolution_px = [2048, 1536]
focal_px = [3000.0, 3000.0]
range_mm = [50.0, 3000.0]
[projector]
name = "near"
resolution_px = [1024, 768]
throw_ratio = 1.5
range_mm = [50.0, 3000.0]
[workspace]
shape = "box"
min_mm = [-150.0, -150.0, -150.0]
max_mm = [150.0, 150.0, 150.0]
"""


@pytest.mark.long
def test_a_workspace_inside_the_object_is_refused_with_what_would_fit(
    small_job, tmp_path, monkeypatch, with_little_work
):
    ball = sphere(300.0)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in ball.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in ball.faces + 1]
    (tmp_path / "ball.obj").write_text("\n".join(lines))
    head = small_job.RIG.split("[placement]")[0]
    monkeypatch.setattr(small_job, "RIG", head + RIG)
    with with_little_work():
        ended = small_job.run(tmp_path / "ball.obj", tmp_path, ["--target", "surface"])
    assert ended.code == 4
    assert "poses stand inside the object or behind its surface" in ended.message
    assert "raise placement.standoff_mm" in ended.message
