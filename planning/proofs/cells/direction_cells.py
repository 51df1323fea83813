"""Which cells of directions are open to which samples, and a tree of them.

A projector of parallel light lights what its one direction allows, wherever else its
beam stands. So the space of its poses is the sphere of directions u = -L, cut into the
cells of a cube map; a cell's row holds each sample to which it is open
(`geometry.directions.open_directions`). Beam, panel and range are left out: that only
adds samples, and what is proved holds for beams of any width.

The workspace leaves out directions. A device at Q that lights a sample at P by a beam
of half width h stands at Q - C = t u + (P - C) + o, |o| <= h, about the centre C. With
e = |P - C| + h, at a distance of at least r::

    angle(Q - C, u) <= asin(e / r)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.directions.cube_map import FACES, CubeMap, cube_map, middles, quarters
from geometry.directions.open_directions import DirectionLimits, OpenDirections
from geometry.directions.silhouettes import POINTS
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers.bit_rows import words_for
from solvers.cells.cell_tree import CellBatch

from .occluders_of_all import occluders_of_all

# Cells of 2.8 degrees, 6,144 of them.
_SPREAD = 5


@dataclass(frozen=True, eq=False)
class DirectionTree:
    """A quadtree of directions on each face of a cube; bit rows of every level."""

    levels: tuple[NDArray[np.uint64], ...]
    n_rows: int

    @classmethod
    def over(cls, leaves: NDArray[np.uint64], n_rows: int) -> "DirectionTree":
        """Return the tree over the cells of the finest map."""
        levels = [leaves]
        while len(levels[-1]) > FACES:
            n = round((len(levels[-1]) // FACES) ** 0.5)
            levels.append(cube_map(n).halved(levels[-1]))
        return cls(tuple(levels[::-1]), n_rows)

    @property
    def units(self) -> float:
        """Counted work of making cells: all rows are there before the search."""
        return 0.0

    def roots(self) -> CellBatch:
        """Return the six faces."""
        cells = np.arange(FACES)
        return CellBatch(cells, np.full(FACES, -1), self.levels[0])

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the four parts of each cell."""
        level, cell = self.place(cells)
        split = level < len(self.levels) - 1
        parents = np.repeat(np.flatnonzero(split), 4)
        quarter = quarters(level[split], cell[split]).ravel()
        level = level[parents]
        rows = np.empty((parents.size, self.levels[0].shape[1]), dtype=np.uint64)
        for finer in np.unique(level):
            at = level == finer
            rows[at] = self.levels[finer + 1][quarter[at]]
        return CellBatch(_first(level + 1) + quarter, parents, rows)

    def spread_cells(self) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
        """Return cells of one size that hold every direction, and their rows."""
        level = min(_SPREAD, len(self.levels) - 1)
        rows = self.levels[level]
        return _first(np.array(level)) + np.arange(len(rows)), rows

    def directions(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the middle of each cell, shape (n, 3)."""
        return middles(*self.place(cells))

    def place(
        self, cells: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the level of cells named, and their number on the map of 2^level."""
        starts = _first(np.arange(len(self.levels)))
        level = np.searchsorted(starts, cells, side="right") - 1
        return level, cells - starts[level]


def _first(level: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the name of the first cell of a level: 6 (1 + 4 + ...) cells precede."""
    return 2 * (4**level - 1)


def mesh_reach(scene: Scene) -> float:
    """Return the distance of the farthest vertex from the middle of the workspace."""
    mesh, centre = scene.mesh, np.array(scene.requirements.workspace.centre)
    return float(np.linalg.norm(mesh.corners.reshape(-1, 3) - centre, axis=1).max())


def open_samples(
    scene: Scene,
    limits: DirectionLimits,
    samples: Target,
    cube: CubeMap,
    *,
    shadows: bool,
    nearest_m: float,
) -> NDArray[np.uint64]:
    """Return for each cell the samples to which it is open, as bit rows.

    Args:
        scene: Surface, obstacles and requirements.
        limits: On directions from a sample to a device.
        samples: Of the surface.
        cube: The map.
        shadows: Whether what stands in the way counts.
        nearest_m: Least distance of devices from the centre of the workspace [m].

    Returns:
        Shape (cube.size, n_words).
    """
    occluders = occluders_of_all(scene, nearest_m) if shadows else scene.visibility
    maps = OpenDirections(occluders, limits, cube, occlusion=shadows)
    rows = np.zeros((cube.size, words_for(len(samples))), dtype=np.uint64)
    bytes_of = rows.view(np.uint8).reshape(cube.size, -1, 8)
    drawn = samples.samples

    def fill(part: slice) -> None:
        scene.check_cancelled()
        marks = maps.maps(
            drawn.points[part],
            drawn.normals[part],
            samples.steep[part],
            drawn.faces[part],
        )
        # Along the first axis `np.packbits` takes five times as long.
        bits = marks.view(np.uint8)
        packed = np.zeros((-(-len(marks) // 8), cube.size), dtype=np.uint8)
        for k in range(8):
            packed[: len(bits[k::8])] |= bits[k::8] << (7 - k)
        bytes_of[:, part.start // POINTS, : len(packed)] = packed.T

    parts = [slice(b, b + POINTS) for b in range(0, len(samples), POINTS)]
    scene.visibility.caster.share(fill, parts)
    return rows
