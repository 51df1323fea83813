"""How far measured points may be off because devices aren't where they are taken to be.

By differences, so that nothing is derived twice: with R(P) the coordinate of the ring
through P, a viewing ray that is off by dX at P, and rings that are off by dR there,
move the point along its normal by::

    N.(dX - r (grad R . dX) / (grad R . r)),    N.r dR / (grad R . r)
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import lengths
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

# Steps small enough for the first order, large enough for double precision.
_SHARE, _STEP_M = 0.1, 1e-6
_Device = TypeVar("_Device", CameraCalibration, ProjectorCalibration)


def calibration_sigma(cloud: Cloud, normals: Array, scanner: Scanner) -> Array:
    """Return what the calibration leaves of each point, along its normal [m], (n,).

    Where the normal isn't known, (n, 3) with NaN, along its viewing ray. After an
    adjustment it is that one's covariance that counts.
    """
    sigma = np.zeros(len(cloud))
    covariance = scanner.covariance
    if covariance is None and scanner.calibration is not None:
        n = len(scanner.cameras) + len(scanner.projectors)
        covariance = np.diag(np.tile(_deviations(scanner.calibration), n) ** 2)
    if covariance is None:
        return sigma
    known = np.isfinite(normals[:, :1])
    towards = np.where(known, normals, -cloud.rays)
    of_rings, n_cameras = cloud.ring >= 0, len(scanner.cameras)
    for (p, c), pair in scanner.pairs():
        own = (cloud.projector == p) & (cloud.camera == c) & (cloud.ring > -2)
        devices = [9 * k + np.arange(9) for k in (c, n_cameras + p)]
        for some, measure in ((of_rings, _of_pair), (~of_rings, _of_codes)):
            rows = np.flatnonzero(own & some)
            if len(rows):
                both = np.ix_(np.concatenate(devices), np.concatenate(devices))
                two = (pair.camera, pair.projector)
                part = cloud.take(rows), towards[rows]
                sigma[rows] = measure(*part, *two, covariance[both])
    for c, camera in enumerate(scanner.cameras):
        for k, second in enumerate(scanner.cameras):
            rows = np.flatnonzero((cloud.camera == c) & (cloud.by_camera == k))
            if len(rows):
                both = np.concatenate([9 * i + np.arange(9) for i in (c, k)])
                part = cloud.take(rows), towards[rows]
                among = covariance[np.ix_(both, both)]
                sigma[rows] = _of_codes(*part, camera, second, among)
    return sigma


def camera_px(cloud: Cloud, scanner: Scanner) -> Array:
    """Return how far what the calibration leaves of a camera moves an edge [px], (n,).

    Along any line of the image; f in [px], t the distance, u - u_0 from the centre::

        s_e^2 = (f s_a)^2 + (f s_x / t)^2 + s_f^2 |u - u_0|^2 / 2 + s_u^2
    """
    errors, moved = scanner.calibration, np.zeros(len(cloud))
    if errors is None:
        return moved
    for c, camera in enumerate(scanner.cameras):
        rows = np.flatnonzero(cloud.camera == c)
        reach = lengths(cloud.points[rows] - camera.centre)
        aside = cloud.pixels[rows] - camera.matrix[:2, 2]
        turned = np.hypot(errors.about_axis, errors.along_axis_m / reach)
        longer = errors.focal**2 * np.square(aside).sum(axis=1) / 2.0
        square = (camera.focal_px * turned) ** 2 + longer + errors.along_line_px**2
        moved[rows] = np.sqrt(square)
    return moved


def _deviations(errors: CalibrationErrors) -> Array:
    """Standard deviations of a device's nine errors."""
    each = (errors.about_axis, errors.along_axis_m, errors.focal, errors.along_line_px)
    return np.repeat(each, (3, 3, 1, 2))


def _of_pair(
    cloud: Cloud,
    normals: Array,
    camera: CameraCalibration,
    projector: ProjectorCalibration,
    covariance: Array,
) -> Array:
    """Standard deviation of ring points by camera and projector, (18, 18)."""
    ring = projector.ring_coordinate

    def told(off: ProjectorCalibration) -> Array:
        pixels, _ = off.panel(cloud.points)
        return lengths(projector.ring_plane(pixels))

    return _moved(cloud, normals, camera, projector, covariance, ring, told)


def _of_codes(
    cloud: Cloud,
    normals: Array,
    camera: CameraCalibration,
    second: _Device,
    covariance: Array,
) -> Array:
    """Standard deviation of coded points by camera and second device, (18, 18).

    What tells the depth is where a point is on the second device's image along its
    epipolar line.
    """
    line = _seen(second, cloud.points + _STEP_M * cloud.rays)
    line -= _seen(second, cloud.points - _STEP_M * cloud.rays)
    line /= lengths(line)[:, None]

    def along(points: Array) -> Array:
        return np.einsum("ij,ij->i", line, _seen(second, points))

    def told(off: _Device) -> Array:
        return np.einsum("ij,ij->i", line, _seen(off, cloud.points))

    return _moved(cloud, normals, camera, second, covariance, along, told)


def _seen(device: CameraCalibration | ProjectorCalibration, points: Array) -> Array:
    """Pixels (n, 2) of points (n, 3) in the image of a device."""
    if isinstance(device, CameraCalibration):
        return device.project(points)
    return device.panel(points)[0]


def _moved(
    cloud: Cloud,
    normals: Array,
    camera: CameraCalibration,
    second: _Device,
    covariance: Array,
    coordinate: Callable[[Array], Array],
    told: Callable[[_Device], Array],
) -> Array:
    """Standard deviation by the errors of two devices, (18, 18).

    Args:
        cloud: Points of both.
        normals: Along which, shape (n, 3).
        camera: Whose viewing rays they lie on.
        second: That tells where.
        covariance: Of the errors of both.
        coordinate: What the second one measures of points (n, 3).
        told: What a second one with an error would say of the points.
    """
    points, rays = cloud.points, cloud.rays
    gradient = np.column_stack(
        [
            (coordinate(points + axis) - coordinate(points - axis)) / (2.0 * _STEP_M)
            for axis in _STEP_M * np.eye(3)
        ]
    )
    along = np.einsum("ij,ij->i", gradient, rays)
    facing = np.einsum("ij,ij->i", normals, rays)
    reach = lengths(points - camera.centre)[:, None]
    steps = _SHARE * np.sqrt(np.diag(covariance))
    moves: list[Array] = []
    for off in _off(camera, steps[:9]):
        moved = off.centre - camera.centre
        moved = moved + reach * (off.rays(cloud.pixels) - rays)
        slid = facing * np.einsum("ij,ij->i", gradient, moved) / along
        moves.append(np.einsum("ij,ij->i", normals, moved) - slid)
    known = coordinate(points)
    for off in _off(second, steps[9:]):
        moves.append(facing * (told(off) - known) / along)
    by_unit = np.stack(moves, axis=1) / np.where(steps > 0.0, steps, 1.0)
    variance = np.einsum("ij,jk,ik->i", by_unit, covariance, by_unit)
    return np.sqrt(np.maximum(variance, 0.0))


def _off(device: _Device, steps: Array) -> Iterator[_Device]:
    """Yield the device with each of nine errors by itself."""
    pose = device.world_from_device
    for k, step in enumerate(steps.tolist()):
        error, moved, matrix = np.eye(9)[k] * step, np.eye(4), device.matrix.copy()
        moved[:3, :3] = Rotation.from_rotvec(error[:3]).as_matrix()
        moved[:3, 3] = error[3:6]
        matrix[[0, 1], [0, 1]] *= 1.0 + error[6]
        matrix[:2, 2] += error[7:]
        yield replace(device, world_from_device=pose @ moved, matrix=matrix)
