"""Limits that can't be met: exit 4 with the guilty ones, or 1 and the least help."""

import re
from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_requirements, make_scene
from support.plain_shapes import grid

from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedProjector
from planning.model.plan import RigPlan
from planning.projectors.projector_stage import plan_projectors
from planning.report.summary.shortfall import shortfalls
from planning.rig.rig import load_rig


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
    required = make_requirements(ball, rig, max_projectors=14, dominant_coverage=0.5)
    scene = make_scene(ball, required)
    beam = replace(rig.projector_device(), beam_radius=0.06)
    eye, radii = np.eye(4), np.array([0.1, 0.3])
    template = PlannedProjector("", "parallel", eye, eye, beam, radii)
    stage = plan_projectors(scene, (template,), 200, rounds=1)
    share = stage.candidates.lit.mean(axis=0)
    # A cap holds a tenth: four are too few for half of the ball, were they apart.
    assert share == pytest.approx(0.5 * (1 - np.sqrt(1 - 0.36)), abs=0.03)
    assert 5 <= len(stage.projectors) <= 7
    assert stage.certificate.status != "infeasible"


@pytest.mark.usefixtures("little_work")
@pytest.mark.long
def test_too_few_beams_for_a_plate_say_how_many_or_how_wide_they_must_be(
    small_job, tmp_path, monkeypatch
):
    """A plate of 200 mm, light at 20 degrees at most, beams of 50 mm, one allowed.

    A beam of radius r lights an ellipse of r by r / cos i, less what the edges cut off:
    nine tenths of the plate at r = 108.3 for i = 20 degrees, at 111.4 upright.
    """
    rig = (
        "[parallel_projector]\nbeam_radius_mm = 50.0\n"
        "[limits]\nprojector_max_incidence_deg = 20.0\n"
    )
    words = ["--light", "parallel", "--coverage", "0.01", "--max-projectors", "1"]
    plate = grid(0.2, 0.2, divisions=(6, 6))
    ended = plan(small_job, tmp_path, monkeypatch, plate, rig, words)
    assert ended.code == 1
    areas = ended.plan["coverage"]["target"]
    assert areas["reachable_by_projectors_m2"] == pytest.approx(0.04, rel=1e-3)
    disc = np.pi * 0.05**2
    assert 0.94 * disc <= areas["lit_m2"] <= 1.06 * disc / np.cos(np.radians(20.0))
    needed = ended.plan["certificates"]["projectors"]["needed"]
    # Discs that cover nine tenths of it: five have less area than that.
    assert needed["count"] >= 5
    left = 1e4 * (areas["reachable_by_projectors_m2"] - areas["lit_m2"])
    written = RigPlan.load(tmp_path / "plan" / "plan.json")
    missed = "".join(shortfalls(written))
    assert f"{left:.1f} cm² of 400.0 cm² are left" in missed
    assert f"--max-projectors {needed['count']} (" in missed
    radius = re.search(r"a beam of (\d+) mm about its axis", missed)
    assert 107 <= int(radius[1]) <= 112
    assert radius[0] == needed["wider_field"]
