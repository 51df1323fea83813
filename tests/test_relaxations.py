"""Limits that can't be met: exit 4 with the guilty ones, or 1 and the least help."""

import re
from dataclasses import replace

import numpy as np
import pytest

from geometry.primitives import grid, sphere
from planning.lighting import LIT
from planning.plan import PlannedProjector, RigPlan
from planning.projectors import plan_projectors
from planning.rig import load_rig
from planning.scene import Scene
from planning.shortfall import shortfalls


def plan(small_job, tmp_path, monkeypatch, mesh, rig, words=()):
    """Plan a mesh, given in millimetres, with more tables in the rig file."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in 1e3 * mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path = tmp_path / "shape.obj"
    path.write_text("\n".join(lines) + "\n")
    monkeypatch.setattr(small_job, "RIG", small_job.RIG + rig)
    target = ["--target", "surface", "--unit", "mm"]
    return small_job.run(path, tmp_path, [*target, *words])


PLATE = grid(0.1, 0.1, divisions=(4, 4))


@pytest.mark.parametrize(
    ("rig", "guilty"),
    [
        # A floor over the whole shell, of radius 1 m and half the plate's diagonal.
        ("[workspace]\nfloor_mm = 1300.0\n", "workspace.floor_mm = 1300 lies above"),
        # The projector is sharp elsewhere.
        ("[placement]\nstandoff_mm = 300.0\n", "placement.standoff_mm = 300"),
    ],
)
def test_limits_that_exclude_each_other_are_named(
    small_job, tmp_path, monkeypatch, rig, guilty
):
    if "placement" in rig:
        monkeypatch.setattr(
            small_job, "RIG", small_job.RIG.replace("[placement]\n", rig)
        )
        rig = ""
    ended = plan(small_job, tmp_path, monkeypatch, PLATE, rig)
    assert ended.code == 4
    assert guilty in ended.message
    assert ended.plan is None


def test_a_workspace_behind_the_plate_lights_nothing_whatever_gives_way(
    small_job, tmp_path, monkeypatch
):
    rig = '[workspace]\nshape = "cone"\naxis = [0, 0, -1]\nhalf_angle_deg = 40.0\n'
    ended = plan(small_job, tmp_path, monkeypatch, PLATE, rig)
    assert ended.code == 4
    assert "first limit that fails is projector_incidence 100 %" in ended.message
    assert "no single limit of the projector" in ended.message
    assert ended.plan is None


def test_incidence_that_no_pose_of_the_cone_keeps_is_named_with_its_least_value(
    small_job, tmp_path, monkeypatch
):
    """A cone of 20 degrees about +x meets a plate that faces +z at 70 or more."""
    rig = '[workspace]\nshape = "cone"\naxis = [1, 0, 0]\nhalf_angle_deg = 20.0\n'
    words = ["--light", "parallel"]
    ended = plan(small_job, tmp_path, monkeypatch, PLATE, rig, words)
    assert ended.code == 4
    asked = re.search(r"max_incidence_deg = (\d+) \(now 60\)", ended.message)
    assert 70 <= int(asked[1]) <= 74
    assert "no single limit" not in ended.message


def test_a_ball_wider_than_the_beam_is_served_by_several():
    """A beam of 60 mm on a ball of 100: caps of asin 0.6 = 36.9 degrees, not 60."""
    ball = sphere(0.1, subdivisions=3)
    rig = load_rig("default", light="parallel")
    required = rig.requirements(
        ball.centre,
        ball.radius,
        max_projectors=14,
        target="surface",
        tau_m=0.004,
        dominant_coverage=0.5,
    )
    n = len(ball.faces)
    scene = Scene(ball, np.full(n, -1), np.zeros((n, 3)), required, 0, 2)
    beam = replace(rig.projector_device(), beam_radius=0.06)
    eye, radii = np.eye(4), np.array([0.1, 0.3])
    template = PlannedProjector("", "parallel", eye, eye, beam, radii)
    stage = plan_projectors(scene, template, 200, ring_offset=(0.0, 0.0), rounds=1)
    share = (stage.stages == LIT).mean(axis=0)
    # A cap holds a tenth: four are too few for half of the ball, were they apart.
    assert share == pytest.approx(0.5 * (1 - np.sqrt(1 - 0.36)), abs=0.03)
    assert 5 <= len(stage.projectors) <= 7
    assert stage.certificate["status"] != "infeasible"


@pytest.mark.usefixtures("few_samples")
def test_a_plate_wider_than_the_beam_misses_its_rim_and_says_what_beam_would_do(
    small_job, tmp_path, monkeypatch
):
    """Beams are aimed at the middle: of a plate of 200 mm a disc and a bit is lit.

    A beam of radius r at incidence i lights an ellipse r by r/cos i. For 0.9 of the
    plate a radius between the circle's of that area (107 mm) and the plate's half
    diagonal (141 mm) is needed, less where light is aslant (at 60 degrees half of it).
    """
    rig = "[parallel_projector]\nbeam_radius_mm = 30.0\n"
    words = ["--light", "parallel", "--coverage", "0.01"]
    plate = grid(0.2, 0.2, divisions=(6, 6))
    ended = plan(small_job, tmp_path, monkeypatch, plate, rig, words)
    assert ended.code == 1
    assert ended.plan is not None
    written = RigPlan.load(tmp_path / "plan" / "plan.json")
    (missed,) = (
        line
        for line in shortfalls(written.document, written.requirements)
        if "--min-reachable" in line
    )
    assert re.search(r"[\d.]+ cm² of 400\.0 cm² can't be reached", missed)
    radius = re.search(r"a beam of (\d+) mm about its axis would reach", missed)
    assert 50 <= int(radius[1]) <= 141
    (entry,) = [
        e for e in ended.plan["coverage"]["relaxations"] if "beam" in e["change"]
    ]
    assert entry["reachable_share"] >= 0.9
