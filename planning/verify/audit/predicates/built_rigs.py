"""Rigs that stand beside their plan, and where they then take points to be."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from geometry.devices import PinholeModel
from planning.model.devices.calibration_errors import PERFECT, Mounting
from planning.model.document.device_records import CameraRecord, ProjectorRecord
from planning.model.plan import RigPlan

from .audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_cameras,
    audit_projectors,
)
from .audit_optics import dot, in_frame, in_world, pixels_of, rays_of

_Record = TypeVar("_Record", ProjectorRecord, CameraRecord)
# Newton's steps along a ray, none longer than this, and where they have settled [m].
_STEPS, _LONGEST, _SETTLED = 30, 5e-3, 1e-9


@dataclass(frozen=True, eq=False)
class BuiltRig:
    """A rig as it is known to stand, and by what its devices truly differ.

    Attributes:
        plan: The plan with its devices as they are known to stand.
        unknown: Of each device, projectors first, displacement, turn, focal length
            and principal point, shape (n, 9) [m, rad, 1, px].
    """

    plan: RigPlan
    unknown: Array

    @cached_property
    def projectors(self) -> tuple[AuditProjector, ...]:
        """As they are known to stand."""
        return audit_projectors(self.plan)

    @cached_property
    def cameras(self) -> tuple[AuditCamera, ...]:
        """As they are known to stand."""
        return audit_cameras(self.plan)


def built_rig(plan: RigPlan, mounting: Mounting, rng: np.random.Generator) -> BuiltRig:
    """Draw a rig that is mounted within bounds and calibrated as the plan states."""
    left = plan.requirements.triangulation.calibration or PERFECT
    document = plan.document
    projectors = tuple(_mounted(r, mounting, rng) for r in document.projectors)
    cameras = tuple(_mounted(r, mounting, rng) for r in document.cameras)
    place, turn = left.position_m / np.sqrt(3.0), left.angle / np.sqrt(3.0)
    pixel = left.principal_px / np.sqrt(2.0)
    sizes = np.array([place] * 3 + [turn] * 3 + [left.focal] + [pixel] * 2)
    unknown = sizes * rng.standard_normal((len(projectors) + len(cameras), 9))
    moved = document.changed(projectors=projectors, cameras=cameras)
    return BuiltRig(RigPlan(moved, plan.surface), unknown)


def retriangulated(
    points: Array,
    projector: AuditProjector,
    camera: AuditCamera,
    unknown: tuple[Array, Array],
    edge_px: Array,
    ring_m: Array,
) -> Array:
    """Return where points (n, 3) are taken to be, NaN where Newton's method fails.

    The ray of the pixel at which the true camera sees a point, in the known one, with
    the ring that the known projector draws where the true one lights it.
    """
    drawn = _drawn(projector, unknown[0], points)
    pose, device = camera.world_from_device, camera.device
    seen = in_frame(_off(pose, unknown[1]), points)
    pixels = _shifted(pixels_of(device, seen), device, unknown[1]) + edge_px
    rays = in_world(pose, rays_of(device, pixels))
    if projector.code is not None:
        light, _ = projector.light.to_points(drawn)
        return pose[:3, 3] + _met(drawn - pose[:3, 3], rays, light, ring_m) * rays
    rings = projector.ring_coordinate(drawn)
    rings = rings + ring_m * np.linalg.norm(projector.ring_gradient(drawn), axis=1)
    reach = np.linalg.norm(points - pose[:3, 3], axis=1)
    step = np.zeros_like(reach)
    for _ in range(_STEPS):
        there = pose[:3, 3] + reach[:, None] * rays
        slope = dot(projector.ring_gradient(there), rays)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = (projector.ring_coordinate(there) - rings) / slope
        step = np.clip(np.nan_to_num(step), -_LONGEST, _LONGEST)
        reach = reach - step
    reach[np.abs(step) > _SETTLED] = np.nan
    return pose[:3, 3] + reach[:, None] * rays


def _met(way: Array, rays: Array, light: Array, off_m: Array) -> Array:
    """Return how far along rays the closest approach to lines of light lies, (n, 1).

    The lines pass the places that lie `way` from where the rays begin, moved by `off_m`
    towards where the rays go.
    """
    c = dot(rays, light)
    square = 1.0 - c * c
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (dot(way, rays) - c * dot(way, light)) / square
        return (along + off_m / np.sqrt(square))[:, None]


def _drawn(projector: AuditProjector, unknown: Array, points: Array) -> Array:
    """Points of the known light through the pixels by which the true one lights."""
    pose, device = projector.world_from_device, projector.device
    local = in_frame(_off(pose, unknown), points)
    if isinstance(device, PinholeModel):
        pixels = _shifted(pixels_of(device, local), device, unknown)
        far = np.linalg.norm(local, axis=1)[:, None]
        local = far * rays_of(device, pixels)
    else:
        local[:, :2] *= 1.0 + unknown[6]
        local[:, :2] += device.pixel_pitch_m * unknown[7:]
    return pose[:3, 3] + in_world(pose, local)


def _shifted(pixels: Array, device: PinholeModel, unknown: Array) -> Array:
    middle = device.camera_matrix[:2, 2]
    return middle + (1.0 + unknown[6]) * (pixels - middle) + unknown[7:]


def _off(pose: Array, moved: Array) -> Array:
    """A pose displaced and turned in its own axes by (6,) and more numbers."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(moved[3:6]).as_matrix()
    motion[:3, 3] = moved[:3]
    return pose @ motion


def _mounted(record: _Record, mounting: Mounting, rng: np.random.Generator) -> _Record:
    bounds = [mounting.position_m] * 3 + [mounting.angle] * 3 + [mounting.focal]
    by = np.array(bounds) * rng.uniform(-1.0, 1.0, 7)
    if record.existing:
        return record
    pose = np.array(record.world_from_device)
    there = _off(pose, by)
    changes: dict[str, object] = {"world_from_device": _rows(there)}
    if isinstance(record, ProjectorRecord):
        motion = there @ np.linalg.inv(pose)
        changes["world_from_ring"] = _rows(motion @ np.array(record.world_from_ring))
        if record.pixel_pitch_m is not None:
            changes["pixel_pitch_m"] = record.pixel_pitch_m * (1.0 + by[6])
    if record.K is not None:
        matrix = np.array(record.K)
        matrix[[0, 1], [0, 1]] *= 1.0 + by[6]
        changes["K"] = _rows(matrix)
    return record.changed(**changes)


def _rows(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())
