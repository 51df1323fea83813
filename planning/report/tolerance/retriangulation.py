"""Where points come to lie that are computed with devices a little off, exactly.

The true projector lights a point through a pixel of its panel, on which the ring of
some coordinate R was drawn; the true camera sees it at a pixel. Computed is where the
viewing ray of that pixel meets the surface of that R, both of the devices as they are
taken to stand. In the ring frame, with o + t d the viewing ray::

    x^2 + y^2 = R^2 z^2  (diverging, z > 0)    x^2 + y^2 = R^2  (parallel)

a quadratic in t, of which the root nearest to the point's own distance is taken. Of
coded pixels it is where the viewing ray comes nearest to the light of the pixel told.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import inverse, transform
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene.lights import light_of

from .drawn_rigs import moved_pose

_Array = NDArray[np.float64]


def retriangulated(
    points: _Array,
    projector: PlannedProjector,
    camera: PlannedCamera,
    off: tuple[_Array, _Array],
    *,
    edge_px: _Array | float = 0.0,
    ring_m: _Array | float = 0.0,
) -> _Array:
    """Return where points (n, 3) are taken to be, NaN where a ray meets no ring.

    Args:
        points: Where they are [m].
        projector: As it is taken to stand.
        camera: As it is taken to stand.
        off: By what each truly differs, (9,) numbers of `drawn_rigs`.
        edge_px: How far the edge is off in the image [px], (n, 2).
        ring_m: How far the surface of equal code is off along its normal [m], (n,).
    """
    light = light_of(projector.device)
    drawn = _on_panel(projector, off[0], points)
    pose = camera.world_from_device
    pixels = _off_pixels(camera.device, _in_true(pose, off[1], points), off[1])
    rays = camera.device.rays(pixels + edge_px) @ pose[:3, :3].T
    if projector.code is not None:
        beams = light.directions(projector.world_from_device, drawn)
        reach = _nearest_approach(pose[:3, 3], rays, drawn, beams, ring_m)
        return pose[:3, 3] + reach[:, None] * rays
    in_ring = inverse(projector.world_from_ring)
    rings = light.ring_surface(transform(in_ring, drawn))
    coordinate = rings.coordinate
    if np.any(ring_m):
        coordinate = coordinate + ring_m / rings.stretch
    reach = _nearest_root(
        transform(in_ring, pose[None, :3, 3])[0],
        rays @ in_ring[:3, :3].T,
        coordinate,
        projector.light == "parallel",
        np.linalg.norm(points - pose[:3, 3], axis=1),
    )
    return pose[:3, 3] + reach[:, None] * rays


def _nearest_approach(
    origin: _Array, rays: _Array, drawn: _Array, beams: _Array, off_m: _Array | float
) -> _Array:
    """Where rays cross the surfaces through light that they cross most squarely, (n,).

    NaN where they run along the light.
    """
    across = rays - np.einsum("ij,ij->i", rays, beams)[:, None] * beams
    sine = np.linalg.norm(across, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        m = across / sine[:, None]
        return (np.einsum("ij,ij->i", drawn - origin, m) + off_m) / sine


def _in_true(pose: Array, off: _Array, points: _Array) -> _Array:
    return transform(inverse(moved_pose(pose, off)), points)


def _off_pixels(device: PinholeModel, local: _Array, off: _Array) -> _Array:
    """Pixels of points in the frame of optics that are off."""
    middle = device.camera_matrix[:2, 2]
    return (device.project(local) - middle) * (1.0 + off[6]) + middle + off[7:]


def _on_panel(projector: PlannedProjector, off: _Array, points: _Array) -> _Array:
    """Points of the light that is taken to leave the pixels that light points."""
    pose, device = projector.world_from_device, projector.device
    local = _in_true(pose, off, points)
    if isinstance(device, ParallelModel):
        local[:, :2] = local[:, :2] * (1.0 + off[6]) + device.pixel_pitch_m * off[7:]
        return transform(pose, local)
    far = np.linalg.norm(local, axis=1)[:, None]
    return transform(pose, far * device.rays(_off_pixels(device, local, off)))


def _nearest_root(
    origin: _Array, rays: _Array, coordinate: _Array, parallel: bool, reach: _Array
) -> _Array:
    """The root of a t^2 + 2 b t + c = 0 nearest to a reach, NaN for none, (n,)."""
    square = np.square(coordinate)
    weights = np.ones((len(rays), 3))
    weights[:, 2] = 0.0 if parallel else -square
    a = np.einsum("ij,ij->i", weights, rays * rays)
    b = np.einsum("ij,ij->i", weights, rays * origin)
    c = weights @ (origin * origin) - (square if parallel else 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Of both roots none loses digits this way.
        q = -(b + np.copysign(np.sqrt(b * b - a * c), b))
        roots = np.stack([q / a, c / q])
    away = np.where(np.isfinite(roots), np.abs(roots - reach), np.inf)
    best = np.take_along_axis(roots, away.argmin(axis=0)[None], axis=0)[0]
    return np.where(np.isfinite(away.min(axis=0)), best, np.nan)
