"""Images of a board: what errors of devices do, what marks tell, what is chosen."""

from dataclasses import replace

import numpy as np
import pytest
from support.handmade import build_plan
from support.simulated_rigs import ONE_EACH, off_by

from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import inverse, look_at, transform
from planning.model.devices.planned import PlannedCamera
from planning.verify.board_images.board import Board, board_poses
from planning.verify.board_images.chosen_images import plan_images
from planning.verify.board_images.device_errors import (
    N_ERRORS,
    known_before,
    shifts_of,
)
from planning.verify.board_images.information import board_image
from planning.verify.board_images.point_errors import point_errors

UP = np.array([0.0, 1.0, 0.0])
BENT = PinholeModel(
    np.array([[1800.0, 0.0, 630.0], [0.0, 1795.0, 500.0], [0.0, 0.0, 1.0]]),
    (1280, 1024),
    (0.3, 2.0),
    (-0.1, 0.05, 1e-3, -5e-4, 0.0),
)
BEAM = ParallelModel((1024, 768), 5e-4, (0.3, 2.0))
STEP = 1e-5
BOARD, SMALL = Board((0.08, 0.06), (6, 5)), Board((0.02, 0.015), (4, 3))
MARK_PX = 0.2


def camera(optics, pose=None):
    eye = look_at(np.array([0.3, 0.2, 0.9]), np.zeros(3), UP) if pose is None else pose
    return PlannedCamera("C1", eye, optics)


def image_of(device, points, error=(0.0, 0.0, 0.0)):
    """Pixels of points; a beam has its optics' error apart."""
    local = transform(inverse(device.world_from_device), points)
    if isinstance(device.device, PinholeModel):
        return device.device.project(local)
    shift = np.array(error[1:])
    return local[:, :2] / device.device.pixel_pitch_m * (1.0 + error[0]) + shift


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(1).uniform(-0.04, 0.04, (20, 3))


@pytest.mark.parametrize("optics", [BENT, BEAM], ids=["lens", "beam"])
@pytest.mark.parametrize("k", range(9))
def test_errors_shift_the_image_as_a_device_that_is_off_does(points, optics, k):
    device = camera(optics)
    # That one's turn and displacement are in its own axes.
    own = np.zeros(N_ERRORS)
    own[k] = STEP
    turn = device.world_from_device[:3, :3]
    own[:3], own[3:6] = turn @ own[:3], turn @ own[3:6]
    there, here = (off_by(device, s * STEP * ONE_EACH[k]) for s in (1.0, -1.0))
    shift = 0.5 * (
        image_of(there[0], points, there[1]) - image_of(*(here[0], points, here[1]))
    )
    expected = shifts_of(device, points).pixels @ own
    assert shift == pytest.approx(expected, rel=1e-5, abs=1e-7)


def test_k1_shifts_the_image_as_it_is_defined(points):
    k1, *others = BENT.distortion
    bent = replace(BENT, distortion=(k1 + 1e-4, *others))
    shift = image_of(camera(bent), points) - image_of(camera(BENT), points)
    expected = 1e-4 * shifts_of(camera(BENT), points).pixels[:, :, 9]
    assert shift == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("optics", [BENT, BEAM], ids=["lens", "beam"])
def test_a_footprint_is_what_a_pixel_moves_the_ray_by(points, optics):
    shifts = shifts_of(camera(optics), points)
    moved = points + 1e-2 * shifts.footprints[:, :, 1]
    pixels = image_of(camera(optics), moved) - image_of(camera(optics), points)
    assert pixels == pytest.approx(np.tile([0.0, 1e-2], (20, 1)), abs=1e-5)


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(request):
    return build_plan(request.param)


@pytest.fixture(scope="module")
def errors(plan):
    return point_errors(plan, n_samples=300, threads=1)


def test_motion_of_the_whole_rig_moves_points_against_it_and_no_shape(plan, errors):
    devices = (*plan.projectors, *plan.cameras)
    turn, shift = np.array([1e-3, -2e-3, 5e-4]), np.array([1e-4, 3e-4, -2e-4])
    motion = np.zeros(errors.by_errors.shape[1])
    for k, device in enumerate(devices):
        place = device.world_from_device[:3, 3]
        rows = slice(N_ERRORS * k, N_ERRORS * k + 6)
        motion[rows] = [*turn, *(shift + np.cross(turn, place))]
    moved = -np.sum(errors.normals * (shift + np.cross(turn, errors.points)), axis=1)
    assert errors.by_errors @ motion == pytest.approx(moved, abs=1e-12)
    of_shape, settled = errors.settled(devices)
    assert of_shape @ motion == pytest.approx(0.0, abs=1e-9)
    assert settled @ motion == pytest.approx(0.0, abs=1e-9)


def test_devices_that_are_off_alone_do_what_the_plan_is_told(plan):
    stated = plan.to_document()
    stated["requirements"]["triangulation"] |= {
        "calibration": {
            **{"angle": 3e-4, "position_m": 5e-5},
            **{"focal": 2e-4, "principal_px": 0.3},
        },
        "accuracy_of": "noise",
    }
    plan = type(plan).from_document(stated, plan.surface)
    errors = point_errors(plan, n_samples=300, threads=1)
    left = plan.requirements.triangulation.calibration
    each = np.repeat(
        [left.about_axis, left.along_axis_m, left.focal, left.along_line_px, 0.0],
        [3, 3, 1, 2, 1],
    )
    each = np.tile(each, len(plan.projectors) + len(plan.cameras))
    alone = np.sqrt(np.sum((errors.by_errors * each) ** 2, axis=1))
    assert alone == pytest.approx(errors.stated_m, rel=1e-6)


def everywhere_sharp(plan):
    return tuple(
        replace(device, device=replace(device.device, range_m=(0.1, 3.0)))
        for device in (*plan.projectors, *plan.cameras)
    )


def seen_whole(plan):
    """An image of which each device has all marks or none."""
    devices = everywhere_sharp(plan)
    space = plan.requirements.workspace
    poses = board_poses(np.array(space.centre), space.object_radius_m, UP)
    marks = SMALL.points()
    told = [
        board_image(devices, plan.requirements, pose, marks, MARK_PX) for pose in poses
    ]
    whole = len(marks)
    return next(
        image
        for image in told
        if set(image.marks) <= {0, whole} and np.sum(image.marks == whole) >= 3
    )


def test_a_pose_that_nobody_knows_is_taken_off(plan):
    image, devices = seen_whole(plan), everywhere_sharp(plan)
    n = N_ERRORS * len(devices)
    places = transform(image.world_from_board, SMALL.points())
    rows = []
    for k, device in enumerate(devices):
        if image.marks[k] == 0:
            continue
        shifts = shifts_of(device, places)
        for inverse_, pixels, place in zip(
            shifts.inverses, shifts.pixels, places, strict=True
        ):
            arm = place - image.world_from_board[:3, 3]
            row = np.zeros((2, n + 6))
            row[:, N_ERRORS * k : N_ERRORS * (k + 1)] = pixels
            row[:, n : n + 3] = inverse_ @ np.cross(np.eye(3), arm).T
            row[:, n + 3 :] = inverse_
            rows.append(row / MARK_PX)
    whole = np.concatenate(rows).T @ np.concatenate(rows)
    whole[:n, :n] += known_before(devices)
    alone = np.linalg.inv(known_before(devices) + image.told)
    assert alone == pytest.approx(np.linalg.inv(whole)[:n, :n], rel=1e-4, abs=1e-12)


def test_chosen_images_do_with_any_one_set_aside(plan, errors):
    found = plan_images(
        *(plan, BOARD),
        mark_px=MARK_PX,
        limit_m=2.5e-4,
        threads=1,
        report=lambda line: None,
    )
    assert found.suffices
    assert len(found.images) >= 2
    devices = (*plan.projectors, *plan.cameras)
    of_shape, _ = found.points.settled(devices)

    def p95(images):
        known = known_before(devices) + sum(image.told for image in images)
        covariance = np.linalg.inv(known)
        variance = np.diag(of_shape @ covariance @ of_shape.T)
        return np.sqrt(np.quantile(variance + found.points.noise_m**2, 0.95))

    assert found.p95_m == pytest.approx(p95(found.images), rel=1e-6)
    without = [
        p95([*found.images[:k], *found.images[k + 1 :]])
        for k in range(len(found.images))
    ]
    assert found.p95_without_m == pytest.approx(max(without), rel=1e-6)
    assert max(without) <= found.limit_m
    # One fewer of them wouldn't have done.
    last = found.images[:-1]
    fewer = [p95([*last[:k], *last[k + 1 :]]) for k in range(len(last))]
    assert max(fewer) > found.limit_m
