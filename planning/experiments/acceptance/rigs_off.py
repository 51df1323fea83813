"""Rigs that a calibration may have left, and where they put what was measured."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.dense.two_rays import meet_rays
from planning.verify.reconstruction.decode.triangulate import intersect_rings
from planning.verify.reconstruction.scanner import Scanner

_Device = TypeVar("_Device", CameraCalibration, ProjectorCalibration)


def drawn(
    scanner: Scanner, errors: CalibrationErrors, rng: np.random.Generator
) -> Scanner:
    """Return a rig as a calibration may take it to stand: every device off by itself.

    Normal errors about each axis, along each axis, of the focal length or the panel's
    scale, and of the principal point along either side of the image.
    """
    return replace(
        scanner,
        projectors=tuple(_off(one, errors, rng) for one in scanner.projectors),
        cameras=tuple(_off(one, errors, rng) for one in scanner.cameras),
    )


def _off(
    device: _Device, errors: CalibrationErrors, rng: np.random.Generator
) -> _Device:
    moved, matrix = np.eye(4), device.matrix.copy()
    turn = errors.about_axis * rng.standard_normal(3)
    moved[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    moved[:3, 3] = errors.along_axis_m * rng.standard_normal(3)
    matrix[[0, 1], [0, 1]] *= 1.0 + errors.focal * rng.standard_normal()
    matrix[:2, 2] += errors.along_line_px * rng.standard_normal(2)
    pose = device.world_from_device @ moved
    if isinstance(device, CameraCalibration):
        return replace(device, world_from_device=pose, matrix=matrix)
    # Rings stay where they are on the panel.
    ring = pose @ np.linalg.inv(device.world_from_device) @ device.world_from_ring
    return replace(device, world_from_device=pose, matrix=matrix, world_from_ring=ring)


def displaced(cloud: Cloud, known: Scanner, taken: Scanner) -> Array:
    """Return how far points move when the rig is taken to be another, (n, 3) [m].

    The pixels of camera and panel stay; of the panel they say what ring is taken to
    have lit the point, or which pixel; of a second camera's image where it shows the
    same code. NaN where the ray then passes that ring by.
    """
    moved = np.zeros_like(cloud.points)
    for (p, c), _ in known.pairs():
        for ring in np.unique(cloud.ring.clip(max=0)):
            rows = np.flatnonzero(
                (cloud.projector == p)
                & (cloud.camera == c)
                & (cloud.ring.clip(max=0) == ring)
            )
            if len(rows):
                part = cloud.take(rows)
                place = _places(part, known, (p, c))
                moved[rows] = place(taken) - place(known)
    return moved


def _places(
    cloud: Cloud, known: Scanner, pair: tuple[int, int]
) -> Callable[[Scanner], Array]:
    """Return what puts points of one pair and kind where a rig has them."""
    p, c = pair
    lit, _ = known.projectors[p].panel(cloud.points)
    if cloud.ring[0] >= 0:
        return lambda rig: _on_rings(cloud, lit, rig.projectors[p], rig.cameras[c])
    if cloud.ring[0] == -1:
        sure = np.ones_like(lit)
        return lambda rig: (
            meet_rays(
                rig.cameras[c].centre,
                rig.cameras[c].rays(cloud.pixels),
                lit,
                sure,
                rig.projectors[p],
            ).points
        )
    other = int(cloud.by_camera[0])
    seen = known.cameras[other].project(cloud.points)
    return lambda rig: _between(rig.cameras[c], cloud.pixels, rig.cameras[other], seen)


def _between(
    one: CameraCalibration, pixels: Array, other: CameraCalibration, seen: Array
) -> Array:
    """Where rays of one camera come nearest to those of another, (n, 3)."""
    r, d = one.rays(pixels), other.rays(seen)
    way, cosine = other.centre - one.centre, np.einsum("ij,ij->i", r, d)
    along = (r @ way - cosine * (d @ way)) / (1.0 - cosine**2)
    return one.centre + along[:, None] * r


def _on_rings(
    cloud: Cloud, lit: Array, projector: ProjectorCalibration, camera: CameraCalibration
) -> Array:
    return intersect_rings(
        camera.centre,
        camera.rays(cloud.pixels),
        np.linalg.norm(projector.ring_plane(lit), axis=1),
        np.sign(cloud.conditioning).astype(np.int8),
        projector,
    ).points
