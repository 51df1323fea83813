"""Parts narrower than a ring gap are measured, where rings cross them."""

import dataclasses

import numpy as np
import pytest
from support.reconstruction_rigs import reconstruct_plan

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from planning.verify.audit.ledger import Ledger
from planning.verify.audit.rings.ring_claims import _audit_quantile
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


def test_a_few_chords_between_creases_contradict_no_claim():
    """The largest hundredth of 37 chords is one chord; of 2,000 it is 20."""
    bent = np.where(np.arange(2000) % 8 == 0, 2e-5, 0.0)
    for n, failures in ((37, 0), (2000, 1)):
        ledger = Ledger({})
        _audit_quantile("error_p99_m", 3e-9, bent[:n], ledger)
        assert len(ledger.failures) == failures
