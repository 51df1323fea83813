"""The matrix of what candidates light is the loop over them, bit for bit."""

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.primitives import sphere
from planning import lighting
from planning.candidates import projector_candidates
from planning.claims import Devices, _reachable_by_projectors
from planning.plan import PlannedProjector
from planning.projector_light import lit_stages
from planning.rig import load_rig
from planning.rings import uniform_radii
from planning.scene import Scene


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_candidates_together_light_what_each_lights_alone(light):
    ball = sphere(0.04, subdivisions=3)
    apart = np.array([0.09, 0.0, 0.0])
    pair = TriangleMesh(
        np.concatenate([ball.vertices - 0.5 * apart, ball.vertices + 0.5 * apart]),
        np.concatenate([ball.faces, ball.faces + len(ball.vertices)]),
    )
    rig = load_rig("default", light=light)
    required = rig.requirements(
        pair.centre, pair.radius, max_projectors=6, target="surface", tau_m=0.004
    )
    n = len(pair.faces)
    scene = Scene(pair, np.full(n, -1), np.zeros((n, 3)), required, 0, 2)
    eye = np.eye(4)
    radii = uniform_radii(0.45 if light == "diverging" else 0.3, 0.0035)
    device = rig.projector_device()
    template = PlannedProjector("", rig.light, eye, eye, device, radii)
    offered = projector_candidates(
        template, required.workspace, 60, ring_offset=(0.0, 0.0)
    )
    rows = scene.target_samples(1500, 7)
    limits = required.projector
    alone = [
        lighting.first_failure(one, rows, limits, scene.visibility) for one in offered
    ]
    together = lit_stages(scene, offered, rows)
    np.testing.assert_array_equal(together, np.column_stack(alone))
    assert (together == lighting.OCCLUDED).sum() > 300
    assert (together == lighting.LIT).sum() > 300
    away = np.column_stack([lighting.faces_away(one, rows) for one in offered])
    assert together[away].max() == lighting.INCIDENCE
    assert away.mean() > 0.4
    # Of few poses, so that some samples stay dark for each reason.
    few = together[:, 20:26]
    nothing = np.zeros(len(rows), dtype=bool)
    devices = Devices((), (), tuple(offered[20:26]), ())
    reachable, furthest = _reachable_by_projectors(scene, devices, rows, nothing)
    np.testing.assert_array_equal(reachable, (few == lighting.LIT).any(axis=1))
    np.testing.assert_array_equal(furthest, few.max(axis=1))
    assert len(np.unique(furthest)) >= 3
