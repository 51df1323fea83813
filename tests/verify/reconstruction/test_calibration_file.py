"""Poses and optics that were measured after mounting, in place of the plan's."""

import copy
import json
import re
from typing import Any

import numpy as np
import pytest

from geometry.mesh.sampling import SurfaceSamples
from planning.model.errors import CalibrationError
from planning.model.plan import RigPlan
from planning.verify.audit.coverage.prediction import predict_measured
from planning.verify.reconstruction.captures.calibration_file import calibrated
from planning.verify.reconstruction.captures.captured import reconstruct_rendered
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.scanner import Scanner


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(request, rigs) -> RigPlan:
    """One projector and two cameras of 320 x 240 px before a waved ball of 10 cm."""
    make = rigs.diverging if request.param == "diverging" else rigs.parallel
    cameras = rigs.two_small_cameras()
    lamp = make("P1", rigs.direction(-30.0, 5.0), 0.055, 6.2e-3)
    body = rigs.bumpy_sphere(0.05, subdivisions=4)
    plan = rigs.plan_of(body, [lamp], cameras, check=rigs.CHECK | {"tau_m": 6.2e-3})
    return plan


@pytest.fixture(scope="module")
def expected(plan) -> Expected:
    return expected_of(plan)


def expected_of(plan: RigPlan) -> Expected:
    found = predict_measured(plan, seed=0, n_samples=2000, threads=1)
    inside = found.samples
    weight = float(inside.weights[0])
    samples = SurfaceSamples(inside.points, inside.normals, inside.faces, weight)
    return Expected(samples, found.measured, found.by_pair)


def moved(rigs, pose: list[list[float]], by_m: list[float], degrees: float):
    """A pose shifted in its own axes and turned about its x axis."""
    there = np.array(pose) @ rigs.turn(0, degrees)
    there[:3, 3] += np.array(pose)[:3, :3] @ by_m
    return there.tolist()


def measured(rigs, plan: RigPlan) -> dict[str, Any]:
    """All devices millimetres and tenths of degrees off, and another lens."""
    lamp = plan.to_document()["projectors"][0]["world_from_device"]
    one, two = (entry["world_from_device"] for entry in plan.to_document()["cameras"])
    return {
        "format": "ringrig-calibration",
        "version": 1,
        "devices": [
            {
                "id": "P1",
                "world_from_device": moved(rigs, lamp, [3e-3, -2e-3, 5e-3], 0.3),
            },
            {
                "id": "C1",
                "world_from_device": moved(rigs, one, [-4e-3, 2e-3, 3e-3], -0.4),
                "K": [[1616, 0, 161.0], [0, 1612.0, 118.2], [0, 0, 1]],
                "distortion": [-0.2, 0.05, 1e-3, -1e-3, 0.0],
            },
            {"id": "C2", "world_from_device": moved(rigs, two, [5e-3, 0.0, 0.0], 0.2)},
        ],
    }


def written(document: Any, folder) -> Any:
    path = folder / "calibration.json"
    path.write_text(json.dumps(document))
    return path


def test_what_was_measured_replaces_the_plan_and_the_rest_stays(rigs, plan, tmp_path):
    document = measured(rigs, plan)
    mounted = calibrated(Scanner.of(plan), written(document, tmp_path))
    projector, before = mounted.projectors[0], plan.projectors[0]
    assert np.allclose(
        projector.world_from_device, document["devices"][0]["world_from_device"]
    )
    # The rings move with their projector.
    for inside in (projector, before):
        ring = np.linalg.inv(inside.world_from_device) @ inside.world_from_ring
        assert np.allclose(
            ring, np.linalg.inv(before.world_from_device) @ before.world_from_ring
        )
    one, two = mounted.cameras
    assert one.matrix[0, 0] == 1616.0
    assert one.distortion[0] == -0.2
    assert two.distortion == (0.0,) * 5
    assert np.array_equal(two.matrix, plan.cameras[1].device.camera_matrix)
    assert plan.cameras[0].device.camera_matrix[0, 0] == 1600.0


@pytest.mark.long
def test_a_rig_that_was_mounted_and_calibrated_measures_as_planned(
    rigs, plan, expected, tmp_path
):
    mounted = calibrated(Scanner.of(plan), written(measured(rigs, plan), tmp_path))
    options = {"seed": 0, "threads": 1, "truth": mounted}
    found = reconstruct_rendered(
        Scanner.of(plan), expected, believed=mounted, **options
    )
    assert found.accuracy.rms_m < 6e-5
    assert found.accuracy.max_m < 5e-4
    assert all(pair.n_points > 1000 for pair in found.pairs)
    assert found.failures == ()
    blind = reconstruct_rendered(Scanner.of(plan), expected, **options)
    assert blind.n_merged == 0
    assert "poses that aren't those of the plan" in blind.failures[0]


def test_near_the_border_of_a_root_disc_drawn_for_another_place_no_root_is_guessed(
    rigs, tmp_path
):
    """The border crosses the ball as seen from 150 mm above the planned place."""
    body = rigs.bumpy_sphere(0.05, subdivisions=4)
    lamp = rigs.diverging("P1", rigs.direction(-30.0, 5.0), 0.055, 6.2e-3)
    place = rigs.direction(-5.0, -10.0)
    found = []
    for up in (0.0, 2e-3, 0.15):
        camera = rigs.camera("C1", place)
        camera["K"] = [[1600.0, 0.0, 159.5], [0.0, 1600.0, 119.5], [0.0, 0.0, 1.0]]
        camera["resolution"] = [320, 240]
        plan = rigs.plan_of(body, [lamp], [camera])
        pose = rigs.camera("C1", place + [0.0, 0.0, up])["world_from_device"]
        entry = {"id": "C1", "world_from_device": pose}
        document = {"format": "ringrig-calibration", "version": 1, "devices": [entry]}
        mounted = calibrated(Scanner.of(plan), written(document, tmp_path))
        result = reconstruct_rendered(
            Scanner.of(plan),
            expected_of(plan),
            seed=0,
            threads=1,
            truth=mounted,
            believed=mounted,
        )
        assert result.accuracy.max_m < 5e-4
        assert result.n_merged > 500
        found.append(result.pairs[0].rejected["root"])
    assert found[0] == 0
    assert found[1] < 30
    assert found[2] > 300


def changed(change) -> Any:
    return lambda document: change(document["devices"])


def turned_by(degrees: float):
    def turn(devices) -> None:
        pose = np.array(devices[1]["world_from_device"])
        c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        pose[:3, :3] = pose[:3, :3] @ [[c, -s, 0], [s, c, 0], [0, 0, 1]]
        devices[1]["world_from_device"] = pose.tolist()

    return turn


def in_millimetres(devices) -> None:
    for row in devices[1]["world_from_device"][:3]:
        row[3] *= 1000.0


def mirrored(devices) -> None:
    for row in devices[1]["world_from_device"][:3]:
        row[0] = -row[0]


BROKEN = {
    "format": (lambda d: d.update(format="x"), r"`format` = 'x'"),
    "version": (lambda d: d.update(version=2), r"`version` = 2"),
    "empty": (lambda d: d.update(devices=[]), r"`devices` = \[\]"),
    "key": (changed(lambda v: v[1].update(pose=1)), r"`devices\[1\].pose` is not a kn"),
    "no id": (changed(lambda v: v[1].pop("id")), r"`devices\[1\].id` is missing"),
    "unknown": (changed(lambda v: v[1].update(id="C9")), r"'C9' isn't in the plan.*P1"),
    "twice": (changed(lambda v: v[2].update(id="C1")), r"'C1' twice"),
    "nothing": (changed(lambda v: v.append({"id": "C2"})), r"no measured value"),
    "text": (
        changed(lambda v: v[1]["K"][0].__setitem__(0, "1600")),
        r"`devices\[1\].K\[0\]\[0\]` = '1600'",
    ),
    "rows": (
        changed(lambda v: v[1]["world_from_device"].pop()),
        r"world_from_device` = .*at least 4 items",
    ),
    "millimetres": (changed(in_millimetres), r"C1: stands .* write metres"),
    "mirrored": (changed(mirrored), r"mirrored \(determinant -1"),
    "turned": (changed(turned_by(40.0)), r"C1: is turned by 40.0 degrees.* at most 30"),
    "last row": (
        changed(lambda v: v[1]["world_from_device"].__setitem__(3, [0, 0, 1, 1])),
        r"last row .* must be 0 0 0 1",
    ),
    "skew": (changed(lambda v: v[1]["K"][0].__setitem__(1, 2.0)), r"must be \[fx, 0, "),
    "focal": (changed(lambda v: v[1]["K"][0].__setitem__(0, -9)), r"must be positive"),
    "four": (changed(lambda v: v[1]["distortion"].pop()), r"at least 5 items"),
    "lamp's lens": (
        changed(lambda v: v[0].update(distortion=[0.1, 0, 0, 0, 0])),
        r"P1: distortion = .* correct the images",
    ),
    "lamp's optics": (
        changed(lambda v: v[0].update(K=[[9.0, 0, 9], [0, 9, 9], [0, 0, 1]])),
        r"P1: K = .* (isn't near the one that its patterns|of a projector of parallel)",
    ),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_what_is_wrong_is_said_in_one_line(rigs, plan, tmp_path, fault):
    change, message = BROKEN[fault]
    document = copy.deepcopy(measured(rigs, plan))
    change(document)
    path = written(document, tmp_path)
    with pytest.raises(CalibrationError) as caught:
        calibrated(Scanner.of(plan), path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert len(text.splitlines()) == 1
    assert re.search(message, text), text


@pytest.mark.parametrize(
    ("content", "message"),
    [("{", "not JSON"), ("[]", "`the file` = "), ("NaN", "`the file`"), ("\xff", "JS")],
)
def test_no_json_is_refused(plan, tmp_path, content, message):
    path = tmp_path / "calibration.json"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(CalibrationError, match=message):
        calibrated(Scanner.of(plan), path)
    with pytest.raises(CalibrationError, match="no such file"):
        calibrated(Scanner.of(plan), tmp_path / "other.json")
    with pytest.raises(CalibrationError, match="can't be read"):
        calibrated(Scanner.of(plan), tmp_path)
