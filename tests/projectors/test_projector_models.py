"""Projectors of two models on a ball, of one of which there are few."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_requirements, make_scene

from geometry.devices import PinholeModel
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import Stock
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import plan_projectors
from planning.proofs.device_stock import within_stock
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.lights import ring_frame


def taken(count: int):
    """The stage of a ball whose wide projectors are so many, and what was taken."""
    mesh, rig, eye = sphere(0.1, subdivisions=4), load_rig("default"), np.eye(4)
    required = make_requirements(mesh, rig, max_projectors=6, dominant_coverage=0.6)
    scene = make_scene(mesh, replace(required, stock=(Stock("projector", "w", count),)))
    wide, radii = rig.projector_device(), uniform_radii(0.3, 0.0035)
    matrix = np.diag([4.0, 4.0, 1.0]) @ wide.camera_matrix
    matrix[:2, 2] = wide.camera_matrix[:2, 2]
    narrow = PinholeModel(matrix, wide.resolution, wide.range_m)
    templates = tuple(
        PlannedProjector(
            *("", rig.light, eye, ring_frame(eye, lens, rig.ring_offset, -1.0)),
            *(lens, radii),
            model=model,
        )
        for model, lens in (("w", wide), ("n", narrow))
    )
    stage = plan_projectors(scene, templates, 60, rounds=1)
    return scene, stage, [projector.model for projector in stage.projectors]


@pytest.mark.long
@pytest.mark.parametrize("count", [1, 2])
def test_no_more_are_taken_than_there_are_however_they_are_moved(count):
    scene, stage, models = taken(count)
    assert models.count("w") <= count
    assert models.count("n") > 0
    assert stage.certificate.status != "infeasible"
    counts = scene.requirements.stock_of("projector")
    assert all(within_stock(devices, counts) for devices in stage.by_count.values())
    moved = widen_margins(scene, stage)
    assert within_stock(moved, counts)
    assert len(moved) == len(models)
