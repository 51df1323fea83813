"""How far measured points may be off because devices aren't where they are taken to be.

By differences, so that nothing is derived twice: with R(P) the coordinate of the ring
through P, a viewing ray that is off by dX at P, and rings that are off by dR there,
move the point along its normal by::

    N.(dX - r (grad R . dX) / (grad R . r)),    N.r dR / (grad R . r)
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from planning.model.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    PairCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

# Steps small enough for the first order, large enough for double precision.
_SHARE, _STEP_M = 0.1, 1e-6
_Device = TypeVar("_Device", CameraCalibration, ProjectorCalibration)


def calibration_sigma(cloud: Cloud, normals: Array, scanner: Scanner) -> Array:
    """Return what the calibration leaves of each point, along its normal [m], (n,).

    Where the normal isn't known, (n, 3) with NaN, along its viewing ray.
    """
    errors = scanner.calibration
    sigma = np.zeros(len(cloud))
    if errors is None:
        return sigma
    known = np.isfinite(normals[:, :1])
    towards = np.where(known, normals, -cloud.rays)
    for (p, c), pair in scanner.pairs():
        rows = np.flatnonzero((cloud.projector == p) & (cloud.camera == c))
        if len(rows):
            sigma[rows] = _of_pair(cloud.take(rows), towards[rows], pair, errors)
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
        reach = np.linalg.norm(cloud.points[rows] - camera.centre, axis=1)
        aside = cloud.pixels[rows] - camera.matrix[:2, 2]
        turned = np.hypot(errors.about_axis, errors.along_axis_m / reach)
        longer = errors.focal**2 * np.square(aside).sum(axis=1) / 2.0
        square = (camera.focal_px * turned) ** 2 + longer + errors.along_line_px**2
        moved[rows] = np.sqrt(square)
    return moved


def _of_pair(
    cloud: Cloud, normals: Array, pair: PairCalibration, errors: CalibrationErrors
) -> Array:
    points, rays = cloud.points, cloud.rays
    ring = pair.projector.ring_coordinate
    gradient = np.column_stack(
        [
            (ring(points + axis) - ring(points - axis)) / (2.0 * _STEP_M)
            for axis in _STEP_M * np.eye(3)
        ]
    )
    along = np.einsum("ij,ij->i", gradient, rays)
    facing = np.einsum("ij,ij->i", normals, rays)
    reach = np.linalg.norm(points - pair.camera.centre, axis=1)[:, None]
    variance = np.zeros(len(cloud))
    for camera in _off(pair.camera, errors):
        moved = camera.centre - pair.camera.centre
        moved = moved + reach * (camera.rays(cloud.pixels) - rays)
        slid = facing * np.einsum("ij,ij->i", gradient, moved) / along
        variance += (np.einsum("ij,ij->i", normals, moved) - slid) ** 2
    for projector in _off(pair.projector, errors):
        pixels, _ = projector.panel(points)
        drawn = np.linalg.norm(pair.projector.ring_plane(pixels), axis=1)
        variance += (facing * (drawn - ring(points)) / along) ** 2
    return np.sqrt(variance) / _SHARE


def _off(device: _Device, errors: CalibrationErrors) -> Iterator[_Device]:
    """Yield the device with each of its errors, a share of its deviation."""
    pose, matrix = device.world_from_device, device.matrix
    for axis in np.eye(3):
        turn, shift = np.eye(4), np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(
            _SHARE * errors.about_axis * axis
        ).as_matrix()
        shift[:3, 3] = _SHARE * errors.along_axis_m * axis
        yield replace(device, world_from_device=pose @ turn)
        yield replace(device, world_from_device=pose @ shift)
    longer = matrix.copy()
    longer[[0, 1], [0, 1]] *= 1.0 + _SHARE * errors.focal
    yield replace(device, matrix=longer)
    for row in (0, 1):
        off_centre = matrix.copy()
        off_centre[row, 2] += _SHARE * errors.along_line_px
        yield replace(device, matrix=off_centre)
