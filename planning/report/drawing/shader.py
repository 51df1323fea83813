"""Pictures of a mesh without OpenGL: parallel rays, smooth shading, flat colours."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from geometry.arrays import cross, rows_of
from geometry.mesh.tensors import summed, unit
from geometry.rays.rays import CHUNK, RayCaster, equal_parts

from .picture_view import BACKGROUND, PictureView

# A corner whose mean normal is turned by more than this lies on a crease.
_CREASE = np.cos(np.deg2rad(40.0))


@dataclass(frozen=True, eq=False)
class Shader:
    """Shades one mesh from any side.

    Attributes:
        caster: Ray caster over the mesh.
        colours: Colour of each face, 0 to 255, shape (n_f, 3).
    """

    caster: RayCaster
    colours: NDArray[np.float64]

    def shade(self, view: PictureView) -> Image.Image:
        """Return the mesh as seen in a view, on the background colour."""
        width, height = view.size
        picture = np.empty((height, width, 3), dtype=np.uint8)
        picture[:] = BACKGROUND
        pixels = view.project(self.points)
        low = np.clip(np.floor(pixels.min(axis=0)), 0, view.size).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, view.size).astype(int)
        columns, rows = np.meshgrid(*map(np.arange, low, high))
        columns, rows = columns.ravel(), rows.ravel()
        # Known before threads ask for them.
        _ = self._slopes, self._corner_normals

        def draw(part: slice) -> None:
            across, down = columns[part], rows[part]
            colours, hit = self._rays(view, across, down)
            picture[down[hit], across[hit]] = colours

        # In parts, so that what is between stays in the cache.
        self.caster.share(draw, equal_parts(len(columns), CHUNK))
        return Image.fromarray(picture)

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """What the mesh reaches to in any view: its vertices [m], (n, 3)."""
        return rows_of(self.caster.mesh.vertices, self.caster.mesh.used)

    def _rays(
        self, view: PictureView, columns: NDArray[np.int64], rows: NDArray[np.int64]
    ) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        mesh, back = self.caster.mesh, view.to_viewer
        centre = 0.5 * np.array(view.size)
        across = (columns + 0.5 - centre[0]) * view.m_per_px
        down = (rows + 0.5 - centre[1]) * view.m_per_px
        origins = view.focus + across[:, None] * view.right - down[:, None] * view.up
        start = (mesh.centre - view.focus) @ back + 2.0 * mesh.reach
        origins += start * back
        faces, distances = self.caster.first_hits(
            origins, np.broadcast_to(-back, origins.shape)
        )
        hit = np.flatnonzero(faces >= 0)
        points = origins[hit] - distances[hit, None] * back
        normals = self._normals(faces[hit], points)
        # The back of an open surface is lit like its front.
        normals *= np.where(normals @ back < 0.0, -1.0, 1.0)[:, None]
        light = _brightness(normals, view)
        clay = rows_of(self.colours, faces[hit])
        colours = np.clip(clay * light[:, None], 0.0, 255.0)
        return colours.astype(np.uint8), hit

    def _normals(
        self, faces: NDArray[np.int64], points: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Unit normals at points of faces, interpolated between the faces' corners."""
        from_a = points - self.caster.mesh.corners[faces, 0]
        b, c = (
            np.einsum("ij,ij->i", rows_of(slope, faces), from_a)
            for slope in self._slopes
        )
        weights = np.stack([1.0 - b - c, b, c], axis=1)
        corners = rows_of(self._corner_normals, faces)
        return unit(np.einsum("nk,nkj->nj", weights, corners))

    @cached_property
    def _slopes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Gradients of the barycentric coordinates of b and c, (n_f, 3) each."""
        mesh = self.caster.mesh
        of_b, of_c = np.empty((2, len(mesh.faces), 3))

        def slope(part: slice) -> None:
            a, b, c = mesh.corners[part].transpose(1, 0, 2)
            double = np.maximum(2.0 * mesh.face_areas[part], 1e-30)[:, None]
            normals = mesh.face_normals[part] / double
            of_b[part], of_c[part] = cross(normals, a - c), cross(normals, b - a)

        self._share(slope)
        return of_b, of_c

    @cached_property
    def _corner_normals(self) -> NDArray[np.float64]:
        """Mean normals at corners of faces, or a face's own on a crease, (n_f, 3, 3).

        Weighted by angle, so that how a face is cut doesn't count.
        """
        mesh = self.caster.mesh
        normals = np.empty((len(mesh.faces), 3, 3))

        def weigh(part: slice) -> None:
            corners = mesh.corners[part]
            edges = np.roll(corners, -1, axis=1) - corners
            to_next = unit(edges.reshape(-1, 3)).reshape(edges.shape)
            cosine = -np.einsum("nkj,nkj->nk", to_next, np.roll(to_next, 1, axis=1))
            angles = np.arccos(np.clip(cosine, -1.0, 1.0))
            normals[part] = angles[:, :, None] * mesh.face_normals[part, None]

        self._share(weigh)
        total = summed(normals.reshape(-1, 3), mesh.faces.ravel(), len(mesh.vertices))
        smooth = unit(total)

        def choose(part: slice) -> None:
            flat, mean = mesh.face_normals[part, None], smooth[mesh.faces[part]]
            crease = np.sum(mean * flat, axis=2) < _CREASE
            normals[part] = np.where(crease[:, :, None], flat, mean)

        self._share(choose)
        return normals

    def _share(self, work: Callable[[slice], None]) -> None:
        """Do work on every part of the faces, in parts that stay in the cache."""
        self.caster.share(work, equal_parts(len(self.caster.mesh.faces), CHUNK))


def _brightness(normals: NDArray[np.float64], view: PictureView) -> NDArray[np.float64]:
    back = view.to_viewer
    key = 0.62 * back - 0.5 * view.right + 0.6 * view.up
    fill = 0.5 * back + 0.8 * view.right - 0.1 * view.up
    key, fill = key / np.linalg.norm(key), fill / np.linalg.norm(fill)
    lit = np.clip(normals @ key, 0.0, 1.0)
    return 0.30 + 0.66 * lit + 0.18 * np.clip(normals @ fill, 0.0, 1.0)
