"""Closed-form shapes in metres, faces counter-clockwise seen from outside.

Their normals, areas and curvatures are known exactly, which makes them the truth of the
tests and the floors, posts and test objects of scenes.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh

_PHI = (1.0 + np.sqrt(5.0)) / 2.0
_ICOSAHEDRON = np.array(
    [
        [-1, _PHI, 0],
        [1, _PHI, 0],
        [-1, -_PHI, 0],
        [1, -_PHI, 0],
        [0, -1, _PHI],
        [0, 1, _PHI],
        [0, -1, -_PHI],
        [0, 1, -_PHI],
        [_PHI, 0, -1],
        [_PHI, 0, 1],
        [-_PHI, 0, -1],
        [-_PHI, 0, 1],
    ]
)
# Squared edge length of that icosahedron.
_SQUARE_EDGE = 4.0


def sphere(radius: float, *, subdivisions: int = 4) -> TriangleMesh:
    """Return a subdivided icosahedron about the origin, 20 * 4^subdivisions faces.

    Args:
        radius: In [m]; every vertex lies at this distance.
        subdivisions: Times each face is cut in four.

    Raises:
        ValueError: If the radius isn't positive or subdivisions is negative.
    """
    _positive("radius", radius)
    _at_least("subdivisions", subdivisions, 0)
    vertices, faces = _icosahedron()
    for _ in range(subdivisions):
        vertices, faces = _quartered(vertices, faces)
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return TriangleMesh(radius * vertices, faces)


def grid(width: float, depth: float, *, divisions: tuple[int, int]) -> TriangleMesh:
    """Return a flat rectangle about the origin in z = 0, its normal along +z.

    Args:
        width: Along x in [m].
        depth: Along y in [m].
        divisions: Cells along x and along y.

    Raises:
        ValueError: If a length isn't positive or a number of cells is below 1.
    """
    _positive("width", width)
    _positive("depth", depth)
    n, m = divisions
    _at_least("divisions", min(n, m), 1)
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

    Raises:
        ValueError: If an extent isn't positive or divisions is below 1.
    """
    for axis, length in zip("xyz", size, strict=True):
        _positive(f"size along {axis}", length)
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

    Raises:
        ValueError: If a length isn't positive or a number of cells is too small.
    """
    _positive("radius", radius)
    _positive("height", height)
    _at_least("around", around, 3)
    _at_least("along", along, 1)
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

    Raises:
        ValueError: If 0 < tube_radius < radius doesn't hold or there are too few cells.
    """
    _positive("tube_radius", tube_radius)
    if not tube_radius < radius:
        raise ValueError(f"tube_radius {tube_radius} m must be below radius {radius} m")
    _at_least("around", around, 3)
    _at_least("about_tube", about_tube, 3)
    u, v = np.meshgrid(
        np.arange(around) * (2.0 * np.pi / around),
        np.arange(about_tube) * (2.0 * np.pi / about_tube),
        indexing="ij",
    )
    arm = radius + tube_radius * np.cos(v)
    vertices = np.stack([arm * np.cos(u), arm * np.sin(u), tube_radius * np.sin(v)], -1)
    faces = _cells(around, about_tube, around, about_tube)
    return TriangleMesh(vertices.reshape(-1, 3), faces)


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


def _icosahedron() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    vertices = _ICOSAHEDRON / np.linalg.norm(_ICOSAHEDRON[0])
    near = np.linalg.norm(_ICOSAHEDRON[:, None] - _ICOSAHEDRON[None], axis=2)
    linked = np.abs(near * near - _SQUARE_EDGE) < 1e-9
    faces = np.array(
        [
            (a, b, c)
            for a in range(12)
            for b in range(a + 1, 12)
            for c in range(b + 1, 12)
            if linked[a, b] and linked[b, c] and linked[a, c]
        ]
    )
    outward = np.linalg.det(vertices[faces]) > 0
    return vertices, np.where(outward[:, None], faces, faces[:, ::-1])


def _quartered(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Cut each face in four at the middles of its edges."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, where = np.unique(edges, axis=0, return_inverse=True)
    middle = vertices[unique].mean(axis=1)
    ab, bc, ca = (len(vertices) + where.reshape(-1, 3)).T
    a, b, c = faces.T
    corners = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return (
        np.concatenate([vertices, middle]),
        np.concatenate([np.column_stack(three) for three in corners]),
    )


def _merged(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    unique, where = np.unique(vertices.round(9) + 0.0, axis=0, return_inverse=True)
    return unique, where.reshape(-1)[faces]


def _positive(name: str, value: float) -> None:
    if not (value > 0 and np.isfinite(value)):
        raise ValueError(f"{name} must be a positive number of metres, got {value}")


def _at_least(name: str, value: int, least: int) -> None:
    if not value >= least:
        raise ValueError(f"{name} must be at least {least}, got {value}")
