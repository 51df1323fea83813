"""What becomes of each ring: drawn, landed on the object, seen, measured.

The paper's false projections, and what its lens cuts off, by rays of the truth.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.check.accuracy import share_of
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

# Places on a ring, and how near a measured point makes one measured [m].
_PLACES = 1440
_NEAR_M = 1.0e-3
# Rays to a camera leave the surface this far off, as a share of their length.
_SLACK = 1e-5


@dataclass(frozen=True)
class RingOutcome:
    """Shares of one ring's circumference.

    Attributes:
        projector: Id of the projector.
        ring: Number of the ring, from 0.
        on_object: Drawn in the panel and landed on the object.
        seen: Of it, what each camera's image shows; by camera id.
        measured: Of it, what each camera measured; by camera id.
        measured_by_any: Of it, what some camera measured.
    """

    projector: str
    ring: int
    on_object: float
    seen: dict[str, float]
    measured: dict[str, float]
    measured_by_any: float


def ring_outcomes(scanner: Scanner, cloud: Cloud) -> tuple[RingOutcome, ...]:
    """Return what became of every ring of every projector, by a cloud of theirs."""
    caster = RayCaster(scanner.mesh, threads=1)
    cameras = scanner.cameras
    outcomes: list[RingOutcome] = []
    for p, projector in enumerate(scanner.projectors):
        for k, radius in enumerate(projector.pattern.radii):
            points, normals = _landed(projector, float(radius), caster)
            seen = [_shows(camera, points, normals, caster) for camera in cameras]
            got = [
                _measured(cloud, (p, c, k), points) & shown
                for c, shown in enumerate(seen)
            ]
            outcomes.append(
                RingOutcome(
                    projector.id,
                    k,
                    len(points) / _PLACES,
                    {one.id: share_of(s) for one, s in zip(cameras, seen, strict=True)},
                    {one.id: share_of(m) for one, m in zip(cameras, got, strict=True)},
                    share_of(np.any(got, axis=0)),
                )
            )
    return tuple(outcomes)


def lit_and_seen(scanner: Scanner, points: Array, normals: Array) -> Mask:
    """Return which points (n, 3) some ring pattern lights and some camera shows.

    What could be measured at all: inside the outermost ring of a projector, facing it
    and a camera, neither hidden.
    """
    caster = RayCaster(scanner.mesh, threads=1)
    lit = [_lights(one, points, normals, caster) for one in scanner.projectors]
    seen = [_shows(one, points, normals, caster) for one in scanner.cameras]
    return np.any(lit, axis=0) & np.any(seen, axis=0)


def _landed(
    projector: ProjectorCalibration, radius: float, caster: RayCaster
) -> tuple[Array, Array]:
    """Points and normals of the object that a ring falls on, (n, 3) each."""
    turn = np.arange(_PLACES) * (2.0 * np.pi / _PLACES)
    flat = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    starts, beams = projector.light.rays(flat, projector.world_from_ring)
    faces, away = caster.first_hits(starts, beams)
    points = starts + np.where(faces >= 0, away, 1.0)[:, None] * beams
    landed = (faces >= 0) & projector.in_panel(projector.panel(points)[0])
    return points[landed], caster.mesh.face_normals[faces[landed]]


def _lights(
    projector: ProjectorCalibration, points: Array, normals: Array, caster: RayCaster
) -> Mask:
    """Whether a ring pattern falls on points of the surface, (n,)."""
    pixels, _ = projector.panel(points)
    _, beams, away = projector.aim(points)
    lit = projector.in_panel(pixels)
    lit &= projector.ring_coordinate(points) <= projector.pattern.radii[-1]
    lit &= np.einsum("ij,ij->i", normals, beams) < 0.0
    return lit & ~_blocked(points, -beams, away, caster)


def _shows(
    camera: CameraCalibration, points: Array, normals: Array, caster: RayCaster
) -> Mask:
    """Whether a camera's image shows points of the surface, (n,)."""
    u, v = camera.project(points).T
    width, height = camera.resolution
    inside = (u >= -0.5) & (u <= width - 0.5) & (v >= -0.5) & (v <= height - 0.5)
    towards = camera.centre - points
    away = np.linalg.norm(towards, axis=1)
    towards /= away[:, None]
    inside &= np.einsum("ij,ij->i", normals, towards) > 0.0
    return inside & ~_blocked(points, towards, away, caster)


def _blocked(points: Array, towards: Array, away: Array, caster: RayCaster) -> Mask:
    """Whether the object lies between its points and a device, (n,)."""
    slack = _SLACK * away
    reach = np.maximum(away - 2.0 * slack, 0.0)
    return caster.occluded(points + slack[:, None] * towards, towards, reach)


def _measured(cloud: Cloud, which: tuple[int, int, int], points: Array) -> Mask:
    """Whether places of a ring have a point of that projector, camera and ring."""
    p, c, k = which
    of_ring = (cloud.projector == p) & (cloud.camera == c) & (cloud.ring == k)
    if not of_ring.any() or len(points) == 0:
        return np.zeros(len(points), dtype=bool)
    tree = KDTree(cloud.points[of_ring])
    apart, _ = tree.query(points, distance_upper_bound=_NEAR_M)
    return np.isfinite(apart)
