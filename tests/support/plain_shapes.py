"""Closed-form shapes: their normals, areas and curvatures are known exactly."""

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh


def grid(width: float, depth: float, *, divisions: tuple[int, int]) -> TriangleMesh:
    """Return a flat rectangle about the origin in z = 0, its normal along +z.

    Args:
        width: Along x in [m].
        depth: Along y in [m].
        divisions: Cells along x and along y.
    """
    n, m = divisions
    x, y = np.meshgrid(
        np.linspace(-0.5 * width, 0.5 * width, n + 1),
        np.linspace(-0.5 * depth, 0.5 * depth, m + 1),
        indexing="ij",
    )
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return TriangleMesh(vertices, _cells(n, m, n + 1, m + 1))


def box(size: tuple[float, float, float], *, divisions: int = 1) -> TriangleMesh:
    """Return an axis-aligned closed box about the origin.

    Args:
        size: Extent along x, y and z in [m].
        divisions: Cells along every edge of the box.
    """
    sheet = grid(2.0, 2.0, divisions=(divisions, divisions))
    flat = sheet.vertices + np.array([0.0, 0.0, 1.0])
    # Cyclic shifts of the axes, and half turns, are rotations: winding is kept.
    sides = [np.roll(flat, k, axis=1) for k in range(3)]
    sides += [
        side * (1.0 - 2.0 * (np.arange(3) != (k + 1) % 3))
        for k, side in enumerate(sides)
    ]
    vertices = np.concatenate(sides)
    faces = np.concatenate([sheet.faces + k * len(flat) for k in range(6)])
    vertices, faces = _merged(vertices, faces)
    return TriangleMesh(vertices * (0.5 * np.array(size)), faces)


def cylinder(
    radius: float,
    height: float,
    *,
    around: int = 96,
    along: int = 24,
    capped: bool = True,
) -> TriangleMesh:
    """Return a circular cylinder about the z axis, centred on the origin.

    Args:
        radius: In [m].
        height: Along z in [m].
        around: Cells around the axis, at least 3.
        along: Cells along the axis, at least 1.
        capped: Close both ends with fans; otherwise an open tube.
    """
    phi = np.arange(around) * (2.0 * np.pi / around)
    z = np.linspace(-0.5 * height, 0.5 * height, along + 1)
    p, h = np.meshgrid(phi, z, indexing="ij")
    vertices = np.stack([radius * np.cos(p), radius * np.sin(p), h], axis=-1)
    vertices = vertices.reshape(-1, 3)
    faces = _cells(around, along, around, along + 1)
    if not capped:
        return TriangleMesh(vertices, faces)
    ring = np.arange(around) * (along + 1)
    after = np.roll(ring, -1)
    low, high = len(vertices), len(vertices) + 1
    bottom = np.column_stack([np.full(around, low), after, ring])
    top = np.column_stack([np.full(around, high), ring + along, after + along])
    ends = np.array([[0.0, 0.0, z[0]], [0.0, 0.0, z[-1]]])
    return TriangleMesh(
        np.concatenate([vertices, ends]), np.concatenate([faces, bottom, top])
    )


def torus(
    radius: float, tube_radius: float, *, around: int = 96, about_tube: int = 48
) -> TriangleMesh:
    """Return a torus about the z axis.

    With v the angle about the tube (0 outside), its principal curvatures are
    1 / tube_radius and cos v / (radius + tube_radius cos v).

    Args:
        radius: From the axis to the middle of the tube in [m].
        tube_radius: In [m], below ``radius``.
        around: Cells around the axis, at least 3.
        about_tube: Cells around the tube, at least 3.
    """
    u, v = np.meshgrid(
        np.arange(around) * (2.0 * np.pi / around),
        np.arange(about_tube) * (2.0 * np.pi / about_tube),
        indexing="ij",
    )
    arm = radius + tube_radius * np.cos(v)
    vertices = np.stack([arm * np.cos(u), arm * np.sin(u), tube_radius * np.sin(v)], -1)
    faces = _cells(around, about_tube, around, about_tube)
    return TriangleMesh(vertices.reshape(-1, 3), faces)


def flipped(mesh: TriangleMesh) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def turned(profile: np.ndarray, around: int = 96) -> TriangleMesh:
    """Revolve a closed profile (radius, z), clockwise about the material, about z.

    Points on the axis become one vertex, so that the body is closed.
    """
    n = len(profile)
    phi = np.arange(around) * (2.0 * np.pi / around)
    ring = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    points = np.empty((n, around, 3))
    points[..., :2] = profile[:, None, :1] * ring
    points[..., 2] = profile[:, 1:]
    vertices = points.reshape(-1, 3)
    i, k = np.meshgrid(np.arange(n), np.arange(around), indexing="ij")
    after_i, after_k = (i + 1) % n, (k + 1) % around
    a, b = i * around + k, i * around + after_k
    c, d = after_i * around + after_k, after_i * around + k
    quads = [np.stack(x, axis=-1).reshape(-1, 3) for x in ((a, c, b), (a, d, c))]
    faces = np.concatenate(quads)
    vertices, where = np.unique(vertices.round(12) + 0.0, axis=0, return_inverse=True)
    faces = where.reshape(-1)[faces]
    whole = (
        (faces[:, 0] != faces[:, 1])
        & (faces[:, 1] != faces[:, 2])
        & (faces[:, 2] != faces[:, 0])
    )
    mesh = TriangleMesh(vertices, faces[whole])
    volume = np.linalg.det(mesh.corners).sum() / 6.0
    return mesh if volume > 0 else flipped(mesh)


def joined(*meshes: TriangleMesh) -> TriangleMesh:
    """Return several meshes as one; bodies that touch keep vertices of their own."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)]),
    )


def _cells(n: int, m: int, rows: int, columns: int) -> NDArray[np.int64]:
    """Cut n x m cells of a lattice of rows x columns vertices in two; it may wrap."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    after_i, after_j = (i + 1) % rows, (j + 1) % columns
    a, b = i * columns + j, after_i * columns + j
    c, d = after_i * columns + after_j, i * columns + after_j
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def _merged(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    unique, where = np.unique(vertices.round(9) + 0.0, axis=0, return_inverse=True)
    return unique, where.reshape(-1)[faces]
