"""Covers of few samples overfit them: others say what is lit, and how many it takes.

A ball in parallel light: a projector lights the cap about its axis. Of 60 samples a
smallest cover lights its share, of others much less.
"""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene
from support.little_work import draw_fewer

from geometry.shapes.primitives import sphere
from planning.projectors.projector_stage import plan_projectors
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import Draw
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT

SHARE = 0.9


def planned(monkeypatch, most, rounds=1):
    """The scene and its projectors."""
    draw_fewer(monkeypatch, projectors=60, fresh_projectors=3000)
    mesh, rig = sphere(0.06), load_rig("default", light="parallel")
    wishes = {"target": "surface", "dominant_coverage": SHARE}
    required = make_requirements(mesh, rig, max_projectors=most, **wishes)
    limits = replace(
        required.projector, max_incidence=np.radians(40.0), min_tangent_angle=0.0
    )
    scene = make_scene(mesh, replace(required, projector=limits))
    template = make_projector(rig, uniform_radii(0.2, 0.0035), (0.14, -1.57))
    return scene, plan_projectors(scene, (template,), 150, rounds=rounds)


def share_of_others(scene, stage, projectors):
    """What projectors light of samples that nobody saw, of what candidates do."""
    samples = scene.target_samples(Draw(6000, 77))
    lit, reached = (
        np.any(lit_stages(scene, some, samples) == LIT, axis=1).mean()
        for some in (projectors, stage.reference)
    )
    return lit / reached


def test_projectors_are_added_until_fresh_samples_confirm_the_cover(monkeypatch):
    scene, stage = planned(monkeypatch, 40)
    proof = stage.certificate
    assert share_of_others(scene, stage, stage.projectors) >= SHARE - 0.01
    assert proof.status == "feasible"
    assert proof.candidates.lower_bound < proof.count == proof.needed.count
    # As it was found of the samples alone.
    scene, few = planned(monkeypatch, 40, rounds=0)
    assert few.certificate.count < proof.count
    assert few.certificate.candidates.lower_bound == proof.candidates.lower_bound
    assert share_of_others(scene, few, few.projectors) < SHARE - 0.02


def test_too_few_are_told_how_many_fresh_samples_take(monkeypatch):
    _, enough = planned(monkeypatch, 40)
    _, stage = planned(monkeypatch, 2)
    proof = stage.certificate
    _, of_samples = planned(monkeypatch, 2, rounds=0)
    assert of_samples.certificate.needed.count < proof.needed.count
    assert len(stage.projectors) == proof.count == 2
    assert proof.status == "infeasible"
    least = proof.needed.lower_bound
    assert least < proof.needed.count
    assert proof.needed.count == pytest.approx(enough.certificate.count, abs=2)
