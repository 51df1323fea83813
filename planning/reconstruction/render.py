"""What the cameras record, by ray casting against the mesh that really stands there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from geometry.mesh import TriangleMesh
from geometry.rays import RayCaster

from .calibration import CameraCalibration, ProjectorCalibration
from .patterns import Frames, Images, RingPatterns, ring_plane
from .photometry import Photometry

_MARGIN_PX = 6
# Standard deviation of the unit square that a pixel gathers light over.
_PIXEL_SPREAD = 1.0 / np.sqrt(12.0)
# Shadow rays stop this share of their length before the point they ask about.
_SHADOW_SLACK = 2e-5
_SUB = np.array([[-0.25, -0.25], [-0.25, 0.25], [0.25, -0.25], [0.25, 0.25]])


@dataclass(frozen=True, eq=False)
class View:
    """What a camera sees: samples of the surface, one a pixel and 4 at steps of depth.

    Attributes:
        camera: The camera that looks.
        corner: Pixel (u, v) of the window's top-left pixel.
        shape: Rows and columns of the window.
        pixels: Flat index in the window of each sample, shape (n,).
        weights: Share of the pixel that each sample stands for, shape (n,).
        points: Surface points in the world [m], shape (n, 3).
        normals: Face normals there, shape (n, 3).
        rays: Viewing directions, shape (n, 3).
        distances: From the camera [m], shape (n,).
        albedo: Shape (n,).
    """

    camera: CameraCalibration
    corner: tuple[int, int]
    shape: tuple[int, int]
    pixels: NDArray[np.int64]
    weights: NDArray[np.float32]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    rays: NDArray[np.float64]
    distances: NDArray[np.float64]
    albedo: NDArray[np.float32]

    def image(
        self, values: NDArray[np.float32], chosen: NDArray[np.int64] | None = None
    ) -> NDArray[np.float32]:
        """Return the window (h, w) that samples, or some of them, make."""
        pixels, weights = self.pixels, self.weights
        if chosen is not None:
            pixels, weights = pixels[chosen], weights[chosen]
        rows, columns = self.shape
        summed = np.bincount(pixels, weights * values, rows * columns)
        return summed.astype(np.float32).reshape(self.shape)


def view(
    camera: CameraCalibration,
    mesh: TriangleMesh,
    caster: RayCaster,
    photometry: Photometry,
) -> View | None:
    """Cast a camera's pixels against the mesh; None if it sees nothing of it."""
    window = _window(camera, mesh)
    if window is None:
        return None
    (left, top), (rows, columns) = window
    v, u = np.divmod(np.arange(rows * columns), columns)
    grid = np.column_stack([u + left, v + top]).astype(np.float64)
    rays, faces, distances = _cast(camera, caster, grid)
    if not np.any(faces >= 0):
        return None
    steps = _depth_steps(faces, distances, (rows, columns), camera.focal_px)
    whole = np.flatnonzero((faces >= 0) & ~steps)
    split = np.flatnonzero(steps)
    fine = (grid[split][:, None] + _SUB).reshape(-1, 2)
    fine_rays, fine_faces, fine_distances = _cast(camera, caster, fine)
    hit = fine_faces >= 0
    pixels = np.concatenate([whole, np.repeat(split, len(_SUB))[hit]])
    all_rays = np.concatenate([rays[whole], fine_rays[hit]])
    all_faces = np.concatenate([faces[whole], fine_faces[hit]])
    reach = np.concatenate([distances[whole], fine_distances[hit]])
    weights = np.ones(len(pixels), dtype=np.float32)
    weights[len(whole) :] = 1.0 / len(_SUB)
    points = camera.centre + reach[:, None] * all_rays
    return View(
        camera,
        (left, top),
        (rows, columns),
        pixels,
        weights,
        points,
        mesh.face_normals[all_faces],
        all_rays,
        reach,
        photometry.albedo(points),
    )


def _window(
    camera: CameraCalibration, mesh: TriangleMesh
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Corner (u, v) and shape (rows, columns) of the image part that holds the mesh."""
    pixels = camera.project(mesh.corners.reshape(-1, 3))
    low, high = np.array([0, 0]), np.array(camera.resolution) - 1
    if np.all(np.isfinite(pixels)):
        low = np.maximum(low, np.floor(pixels.min(axis=0)).astype(int) - _MARGIN_PX)
        high = np.minimum(high, np.ceil(pixels.max(axis=0)).astype(int) + _MARGIN_PX)
    elif not np.any(np.isfinite(pixels)):
        return None
    columns, rows = (int(side) for side in high - low + 1)
    if columns < 1 or rows < 1:
        return None
    return (int(low[0]), int(low[1])), (rows, columns)


def _cast(
    camera: CameraCalibration, caster: RayCaster, pixels: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    rays = camera.rays(pixels)
    blind = ~np.isfinite(rays[:, 0])
    if blind.any():
        rays[blind] = -camera.world_from_device[:3, 2]
    faces, distances = caster.first_hits(camera.centre, rays)
    faces[blind] = -1
    return rays, faces, distances


def _depth_steps(
    faces: NDArray[np.int64],
    distances: NDArray[np.float64],
    shape: tuple[int, int],
    focal_px: float,
) -> NDArray[np.bool_]:
    """Pixels whose neighbour is the background or lies many pixels' width apart."""
    depth = np.where(faces >= 0, distances, 1e9).astype(np.float32).reshape(shape)
    steps = np.zeros(shape, dtype=bool)
    for one, other, near, far in (
        (depth[1:], depth[:-1], steps[1:], steps[:-1]),
        (depth[:, 1:], depth[:, :-1], steps[:, 1:], steps[:, :-1]),
    ):
        jump = np.abs(one - other) > np.minimum(one, other) * (20.0 / focal_px)
        near |= jump
        far |= jump
    return steps.ravel()


@dataclass(frozen=True, eq=False)
class _Light:
    """A projector's light on the samples of a view that it reaches, shape (n,) each.

    `annulus` is where a sample lies; `inner` and `outer` the shares of blurred light
    from the next annulus inwards and outwards; `root` the share of the root disc's
    outside; `white` the irradiance under the white frame times the albedo.
    """

    samples: NDArray[np.int64]
    white: NDArray[np.float32]
    annulus: NDArray[np.int64]
    inner: NDArray[np.float32]
    outer: NDArray[np.float32]
    root: NDArray[np.float32]


def render_pair(
    seen: View,
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: RayCaster,
    photometry: Photometry,
    seed: tuple[int, ...],
) -> Frames:
    """Return the frames of one camera under one projector.

    Args:
        seen: What the camera sees.
        projector: As it really stands.
        design: As the patterns were drawn for it.
        patterns: What is drawn.
        caster: Of the mesh that really stands there.
        photometry: Light and sensor.
        seed: Of the noise of this pair.
    """
    light = _shine(seen, projector, design, patterns, caster, photometry)
    ambient = photometry.blur(seen.image(seen.albedo * np.float32(photometry.ambient)))
    white = photometry.blur(seen.image(light.white, light.samples))
    brightest = float(np.percentile(white + ambient, 99.9))
    gain = photometry.exposure * 255.0 / max(brightest, 1e-9)

    parts = [
        seen.image(light.white * _level(patterns.bit(bit), light), light.samples)
        for bit in range(patterns.n_bits)
    ]
    parts.append(seen.image(light.white * light.root, light.samples))
    kind = np.uint8 if photometry.noisy else np.float32
    stack: Images = np.empty((patterns.n_frames, *seen.shape), dtype=kind)
    stack[0] = photometry.capture(white + ambient, (*seed, 0), gain)
    stack[1] = photometry.capture(ambient, (*seed, 1), gain)
    for index, part in enumerate(parts):
        bright = photometry.blur(part)
        first = 2 + 2 * index
        stack[first] = photometry.capture(bright + ambient, (*seed, first), gain)
        bright = white - bright + ambient
        stack[first + 1] = photometry.capture(bright, (*seed, first + 1), gain)
    return Frames(stack, seen.corner)


def _level(bright: NDArray[np.float32], light: _Light) -> NDArray[np.float32]:
    """Blurred brightness of a bit's frame at each lit sample."""
    inwards = np.concatenate([bright[:1], bright[:-1]]) - bright
    outwards = np.concatenate([bright[1:], bright[-1:]]) - bright
    k = light.annulus
    level = bright[k] + inwards[k] * light.inner + outwards[k] * light.outer
    return level.astype(np.float32, copy=False)


def _shine(
    seen: View,
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: RayCaster,
    photometry: Photometry,
) -> _Light:
    lit, cosine, pixels, depth = _reached(seen, projector, caster)
    rays, normals = seen.rays[lit], seen.normals[lit]
    plane = ring_plane(design, pixels)
    rho = np.hypot(plane[:, 0], plane[:, 1])
    diverging = projector.light == "diverging"
    # Ring coordinate in a metre across the beam.
    scale = np.sqrt(1.0 + rho * rho) / depth if diverging else np.ones_like(rho)
    across = _across(plane, rho, design)
    slant = np.einsum("ij,ij->i", across, rays) / np.einsum("ij,ij->i", normals, rays)
    stretch = 1.0 - 2.0 * slant * np.einsum("ij,ij->i", across, normals) + slant**2
    pixel = _PIXEL_SPREAD * seen.distances[lit] / seen.camera.focal_px
    spread = scale * np.sqrt(
        photometry.projector_blur_m**2 + pixel**2 * np.maximum(stretch, 0.0)
    )
    annulus = np.searchsorted(patterns.radii, rho)
    edges = np.concatenate([[-np.inf], patterns.radii, [np.inf]])
    drawn = ndtr((patterns.outer_radius - rho) / spread)
    falloff = (float(np.median(depth)) / depth) ** 2 if diverging and len(lit) else 1.0
    return _Light(
        lit,
        (seen.albedo[lit] * cosine * drawn * falloff).astype(np.float32),
        annulus,
        ndtr((edges[annulus] - rho) / spread).astype(np.float32),
        ndtr((rho - edges[annulus + 1]) / spread).astype(np.float32),
        ndtr(patterns.root_side(plane) / spread).astype(np.float32),
    )


def _reached(
    seen: View, projector: ProjectorCalibration, caster: RayCaster
) -> tuple[
    NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
]:
    """Samples that the projector lights, their cos(incidence), pixels and depths."""
    pixels, depth = projector.panel(seen.points)
    if projector.light == "diverging":
        reach = np.linalg.norm(seen.points - projector.centre, axis=1)
        beams = (seen.points - projector.centre) / reach[:, None]
    else:
        reach = depth
        beams = np.broadcast_to(projector.axis, seen.points.shape)
    cosine = -np.einsum("ij,ij->i", beams, seen.normals)
    able = np.flatnonzero(projector.in_panel(pixels) & (cosine > 0.0))
    beams, reach = beams[able], reach[able]
    starts = (
        projector.centre
        if projector.light == "diverging"
        else seen.points[able] - reach[:, None] * beams
    )
    shadowed = caster.occluded(starts, beams, reach * (1.0 - _SHADOW_SLACK))
    lit = able[~shadowed]
    return lit, cosine[lit], pixels[lit], depth[lit]


def _across(
    plane: NDArray[np.float64], rho: NDArray[np.float64], design: ProjectorCalibration
) -> NDArray[np.float64]:
    """Unit normals of the ring surfaces in the world, (n, 3)."""
    tilt = rho if design.light == "diverging" else np.zeros_like(rho)
    flat = plane / np.maximum(rho, 1e-12)[:, None]
    local = np.column_stack([flat, -tilt]) / np.sqrt(1.0 + tilt * tilt)[:, None]
    return local @ design.world_from_ring[:3, :3].T
