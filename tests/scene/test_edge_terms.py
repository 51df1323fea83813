"""How far drawn edges lie off: where light is sharp, where it isn't, in each light."""

from dataclasses import replace

import numpy as np
import pytest
from scene.test_measurability import (
    CAMERA,
    LIMITS,
    SETUPS,
    UP,
    one_sample,
    pair,
    projector,
)

from geometry.poses import look_at
from planning.model.devices.planned import PlannedCamera
from planning.model.light.drawn_edges import DrawnEdges
from planning.scene.limits.edge_terms import edge_linearity_m
from planning.scene.measuring import measurability
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.error_terms import PairGeometry, error_terms

LIGHTS = [
    DrawnEdges(in_focus_m=1e-4, camera_px=0.3),
    DrawnEdges(in_focus_m=1e-4, camera_px=0.0, focus_m=1.1, aperture_m=0.004),
    DrawnEdges(in_focus_m=2e-4, camera_px=0.67, focus_m=1.3, aperture_m=0.002),
]


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
@pytest.mark.parametrize("drawn", LIGHTS)
def test_the_audit_finds_the_same_term_and_it_adds_up(
    light, point, normal, position, drawn
):
    source = projector(light, [0.05, -1.1, 0.1])
    pose = look_at(np.array(position), np.array([0.02, 0.0, 0.01]), UP)
    camera = PlannedCamera("C1", pose, CAMERA)
    target = one_sample(point, normal)
    plain, rings, lit = pair(source, camera, target)
    limits = replace(LIMITS, drawn_edges=drawn)
    quality = measurability.pair_quality(
        target.samples.normals, lit, rings, plain.view, limits
    )
    off = quality.terms["linearity"]
    assert 0.0 < off[0] == pytest.approx(np.sqrt(quality.sigma**2 - plain.sigma**2)[0])
    audited = error_terms(
        PairGeometry.of(
            AuditProjector(
                *(source.device, source.world_from_device),
                *(source.world_from_ring, source.ring_radii),
            ),
            AuditCamera(camera.device, camera.world_from_device),
            AuditSamples(
                *(target.samples.points, target.samples.normals),
                *(target.samples.faces, target.steep, np.zeros(1, dtype=int)),
                *(np.ones(1, dtype=bool), np.ones(1)),
            ),
        ),
        limits,
    )
    assert audited["linearity"] == pytest.approx(off, rel=1e-4)


def test_a_step_of_the_ring_moves_a_point_as_the_term_says():
    """As in the exact triangulation: rings that lie off by what edges do."""
    light, point, normal, position = SETUPS[0]
    source = projector(light, [0.05, -1.1, 0.1])
    camera = PlannedCamera("C1", look_at(np.array(position), np.zeros(3), UP), CAMERA)
    target = one_sample(point, normal)
    plain, rings, lit = pair(source, camera, target)
    drawn = replace(LIMITS, drawn_edges=LIGHTS[0])
    squares, placed = (
        measurability.pair_quality(
            target.samples.normals, lit, rings, plain.view, limits
        )
        for limits in (drawn, replace(LIMITS, ring_sigma_m=1e-5))
    )
    per_m = placed.terms["rings"] / 1e-5
    assert squares.terms["linearity"] == pytest.approx(per_m * squares.drawn_m)


@pytest.mark.parametrize(
    ("depth", "blur_m"), [(1.0, 1e-4), (1.5, np.hypot(1e-4, 0.25 * 0.004 * 0.5))]
)
def test_out_of_focus_light_hides_the_panels_squares(depth, blur_m):
    """In focus 0.2 px of blur leave a tenth of a pixel, out of it next to nothing."""
    drawn = DrawnEdges(in_focus_m=1e-4, camera_px=0.0, focus_m=1.0, aperture_m=0.004)
    assert drawn.light_m(np.array([depth]))[0] == pytest.approx(blur_m)
    pixel = np.array([5e-4])
    off = edge_linearity_m(drawn, np.array([depth]), pixel, np.zeros(1)) / pixel
    stairs = np.exp(-2.0 * (np.pi * blur_m / 5e-4) ** 2) / (np.sqrt(2.0) * np.pi)
    assert off[0] == pytest.approx(np.hypot(stairs, 0.005))
    assert (off[0] > 0.1) == (depth == 1.0)
