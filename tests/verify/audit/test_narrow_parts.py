"""Parts narrower than a ring gap are measured, where rings cross them."""

import dataclasses

import numpy as np
import pytest
from support.reconstruction_rigs import reconstruct_plan

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from planning.verify.reconstruction.render.photometry import Photometry

# Two thirds of a gap: 8 pixels in the image.
WIDTH, APART, HALF = 2.3e-3, 9e-3, 0.03


def slats() -> TriangleMesh:
    """Upright strips in the plane y = 0 that face -y."""
    left = np.arange(-3, 4) * APART - 0.5 * WIDTH
    corners = np.array(
        [[0, 0, -HALF], [WIDTH, 0, -HALF], [WIDTH, 0, HALF], [0, 0, HALF]]
    )
    aside = left[:, None, None] * np.array([1.0, 0.0, 0.0])
    vertices = (corners + aside).reshape(-1, 3)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return TriangleMesh(
        vertices, (faces[None] + 4 * np.arange(len(left))[:, None, None]).reshape(-1, 3)
    )


@pytest.mark.parametrize("noisy", [False, True])
def test_slats_narrower_than_a_gap_are_measured(rigs, noisy):
    mesh = slats()
    plan = rigs.small_rig(mesh)
    samples = sample_surface(mesh, 2000, seed=1)
    predicted = rigs.predict_on_sphere(plan, samples)
    assert predicted.mean() > 0.9
    found = reconstruct_plan(
        plan,
        seed=0,
        samples=samples,
        predicted=predicted,
        photometry=dataclasses.replace(Photometry(), noisy=noisy),
    )
    assert found.completeness.predicted_missing <= 0.01
    assert found.passed
