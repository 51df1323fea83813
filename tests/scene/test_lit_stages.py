"""The matrix of what candidates light is the loop over them, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.factories import make_requirements, make_scene

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import transform
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits
from planning.report.claims import reach
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene import lighting
from planning.scene.codes.patterns import pattern_of
from planning.scene.draws import Draw
from planning.scene.lighting import light_on, lit_stages
from planning.scene.lights import ring_frame
from planning.scene.limits import projector_limits
from planning.scene.samples import Target
from planning.scene.workspace.candidates import Candidates


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_candidates_together_light_what_each_lights_alone(light, monkeypatch):
    ball = sphere(0.04, subdivisions=3)
    apart = np.array([0.09, 0.0, 0.0])
    pair = TriangleMesh(
        np.concatenate([ball.vertices - 0.5 * apart, ball.vertices + 0.5 * apart]),
        np.concatenate([ball.faces, ball.faces + len(ball.vertices)]),
    )
    rig = load_rig("default", light=light)
    required = make_requirements(pair, rig, max_projectors=6)
    scene = make_scene(pair, required)
    eye = np.eye(4)
    radii = uniform_radii(0.45 if light == "diverging" else 0.3, 0.0035)
    device = rig.projector_device()
    ring = ring_frame(eye, device, 0.0, 0.0)
    template = PlannedProjector("", rig.light, eye, ring, device, radii)
    offered = Candidates(template, required.workspace).over(60)
    rows = scene.target_samples(Draw(1500, 7))
    limits = required.projector
    alone = [
        lighting.first_failure(one, rows, limits, scene.occlusion) for one in offered
    ]
    together = lit_stages(scene, offered, rows)
    np.testing.assert_array_equal(together, np.column_stack(alone))
    assert (together == projector_limits.OCCLUDED).sum() > 300
    assert (together == projector_limits.LIT).sum() > 300
    # Of few poses, so that some samples stay dark for each reason.
    few = together[:, 20:26]
    for at_once in (64, 2):
        monkeypatch.setattr(reach, "_MOST_AT_ONCE", at_once)
        furthest = reach.furthest_lit(scene, offered[20:26], rows)
        np.testing.assert_array_equal(furthest, few.max(axis=1))
    assert len(np.unique(furthest)) >= 3


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_the_first_limit_that_fails_follows_from_the_rays(light):
    """Turned rings, a round beam, a lens that distorts, steep directions: all limits.

    Points lie on all sides of the device and beyond its range.
    """
    rng = np.random.default_rng(3)
    n = 4000
    normals, steep = rng.normal(size=(2, n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    steep -= np.einsum("ij,ij->i", steep, normals)[:, None] * normals
    steep /= np.linalg.norm(steep, axis=1)[:, None]
    steep[::5] = 0.0
    local = rng.uniform(-1.0, 1.0, (n, 3)) * [0.12, 0.12, 0.4]
    if light == "diverging":
        local[:, :2] *= 3.0 * local[:, 2:]
    rig = load_rig("default", light=light)
    device = rig.projector_device()
    device = (
        replace(device, distortion=(0.1, -0.02, 0.01, 0.02, 0.0), range_m=(0.05, 0.3))
        if light == "diverging"
        else replace(device, beam_radius=0.11, range_m=(0.05, 0.3))
    )
    limits = ProjectorLimits(np.radians(70.0), np.radians(60.0))
    away = local[:, 2]
    if light == "diverging":
        away = np.linalg.norm(local, axis=1)
    seen = []
    for _ in range(12):
        pose, turn = np.eye(4), np.eye(4)
        pose[:3, :3] = Rotation.random(rng=rng).as_matrix()
        pose[:3, 3] = 0.05 * rng.normal(size=3)
        turn[:3, :3] = Rotation.from_rotvec(0.1 * rng.normal(size=3)).as_matrix()
        turn[:3, 3] = 0.01 * rng.normal(size=3)
        radii = np.array([0.01, 0.3 if light == "diverging" else 0.1])
        one = PlannedProjector("", light, pose, pose @ turn, device, radii)
        points = transform(pose, local)
        samples = SurfaceSamples(points, normals, np.arange(n), 1.0 / n)
        target = Target(samples, steep)
        found = lighting.first_failure(one, target, limits, None)
        ray = light_on(one, target)
        inside = pattern_of(one).coordinate(points) <= radii[-1]
        holds = (
            inside & lighting.in_panel(one, points),
            (away >= 0.05) & (away <= 0.3),
            ray.incidence_cos >= np.cos(limits.max_incidence),
            ray.tangent_cos <= np.cos(limits.min_tangent_angle),
            np.zeros(n, dtype=bool),
        )
        expected = np.argmin(holds, axis=0)
        expected[np.all(holds[:4], axis=0)] = projector_limits.LIT
        np.testing.assert_array_equal(found, expected)
        seen.append(found)
    kinds = np.bincount(np.concatenate(seen), minlength=projector_limits.LIT + 1)
    assert (kinds[[0, 1, 2, 3, projector_limits.LIT]] > 50).all()
