"""Prediction against measurement: counted areas, parts of the surface, both limits."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import look_at
from planning.model.document.check_records import ConfusionRecord
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.coverage.prediction import receding
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.reconstruction.check.accuracy import Accuracy
from planning.verify.reconstruction.check.comparison import (
    PredictedSamples,
    compare,
    confusion,
)
from planning.verify.reconstruction.cloud import Cloud

TAU = 1e-3


def areas(table: ConfusionRecord) -> tuple[float, ...]:
    """Predicted and measured, missing, unexpected, neither, beside."""
    return tuple(table.to_document().values())[:5]


def cloud_at(points: np.ndarray) -> Cloud:
    """Points seen from above."""
    n = len(points)
    empty = Cloud.empty()
    down = np.tile([0.0, 0.0, -1.0], (n, 1))
    return dataclasses.replace(
        empty, points=points, rays=down, beams=down, camera=np.zeros(n, dtype=np.int16)
    )


def scanner(region: np.ndarray, *centres: list[float]) -> Any:
    """What a comparison asks of a rig; its regions are the target."""
    check = SimpleNamespace(tau_m=TAU)
    return SimpleNamespace(
        region=region,
        target=region >= 0,
        cameras=[SimpleNamespace(centre=np.array(centre)) for centre in centres],
        limits=SimpleNamespace(check=check),
    )


@pytest.fixture(scope="module")
def four():
    """Four samples a metre apart that face up; the first two lie beside a point."""
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0]])
    up = np.tile([0.0, 0.0, 1.0], (4, 1))
    prediction = PredictedSamples(
        SurfaceSamples(points, up, np.arange(4), 1.0),
        weights=np.array([1.0, 2.0, 3.0, 4.0]),
        claimed=np.array([[True, False, False, False], [False, False, True, False]]),
        possible=np.array([[True, True, False, False], [False] * 4]),
    )
    near = points[:2] + np.array([0.9 * TAU, 0.0, 0.0])
    accuracy = Accuracy(np.array([3e-5, -4e-5]), np.array([0, 1]))
    rig = scanner(np.array([0, 1, 1, -1]), [0.0, 0.0, 9.0], [0.0, 0.0, 8.0])
    return compare(rig, prediction, cloud_at(near), accuracy)


def test_areas_are_counted_by_what_was_said_and_what_was_found(four):
    table = four.confusion.target.limits
    assert areas(table) == (1 / 6, 3 / 6, 2 / 6, 0.0, 0.0)
    assert table.agreement == pytest.approx(1 / 6)
    assert table.trivial_agreement == pytest.approx(3 / 6)
    whole = four.confusion.surface
    assert areas(whole.limits) == (0.1, 0.3, 0.2, 0.4, 0.0)
    assert areas(whole.floors) == (0.3, 0.0, 0.0, 0.7, 0.0)
    assert whole.floors.agreement == 1.0
    assert whole.floors.trivial_agreement == pytest.approx(0.7)


def test_every_region_has_its_own_row(four):
    first, second = four.by_region
    assert (first.id, second.id) == (0, 1)
    assert first.measured == first.predicted == 1.0
    assert first.predicted_missing == 0.0
    assert second.measured == pytest.approx(2 / 5)
    assert second.predicted_missing == 1.0
    assert first.rms_m == pytest.approx(3e-5)
    assert second.bias_m == pytest.approx(-4e-5)
    assert four.dominant.n_points == 2
    assert four.dominant.predicted_missing == pytest.approx(3 / 4)
    assert four.whole_surface.measured == pytest.approx(0.3)


def beside(normal, centre) -> ConfusionRecord:
    """Table with a sample that isn't predicted, half a gap from one that is."""
    points = np.array([[0.0, 0.0, 0.0], [0.5 * TAU, 0.0, 0.0], [1.0, 0.0, 0.0]])
    normals = np.array([[0.0, 0.0, 1.0], normal, [0.0, 0.0, 1.0]])
    claimed = np.array([[True, False, False]])
    prediction = PredictedSamples(
        SurfaceSamples(points, normals, np.arange(3), 1.0),
        np.ones(3),
        claimed,
        claimed,
    )
    rig = scanner(np.full(3, -1), centre)
    return compare(rig, prediction, cloud_at(points[:1]), None).confusion.surface.limits


def test_what_lies_beside_predicted_surface_is_counted_apart():
    table = beside([0.0, 0.0, 1.0], [0.0, 0.0, 9.0])
    assert areas(table) == (1 / 3, 0.0, 0.0, 1 / 3, 1 / 3)
    assert table.agreement == 1.0
    assert table.trivial_agreement == pytest.approx(0.5)


def test_surface_that_faces_away_from_the_camera_isnt_beside():
    """On a thin wall the other side is near, too."""
    table = beside([0.0, 0.0, -1.0], [0.0, 0.0, 9.0])
    assert areas(table) == (1 / 3, 0.0, 0.0, 2 / 3, 0.0)


def test_of_no_area_nothing_is_said():
    sure = np.ones(2, bool)
    table = confusion(sure, sure, sure, np.zeros(2))
    assert table.neither == 1.0
    assert table.agreement == 1.0


@pytest.mark.parametrize("degrees", [0.0, 40.0, 66.0])
def test_how_fast_a_ring_recedes_is_the_incidence_along_it(degrees):
    """A plane under parallel rings about z; at (x, 0, 0) the ring runs along y."""
    point = np.array([[0.1, 0.0, 0.0]])
    tilt = np.deg2rad(degrees)
    camera = point[0] + np.array([0.0, -np.sin(tilt), np.cos(tilt)])
    samples = AuditSamples(
        point,
        np.array([[0.0, 0.0, 1.0]]),
        *(np.zeros(1, int), np.zeros((1, 3)), np.zeros(1, int)),
        *(np.ones(1, bool), np.ones(1)),
    )
    beam = ParallelModel((100, 100), pixel_pitch_m=1e-2, range_m=(0.1, 9.0))
    lamp = AuditProjector(beam, np.eye(4), np.eye(4), np.array([0.05, 0.2]))
    pose = look_at(camera, point[0], np.array([1.0, 0.0, 0.0]))
    lens = PinholeModel(np.diag([900.0, 900.0, 1.0]), (100, 100), range_m=(0.1, 9.0))
    slant = receding(lamp, AuditCamera(lens, pose), samples)
    assert slant == pytest.approx(np.sin(tilt), abs=1e-12)
