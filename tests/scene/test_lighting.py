"""Eq. (2) with margins, against plates and spheres where the answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from support.plain_shapes import grid

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.poses import look_at
from geometry.rays.visibility import Visibility
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits
from planning.scene import lighting
from planning.scene.limits.projector_limits import CAUSES, LIT
from planning.scene.occlusion import Occlusion
from planning.scene.samples import Target

UP = np.array([0.0, 0.0, 1.0])
LIMITS = ProjectorLimits(np.radians(60.0), np.radians(40.0))
WIDE = PinholeModel(
    np.array([[500.0, 0, 511.5], [0, 500.0, 383.5], [0, 0, 1]]), (1024, 768), (0.2, 3.0)
)


def diverging(position, aim=(0.0, 0.0, 0.0), device=WIDE, outer=2.0):
    pose = look_at(np.array(position, dtype=float), np.array(aim, dtype=float), UP)
    return PlannedProjector(
        "P1", "diverging", pose, pose, device, np.linspace(0.02, outer, 100)
    )


def parallel(position, panel=(1024, 768), pitch=1e-3, outer=0.8):
    pose = look_at(np.array(position, dtype=float), np.zeros(3), UP)
    device = ParallelModel(panel, pitch, (0.2, 3.0))
    return PlannedProjector(
        "P1", "parallel", pose, pose, device, np.linspace(0.01, outer, 80)
    )


def target_on(mesh, n=4000, steep=(0.0, 0.0, 0.0), seed=1):
    samples = sample_surface(mesh, n, seed=seed)
    return Target(samples, np.broadcast_to(np.array(steep), (n, 3)))


def stages(projector, mesh, target, limits=LIMITS):
    seen = Occlusion((Visibility(mesh),))
    return lighting.first_failure(projector, target, limits, seen)


def cause(projector, mesh, target, limits=LIMITS):
    found = np.unique(stages(projector, mesh, target, limits))
    assert len(found) == 1
    return "lit" if found[0] == LIT else CAUSES[found[0]]


def test_parallel_light_fills_the_cap_of_the_incidence_limit():
    """A sphere in parallel light is lit where -N.L >= cos 60: a quarter of its area."""
    ball = sphere(0.1, subdivisions=5)
    lit = stages(parallel([0.0, -1.0, 0.0]), ball, target_on(ball)) == LIT
    assert lit.mean() == pytest.approx((1 - np.cos(np.radians(60))) / 2, abs=0.01)


def test_diverging_light_fills_the_smaller_cap_seen_from_its_centre():
    """With sin(alpha) = rho/S sin(theta), the cap is theta - alpha wide."""
    ball = sphere(0.1, subdivisions=5)
    lit = stages(diverging([0.0, -0.5, 0.0]), ball, target_on(ball)) == LIT
    theta = np.radians(60.0)
    cap = theta - np.arcsin(0.1 / 0.5 * np.sin(theta))
    assert lit.mean() == pytest.approx((1 - np.cos(cap)) / 2, abs=0.01)


def test_light_on_the_back_is_refused_by_incidence():
    plate = grid(0.1, 0.1, divisions=(4, 4))
    target = target_on(plate)
    assert cause(diverging([0.0, 0.01, 1.0]), plate, target) == "lit"
    assert cause(diverging([0.0, 0.01, -1.0]), plate, target) == "projector_incidence"


def test_incidence_limit_stands_where_it_says():
    plate = grid(0.001, 0.001, divisions=(1, 1))
    target = target_on(plate, 50)
    for degrees, expected in ((59.0, "lit"), (61.0, "projector_incidence")):
        angle = np.radians(degrees)
        position = [0.0, -np.sin(angle), np.cos(angle)]
        assert cause(diverging(position), plate, target) == expected
        assert cause(parallel(position), plate, target) == expected


def test_light_along_the_steep_direction_is_refused():
    """At 55 degrees of incidence towards T1 the tangent angle is 35 degrees."""
    plate = grid(0.001, 0.001, divisions=(1, 1))
    angle = np.radians(55.0)
    light = diverging([0.0, -np.sin(angle), np.cos(angle)])
    along = target_on(plate, 50, steep=(0.0, 1.0, 0.0))
    across = target_on(plate, 50, steep=(1.0, 0.0, 0.0))
    assert cause(light, plate, along) == "tangent_angle"
    assert cause(light, plate, across) == "lit"
    wider = replace(LIMITS, min_tangent_angle=np.radians(34.0))
    assert cause(light, plate, along, wider) == "lit"


def test_range_is_radial_for_diverging_and_axial_for_parallel_light():
    plate = grid(0.4, 0.4, divisions=(4, 4))
    target = target_on(plate)
    near = replace(WIDE, range_m=(0.2, 1.001))
    stage = stages(diverging([0.0, 1e-6, 1.0], device=near), plate, target)
    radius = np.linalg.norm(target.samples.points[:, :2], axis=1)
    inside = radius < np.sqrt(1.001**2 - 1.0) - 1e-5
    assert np.array_equal(stage[inside] == LIT, np.ones(inside.sum(), bool))
    assert np.all(stage[radius > 0.05] == CAUSES.index("projector_range"))
    beam = parallel([0.0, 1e-6, 1.0])
    beam = replace(beam, device=replace(beam.device, range_m=(0.2, 1.001)))
    assert cause(beam, plate, target) == "lit"


def test_beam_ends_at_image_panel_and_largest_ring():
    plate = grid(1.0, 1.0, divisions=(4, 4))
    target = target_on(plate)
    # Looking straight down, the image's long side lies along the world's y.
    y, x = np.abs(target.samples.points[:, :2]).T
    limits = replace(LIMITS, max_incidence=np.radians(85.0))
    narrow = PinholeModel(
        np.array([[1000.0, 0, 199.5], [0, 1000.0, 99.5], [0, 0, 1]]),
        (400, 200),
        (0.2, 3),
    )
    lit = stages(diverging([0, 1e-9, 1], device=narrow), plate, target, limits) == LIT
    assert np.array_equal(lit, (x <= 0.2) & (y <= 0.1))
    lit = stages(parallel([0, 1e-9, 1], (400, 200)), plate, target, limits) == LIT
    assert np.array_equal(lit, (x <= 0.2) & (y <= 0.1))
    lit = stages(diverging([0, 1e-9, 1], outer=0.3), plate, target, limits) == LIT
    assert np.array_equal(lit, np.hypot(x, y) <= 0.3)
    lit = stages(parallel([0, 1e-9, 1], outer=0.3), plate, target, limits) == LIT
    assert np.array_equal(lit, np.hypot(x, y) <= 0.3)


@pytest.mark.parametrize("light", [diverging, parallel])
def test_a_plate_in_front_casts_its_shadow(light):
    """A small plate half way up shades its central projection and nothing else."""
    floor = grid(0.4, 0.4, divisions=(8, 8))
    lid = grid(0.1, 0.1, divisions=(2, 2))
    vertices = np.concatenate([floor.vertices, lid.vertices + [0.0, 0.0, 0.5]])
    faces = np.concatenate([floor.faces, lid.faces + len(floor.vertices)])
    both = TriangleMesh(vertices, faces)
    target = target_on(floor, 3000)
    stage = stages(light([0.0, 1e-9, 1.0]), both, target)
    half = 0.1 if light is diverging else 0.05
    reach = np.abs(target.samples.points[:, :2]).max(axis=1)
    shaded = stage == CAUSES.index("projector_occlusion")
    assert np.all(shaded[reach < half - 1e-3])
    assert np.all(stage[reach > half + 1e-3] == LIT)


def test_margin_is_the_smaller_of_the_two_and_ties_go_to_the_lower_id():
    plate = grid(0.001, 0.001, divisions=(1, 1))
    target = target_on(plate, 1, steep=(0.0, 1.0, 0.0))
    angle = np.radians(45.0)
    light = lighting.light_on(parallel([0.0, -np.sin(angle), np.cos(angle)]), target)
    assert np.degrees(lighting.margins(light, LIMITS)) == pytest.approx(5.0)
    arbitrary = lighting.light_on(
        parallel([0.0, -np.sin(angle), np.cos(angle)]), target_on(plate, 1)
    )
    assert np.degrees(lighting.margins(arbitrary, LIMITS)) == pytest.approx(15.0)
    lit = np.array([[True, True], [True, True], [False, True], [False, False]])
    margin = np.array([[0.1, 0.1], [0.1, 0.2], [0.3, 0.1], [0.1, 0.1]])
    assert lighting.assigned_projectors(lit, margin).tolist() == [0, 1, 1, -1]
