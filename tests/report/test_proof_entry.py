"""What travels with a plan: of which draws the samples of a cover are."""

import numpy as np
from support.factories import make_requirements, make_scene

from geometry.shapes.primitives import sphere
from planning import load_rig
from planning.report.entries import proof_entry
from planning.scene.draws import DRAWS
from planning.scene.samples import merged

BALL = sphere(0.1, subdivisions=3)


def test_a_draw_that_confirmed_before_floors_were_asked_for_is_none_of_a_covers():
    """Its round is counted: what the next one denied joins from a stream further on."""
    required = make_requirements(BALL, load_rig("default"), max_projectors=3)
    scene = make_scene(BALL, required)
    fresh = scene.target_samples(DRAWS.fresh_projectors.later(2))
    some = fresh.take(np.arange(0, len(fresh), proof_entry._JOINED))
    samples = merged(scene.target_samples(DRAWS.projectors), some)
    found = proof_entry._frozen(scene, samples, proof_entry._projector_draws())
    assert found is not None
    draws, points, _, where = found
    assert draws[:, 1].tolist() == [100, 102]
    np.testing.assert_array_equal(points[where], samples.samples.points)
    assert len(points) == len(samples)
