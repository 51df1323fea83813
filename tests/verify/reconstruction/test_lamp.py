"""Rendered light of a stated lamp against what a plan predicts of grey and noise."""

from dataclasses import replace

import numpy as np
import pytest
from scene.test_light_terms import LIGHT
from verify.reconstruction.test_reconstruction_decode import edge_error_px, plate

from geometry.mesh.sampling import sample_surface
from geometry.rays.rays import RayCaster
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene import lighting
from planning.scene.codes.patterns import pattern_of
from planning.scene.measuring import measurability
from planning.scene.samples import Target
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.decode.edges import find_edges
from planning.verify.reconstruction.render.lamp import Lamp
from planning.verify.reconstruction.render.photometry import assumed_light
from planning.verify.reconstruction.render.render import render_pair
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view
from planning.verify.reconstruction.scanner import Scanner

EXPOSURE_S = 1.0 / 60.0
BUDGET = replace(
    LIGHT, lumens=250.0, albedo=(0.5, 0.5), room_lux=150.0, f_number=4.0, bits=8
)


def shown(rigs, light, kind="diverging"):
    """A plate, its frames as rendered and the quality that is predicted of it."""
    mesh = plate(rigs, 0.12, 0.10)
    make = rigs.diverging if kind == "diverging" else rigs.parallel
    plan = rigs.plan_of(
        mesh,
        [make("P1", rigs.direction(-25.0, 5.0), 0.09, 3.5e-3)],
        [rigs.camera("C1", rigs.direction(20.0, 12.0))],
    )
    (camera,), (source,) = plan.cameras, plan.projectors
    scanner = replace(Scanner.of(plan), light=light)
    seen_by, projector = scanner.cameras[0], scanner.projectors[0]
    lens, caster = assumed_light(scanner), RayCaster(mesh, threads=1)
    patterns = projector.pattern_for(seen_by)
    lamp = Lamp(light, EXPOSURE_S)
    frames = render_pair(
        view(seen_by, mesh, caster, lens),
        Shown(projector, projector, patterns, caster, lamp=lamp),
        lens,
        (0,),
    )
    samples = sample_surface(mesh, 400, seed=1)
    target = Target(samples, np.zeros((400, 3)))
    limits = TriangulationLimits(0.1, 0.0, 1.0, drawn_edges=DrawnEdges(), light=light)
    limits = replace(limits, light=replace(light, focal_px=3478.0))
    source = replace(source, exposure_s=EXPOSURE_S)
    quality = measurability.pair_quality(
        samples.normals,
        lighting.light_on(source, target),
        pattern_of(source).surfaces(samples.points),
        measurability.view(camera, target, CameraLimits(np.radians(80.0)), None),
        limits,
    )
    return frames, patterns, PairCalibration(projector, seen_by), samples, quality


@pytest.mark.parametrize("kind", ["diverging", "parallel"])
def test_frames_are_as_bright_as_planned(rigs, kind):
    frames, _, pair, samples, quality = shown(rigs, replace(BUDGET, f_number=8.0), kind)
    pixels = np.rint(pair.camera.project(samples.points)).astype(int)
    u, v = (pixels - np.array(frames.corner)).T
    white, black = (frames.stack[k, v, u].astype(float) for k in (0, 1))
    near = np.all(np.abs(samples.points) < 0.04, axis=1)
    assert 40.0 < white[near].max() < 250.0
    for found, expected in (
        (white, quality.grey.white),
        (white - black, quality.grey.contrast),
    ):
        assert np.median(found[near] / expected[near]) == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("lumens", [25.0, 60.0, 250.0])
def test_edges_are_as_noisy_as_predicted(rigs, lumens):
    frames, patterns, pair, _, quality = shown(rigs, replace(BUDGET, lumens=lumens))
    edges, *_ = find_edges(frames, patterns)
    error = edge_error_px(edges, patterns, pair)
    assert len(error) > 3000
    # Of the light, and what the panel's pixels leave.
    per_px = quality.terms["light"] / quality.edge_px
    variance = quality.edge_px**2 + (quality.terms["linearity"] / per_px) ** 2
    predicted = np.sqrt(np.mean(variance))
    assert np.std(error) == pytest.approx(predicted, rel=0.1)
