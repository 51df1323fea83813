"""Rigs that aren't where they are taken to be, and what they then measure."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.devices import ParallelModel
from geometry.poses import inverse, transform
from planning.model.devices.calibration_errors import CalibrationErrors

# Turn about the device's axes, displacement along them, focal length, principal point.
ONE_EACH = np.eye(9)
_SETTLED = 1e-8


def scales(errors: CalibrationErrors):
    """Return the standard deviation of each of the nine errors of a device."""
    return np.array(
        [errors.about_axis] * 3
        + [errors.along_axis_m] * 3
        + [errors.focal]
        + [errors.along_line_px] * 2
    )


def off_by(device, error):
    """Return a projector or camera that is off by nine errors; rings stay as drawn."""
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(error[:3]).as_matrix()
    turn[:3, 3] = error[3:6]
    pose = device.world_from_device @ turn
    model = device.device
    if isinstance(model, ParallelModel):
        return replace(device, world_from_device=pose), error[6:]
    matrix = model.camera_matrix.copy()
    matrix[[0, 1], [0, 1]] *= 1.0 + error[6]
    matrix[:2, 2] += error[7:]
    model = replace(model, camera_matrix=matrix)
    return replace(device, world_from_device=pose, device=model), error[6:]


def triangulated(points, projector, camera, true_projector, true_camera, noise_px=0.0):
    """Return where a rig taken to be as planned puts points that the true one sees.

    Each on its viewing ray, by Newton's method, where the ring is that lit it; NaN
    where the ray passes that ring by.
    """
    source, error = true_projector
    drawn = _drawn(projector, source, error, points)
    ring = _coordinate(projector, drawn)
    eye, _ = true_camera
    pixels = eye.device.project(transform(inverse(eye.world_from_device), points))
    pose = camera.world_from_device
    rays = camera.device.rays(pixels + noise_px) @ pose[:3, :3].T
    reach = np.linalg.norm(points - pose[:3, 3], axis=1)
    step, most = 1e-6, 5e-3
    for _ in range(30):
        there = pose[:3, 3] + reach[:, None] * rays
        miss = _coordinate(projector, there) - ring
        slope = (_coordinate(projector, there + step * rays) - ring - miss) / step
        with np.errstate(divide="ignore", invalid="ignore"):
            last = np.nan_to_num(miss / slope)
        reach = reach - np.clip(last, -most, most)
    reach[np.abs(last) > _SETTLED] = np.nan
    return pose[:3, 3] + reach[:, None] * rays


def _drawn(projector, source, error, points):
    """Return points of the planned projector's light through the same panel pixels."""
    local = transform(inverse(source.world_from_device), points)
    if isinstance(source.device, ParallelModel):
        pitch = source.device.pixel_pitch_m
        local[:, :2] = local[:, :2] / (1.0 + error[0]) - pitch * error[1:]
        return transform(projector.world_from_device, local)
    pixels = source.device.project(local)
    rays = projector.device.rays(pixels)
    return transform(projector.world_from_device, rays)


def _coordinate(projector, points):
    """Return the ring coordinate by its definition."""
    x, y, z = transform(inverse(projector.world_from_ring), points).T
    rho = np.hypot(x, y)
    return rho if projector.light == "parallel" else rho / z
