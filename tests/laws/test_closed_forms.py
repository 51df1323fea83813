"""How many projectors, and where they shine from, on shapes with a closed form.

The projector stage as the pipeline runs it: target and limits (`prepared`), the fewest
of the candidates, the bound over every pose, then the poses of widest margin. Counts
stand well away from where the closed form changes: the lattice of candidates is coarse.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.factories import make_requirements
from support.plain_shapes import box, cylinder, grid, joined

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.model.progress import Stopwatch
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import plan_projectors
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.all_poses import Effort
from planning.report.partial_plan import PlanRequest
from planning.rig.rig import load_rig
from planning.rig.wishes import Wishes
from planning.scene.lighting import assigned_projectors, lit_margins, lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.steps.prepare import prepared
from solvers.poses.cone import max_margin_direction

EFFORT = Effort(finest=5, maps=5, budget=3e8, shadows=0.0, most_samples=2000)
SHADOWS = replace(EFFORT, finest=6, maps=6, shadows=np.inf)


@dataclass(frozen=True, eq=False)
class Planned:
    """A scene, its projector stage, and both counts of the proof."""

    scene: object
    stage: object
    count: int
    least: int


def planned(
    mesh,
    share,
    *,
    light="parallel",
    incidence=60.0,
    tangent=0.0,
    steep=None,
    effort=EFFORT,
):
    """Plan the projectors of a surface; shadows count where the effort says so."""
    rig = load_rig("default", light)
    wishes = Wishes(
        max_projectors=20,
        target="surface",
        dominant_coverage=share,
        # Closed forms are of the total, wherever it lies.
        region_coverage=0.0,
    )
    order = PlanRequest(mesh, rig, wishes)
    ready = prepared(order, Stopwatch())
    required = ready.scene.requirements
    limits = replace(
        required.projector,
        max_incidence=float(np.radians(incidence)),
        min_tangent_angle=float(np.radians(tangent)),
    )
    scene = replace(
        ready.scene,
        requirements=replace(required, projector=limits),
        steep=np.zeros((len(mesh.faces), 3)) if steep is None else steep,
    )
    stage = plan_projectors(scene, ready.templates, 300, rounds=1)
    stage = prove_fewest(scene, stage, ready.templates, effort)
    proof = stage.certificate
    return Planned(scene, stage, proof.needed.count, proof.continuous.lower_bound)


def away(projector, centre=(0.0, 0.0, 0.0)):
    """The direction in which a projector stands, or from which its light comes."""
    pose = projector.world_from_device
    if projector.light == "parallel":
        return -pose[:3, 2]
    outwards = pose[:3, 3] - np.array(centre)
    return outwards / np.linalg.norm(outwards)


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip(np.dot(a, b), -1.0, 1.0)))


@pytest.mark.parametrize(("incidence", "count"), [(60.0, 2), (52.0, 3), (43.0, 6)])
def test_box_takes_two_diagonals_three_edges_or_six_normals(incidence, count):
    """Light that meets k faces of a cube at the same angle has cos = 1/sqrt(k).

    Three faces at 54.7 degrees, from a corner: two opposite corners serve all six
    faces. Two at 45, from an edge: three edges. Below that one face each. No direction
    meets both of two opposite faces.
    """
    found = planned(box((0.1, 0.1, 0.1), divisions=4), 1.0, incidence=incidence)
    assert (found.count, found.least) == (count, count)


@pytest.mark.long
@pytest.mark.parametrize(("share", "count"), [(0.66, 3)])
def test_sphere_takes_as_many_as_its_caps_hold(share, count):
    """A cap of theta holds (1 - cos theta)/2 of a sphere: a quarter at 60 degrees.

    Two caps of 60 degrees are apart, and three, 120 degrees from each other on a great
    circle, touch: k of them light k/4, k up to 3.
    """
    found = planned(sphere(0.08, subdivisions=4), share)
    assert (found.count, found.least) == (count, count)


@pytest.mark.long
def test_sphere_in_diverging_light_takes_caps_that_are_smaller():
    """At distance D the cap is theta - asin(R/D sin theta), largest at the far end."""
    ball = sphere(0.08, subdivisions=4)
    theta = np.radians(60.0)

    def share_at(distance):
        cap = theta - np.arcsin(0.08 / distance * np.sin(theta))
        return 0.5 * (1.0 - np.cos(cap))

    required = make_requirements(
        ball, load_rig("default", light="diverging"), max_projectors=9
    )
    near, far = required.workspace.projector_radius_m
    at_most, at_least = share_at(far), share_at(0.5 * (near + far))
    assert at_most < 0.25
    one = planned(ball, at_least - 0.01, light="diverging")
    assert (one.count, one.least) == (1, 1)
    two = planned(ball, at_most + 0.15, light="diverging")
    assert (two.count, two.least) == (2, 2)


def around_axis(mesh):
    """T1 of a cylinder about z."""
    t1 = np.cross([0.0, 0.0, 1.0], mesh.face_normals)
    return t1 / np.linalg.norm(t1, axis=1)[:, None]


@pytest.mark.parametrize(
    ("share", "tangent", "count"),
    [
        (0.73, 0.0, 3),
        (0.26, 55.0, 1),
        (0.33, 55.0, 2),
    ],
)
def test_cylinder_takes_thirds_and_less_where_the_tangent_limit_binds(
    share, tangent, count
):
    """Light at elevation e over the side meets azimuth phi at cos = cos phi cos e.

    Level light reaches phi = 60 degrees on both sides, a third. T1 runs around, and
    |T1.L| = sin phi cos e <= cos tau. Both limits are met the farthest where they meet:
    tan phi = cos tau / cos theta; tau = 55 leaves phi = 48.9 degrees, 0.272 of the
    side, with e = 40.5.
    """
    tube = cylinder(0.05, 0.12, around=192, along=4, capped=False)
    steep = around_axis(tube) if tangent else None
    found = planned(tube, share, tangent=tangent, steep=steep)
    assert (found.count, found.least) == (count, count)


def facing_plates(gap):
    plate = grid(0.1, 0.1, divisions=(6, 6))
    other = TriangleMesh(plate.vertices + [0, 0, gap], plate.faces[:, ::-1])
    return joined(plate, other)


@pytest.mark.parametrize(("share", "count"), [(0.95, 4)])
@pytest.mark.long
def test_facing_plates_are_lit_through_the_gap_from_four_sides(share, count):
    """Plates of side w = 100 mm, g = 40 mm apart, lit on their inner sides.

    Light at incidence i and azimuth a to an edge is shadowed where a step of
    s = g tan i towards it stays under the other plate, (w - s cos a)(w - s sin a). At
    60 degrees s = 69.3 mm: at most 1 - (1 - 0.490)^2 = 0.740 of one plate (a = 45
    degrees), none of the other. From two opposite sides the shadows are apart, as
    s > w/2: all of one plate. So 1, 2, 3, 4 projectors light at most 0.37, 0.74,
    0.87, 1 of both.
    """
    found = planned(facing_plates(0.04), share, effort=SHADOWS)
    assert (found.count, found.least) == (count, count)


def served_normals(found, projectors):
    """Normals of the rows that each projector serves."""
    rows = found.stage.candidates.samples
    lit = lit_stages(found.scene, projectors, rows) == LIT
    server = assigned_projectors(lit, lit_margins(found.scene, projectors, rows))
    return [rows.samples.normals[server == p] for p in range(len(projectors))]


def roof(half_angle):
    """Two square plates whose normals lean by an angle to +x and -x from z."""
    plate = grid(0.06, 0.06, divisions=(3, 3))
    sides = []
    for sign in (1.0, -1.0):
        c, s = np.cos(half_angle), sign * np.sin(half_angle)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        hinge = turn @ np.array([sign * 0.03, 0.0, 0.0])
        sides.append(TriangleMesh(plate.vertices @ turn.T + hinge, plate.faces))
    return joined(*sides)


TILTED = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])


@pytest.mark.parametrize("case", ["patch", "roof", "box"])
def test_widest_margins_are_those_of_closed_form_and_of_the_cone_program(case):
    """One patch: its normal, margin 60. A roof of +-35 degrees: the bisector, 25.

    A cube from two corners: the diagonal, 60 - acos(1/sqrt 3) = 5.26. Nothing is in
    shadow, so the cone program over the served normals has the same optimum.
    """
    flat = grid(0.1, 0.1, divisions=(4, 4))
    mesh, axes, margin = {
        "patch": (
            TriangleMesh(flat.vertices @ TILTED.T, flat.faces),
            [TILTED[:, 2]],
            60.0,
        ),
        "roof": (roof(np.radians(35.0)), [np.array([0.0, 0.0, 1.0])], 25.0),
        "box": (
            box((0.1, 0.1, 0.1), divisions=4),
            [
                np.array([a, b, c]) / np.sqrt(3.0)
                for a in (1, -1)
                for b in (1, -1)
                for c in (1, -1)
            ],
            60.0 - np.degrees(np.arccos(1.0 / np.sqrt(3.0))),
        ),
    }[case]
    found = planned(mesh, 1.0)
    assert found.count == found.least == (2 if case == "box" else 1)
    projectors = widen_margins(found.scene, found.stage)
    least = (
        lit_margins(found.scene, projectors, found.stage.candidates.samples)
        .max(axis=1)
        .min()
    )
    assert np.degrees(least) == pytest.approx(margin, abs=0.1)
    served = served_normals(found, projectors)
    for projector, normals in zip(projectors, served, strict=True):
        off = min(degrees_between(away(projector), axis) for axis in axes)
        assert off < 0.1
        best = max_margin_direction(np.unique(normals, axis=0))
        assert degrees_between(-best.light, away(projector)) < 0.1


def test_in_diverging_light_a_patch_is_lit_from_far_over_its_middle():
    """Its corner, r away, is met at atan(r / D): least at the far end of the shell."""
    found = planned(grid(0.1, 0.1, divisions=(4, 4)), 1.0, light="diverging")
    assert (found.count, found.least) == (1, 1)
    (projector,) = widen_margins(found.scene, found.stage)
    far = found.scene.safe_workspace.projector_radius_m[1]
    rows = found.stage.candidates.samples
    reach = np.hypot(*rows.samples.points[:, :2].T).max()
    assert degrees_between(away(projector), [0, 0, 1]) < 0.1
    margin = lit_margins(found.scene, [projector], rows).min()
    assert margin == pytest.approx(np.radians(60.0) - np.arctan(reach / far), abs=2e-3)
