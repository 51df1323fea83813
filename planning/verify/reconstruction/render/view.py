"""What a camera sees of the mesh that really stands there, by ray casting."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import rows_of
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import CHUNK, RayCaster, equal_parts
from planning.verify.reconstruction.arrays import Array, Grey, Indices, Mask
from planning.verify.reconstruction.calibration import CameraCalibration

from .photometry import Photometry

_MARGIN_PX = 6
# Drawn edges blurred by less than this in the image are sampled twice a pixel, and so
# is the blur of the lens: else they lie askew, and no later blur mends it [px].
_SHARP_PX = 0.7
_SUB = np.array([[-0.25, -0.25], [-0.25, 0.25], [0.25, -0.25], [0.25, 0.25]])


@dataclass(frozen=True, eq=False)
class RenderedView:
    """What a camera sees: samples of the surface, one a cell and 4 at steps of depth.

    A cell is a pixel, or a quarter of one where drawn edges are sharper than that.

    Attributes:
        camera: That looks.
        corner: Pixel (u, v) of the window's top-left pixel.
        shape: Rows and columns of the window, in pixels.
        fold: Cells along a pixel, 1 or 2.
        cells: Flat index in the window's cells of each sample, shape (n,).
        weights: Share of the cell that each sample stands for, shape (n,).
        points: Surface points in the world [m], shape (n, 3).
        normals: Face normals there, of the side that is seen, shape (n, 3).
        rays: Viewing directions, shape (n, 3).
        distances: From the camera [m], shape (n,).
        albedo: And what the lens leaves of its light, shape (n,).
    """

    camera: CameraCalibration
    corner: tuple[int, int]
    shape: tuple[int, int]
    fold: int
    cells: Indices
    weights: Grey
    points: Array
    normals: Array
    rays: Array
    distances: Array
    albedo: Grey


def view(
    camera: CameraCalibration,
    mesh: TriangleMesh,
    caster: RayCaster,
    photometry: Photometry,
    obstacles: RayCaster | None = None,
) -> RenderedView | None:
    """Cast a camera's pixels against a mesh and what stands before it (`obstacles`).

    None if it sees nothing of the mesh.
    """
    window = object_window(camera, mesh)
    if window is None:
        return None
    left, top, *size = window
    shape = size[1], size[0]
    away = float(np.linalg.norm(mesh.centre - camera.centre))
    sharp = photometry.projector_blur_m * camera.focal_px < _SHARP_PX * away
    fold = 2 if sharp else 1
    rows, columns = fold * shape[0], fold * shape[1]
    first = 0.5 / fold - 0.5
    grid = np.empty((rows, columns, 2))
    grid[:, :, 0] = left + first + np.arange(columns) / fold
    grid[:, :, 1] = (top + first + np.arange(rows) / fold)[:, None]
    grid = grid.reshape(-1, 2)
    rays, faces, distances = _cast(camera, caster, grid, obstacles)
    if not np.any(faces >= 0):
        return None
    steps = _depth_steps(faces, distances, (rows, columns), fold * camera.focal_px)
    whole = np.flatnonzero((faces >= 0) & ~steps)
    split = np.flatnonzero(steps)
    fine = (grid[split][:, None] + _SUB / fold).reshape(-1, 2)
    fine_rays, fine_faces, fine_distances = _cast(camera, caster, fine, obstacles)
    hit = fine_faces >= 0
    cells = np.concatenate([whole, np.repeat(split, len(_SUB))[hit]])
    all_rays = np.concatenate([rows_of(rays, whole), rows_of(fine_rays, hit)])
    all_faces = np.concatenate([faces[whole], fine_faces[hit]])
    reach = np.concatenate([distances[whole], fine_distances[hit]])
    weights = np.ones(len(cells), dtype=np.float32)
    weights[len(whole) :] = 1.0 / len(_SUB)
    points = camera.centre + reach[:, None] * all_rays
    normals = rows_of(mesh.face_normals, all_faces)
    behind = np.einsum("ij,ij->i", all_rays, normals) > 0.0
    normals[behind] *= -1.0
    albedo = photometry.albedo(points)
    if photometry.darker_rim:
        albedo *= ((all_rays @ camera.axis) ** 4).astype(np.float32)
    return RenderedView(
        camera,
        (left, top),
        shape,
        fold,
        cells,
        weights,
        points,
        normals,
        all_rays,
        reach,
        albedo,
    )


def object_window(
    camera: CameraCalibration, mesh: TriangleMesh
) -> tuple[int, int, int, int] | None:
    """Return the part of the image that holds a mesh; None: it isn't in the image.

    Left, top, columns and rows.
    """
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
    return int(low[0]), int(low[1]), columns, rows


def _cast(
    camera: CameraCalibration,
    caster: RayCaster,
    pixels: Array,
    obstacles: RayCaster | None,
) -> tuple[Array, Indices, Array]:
    n = len(pixels)
    rays, faces, distances = np.empty((n, 3)), np.empty(n, dtype=np.int64), np.empty(n)
    for part in equal_parts(n, CHUNK):
        along = camera.rays(pixels[part])
        blind = ~np.isfinite(along[:, 0])
        if blind.any():
            along[blind] = -camera.axis
        faces[part], distances[part] = caster.first_hits(camera.centre, along)
        faces[part][blind] = -1
        rays[part] = along
    if obstacles is not None:
        hit = np.flatnonzero(faces >= 0)
        hidden = obstacles.occluded(camera.centre, rays[hit], distances[hit])
        faces[hit[hidden]] = -1
    return rays, faces, distances


def _depth_steps(
    faces: Indices, distances: Array, shape: tuple[int, int], focal_px: float
) -> Mask:
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
