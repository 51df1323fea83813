"""Four shapes with their exact curvatures, on regular and on irregular triangles."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, Delaunay

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from support.plain_shapes import cylinder, torus

R, TUBE = 0.1, 0.04
WIDE, TALL = 0.05, 0.3
AXES = np.array([0.1, 0.07, 0.05])
# Share of a cell by which the places of an irregular mesh are off a lattice.
JITTER = 0.35

Truth = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Shape:
    """A smooth surface: its meshes of about n faces, and k1, k2, d1, d2 at points."""

    regular: Callable[[int], TriangleMesh]
    irregular: Callable[[int], TriangleMesh]
    truth: Callable[[np.ndarray], Truth]


def errors(
    truth: Truth, k: np.ndarray, ways: np.ndarray, valid: np.ndarray
) -> np.ndarray:
    """Rms error of k1 and k2 over the largest |curvature|, and of d1's angle in [rad].

    The angle is taken where |k1 - k2| exceeds 0.3 of the largest; 0 where nothing does.
    """
    k1, k2, d1, _ = truth
    largest = max(np.abs(k1).max(), np.abs(k2).max())
    away = valid & (np.abs(k1 - k2) > 0.3 * largest)
    cosine = np.abs(np.einsum("ij,ij->i", ways[0], d1))[away]
    sine = np.linalg.norm(np.cross(ways[0], d1), axis=1)[away]
    angle = np.arctan2(sine, cosine) if away.any() else np.zeros(1)
    off = [(k[0] - k1)[valid] / largest, (k[1] - k2)[valid] / largest, angle]
    return np.array([np.sqrt(np.mean(x**2)) for x in off])


def _sphere_truth(p: np.ndarray) -> Truth:
    # Every direction is principal: these are any two.
    one = np.full(len(p), 1.0 / R)
    return one, one, np.zeros_like(p), np.zeros_like(p)


def _cylinder_truth(p: np.ndarray) -> Truth:
    around = np.cross([0.0, 0.0, 1.0], p * [1, 1, 0]) / WIDE
    axis = np.tile([0.0, 0.0, 1.0], (len(p), 1))
    return np.full(len(p), 1.0 / WIDE), np.zeros(len(p)), around, axis


def _torus_truth(p: np.ndarray) -> Truth:
    x, y, z = p.T
    arm = np.hypot(x, y)
    cosine = (arm - R) / TUBE
    about_axis = np.column_stack([-y, x, 0 * x]) / arm[:, None]
    radial = np.column_stack([x, y, 0 * x]) / arm[:, None]
    about_tube = -radial * (z / TUBE)[:, None] + np.outer(cosine, [0, 0, 1])
    k1 = np.full(len(p), 1.0 / TUBE)
    return k1, cosine / (R + TUBE * cosine), about_tube, about_axis


def _ellipsoid_truth(p: np.ndarray) -> Truth:
    """The shape operator P H P / |grad| of x^T H x = 1, P across the gradient."""
    gradient = p / AXES**2
    size = np.linalg.norm(gradient, axis=1)
    n = gradient / size[:, None]
    across = np.eye(3) - n[:, :, None] * n[:, None, :]
    values, ways = np.linalg.eigh(across @ np.diag(AXES**-2) @ across)
    # The eigenvalue along the normal is 0, the other two are positive.
    return values[:, 2] / size, values[:, 1] / size, ways[:, :, 2], ways[:, :, 1]


def _ball(n_faces: int) -> TriangleMesh:
    return sphere(1.0, subdivisions=max(1, round(np.log(n_faces / 20) / np.log(4))))


def _irregular_ball(n_faces: int) -> TriangleMesh:
    """Points near a spiral, moved at random: the faces of their convex hull."""
    n = n_faces // 2 + 2
    rng = np.random.default_rng(0)
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(n)
    flat = np.sqrt(1.0 - z * z)
    p = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    p += JITTER * np.sqrt(4.0 * np.pi / n) * rng.uniform(-1.0, 1.0, p.shape)
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    faces = ConvexHull(p).simplices.astype(np.int64)
    out = np.linalg.det(p[faces]) > 0
    return TriangleMesh(p, np.where(out[:, None], faces, faces[:, ::-1]))


def _lattice(columns: int, rows: int) -> np.ndarray:
    """Moved places of a lattice in the unit square, every other row half a cell on."""
    rng = np.random.default_rng(0)
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    off = JITTER * rng.uniform(-1.0, 1.0, (2, *i.shape))
    u, v = (i + 0.5 * (j % 2) + off[0]) / columns, (j + 0.5 + off[1]) / rows
    return np.column_stack([u.ravel() % 1.0, v.ravel()])


def _wrapped(places: np.ndarray, size: tuple[float, float], tiles: int) -> np.ndarray:
    """Delaunay faces of places in a unit square that wraps in u, or in u and v too."""
    n = len(places)
    shifts = [(a, b) for a in (-1, 0, 1) for b in ((-1, 0, 1) if tiles == 9 else (0,))]
    copies = np.concatenate([places + shift for shift in shifts])
    faces = Delaunay(copies * size).simplices.astype(np.int64)
    middle = copies[faces].mean(axis=1)
    inside = (middle[:, 0] >= 0.0) & (middle[:, 0] < 1.0)
    if tiles == 9:
        inside &= (middle[:, 1] >= 0.0) & (middle[:, 1] < 1.0)
    faces = faces[inside]
    a, b, c = (copies[faces[:, k]] for k in range(3))
    ab, ac = b - a, c - a
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    faces = np.where(area[:, None] > 0, faces, faces[:, ::-1])
    return faces[np.abs(area) > 1e-9] % n


def _irregular_torus(n_faces: int) -> TriangleMesh:
    rows = round(np.sqrt(0.5 * n_faces * TUBE / R / np.sqrt(0.75)))
    rows += rows % 2
    places = _lattice(n_faces // 2 // rows, rows) % 1.0
    size = (2.0 * np.pi * R, 2.0 * np.pi * TUBE)
    u, v = 2.0 * np.pi * places.T
    arm = R + TUBE * np.cos(v)
    p = np.column_stack([arm * np.cos(u), arm * np.sin(u), TUBE * np.sin(v)])
    return TriangleMesh(p, _wrapped(places, size, 9))


def _irregular_cylinder(n_faces: int) -> TriangleMesh:
    rows = round(np.sqrt(0.5 * n_faces * TALL / (2.0 * np.pi * WIDE * np.sqrt(0.75))))
    columns = n_faces // 2 // rows
    places = _lattice(columns, rows)
    # Straight rims: between moved ones, Delaunay puts slivers as long as the rim.
    row = np.arange(len(places)) % rows
    rim = (row == 0) | (row == rows - 1)
    places[rim, 1] = (row[rim] + 0.5) / rows
    u, v = 2.0 * np.pi * places[:, 0], places[:, 1]
    p = np.column_stack([WIDE * np.cos(u), WIDE * np.sin(u), TALL * (v - 0.5)])
    return TriangleMesh(p, _wrapped(places, (2.0 * np.pi * WIDE, TALL), 3))


def _regular_torus(n_faces: int) -> TriangleMesh:
    cells = round(np.sqrt(0.25 * n_faces))
    return torus(R, TUBE, around=2 * cells, about_tube=cells)


def _regular_cylinder(n_faces: int) -> TriangleMesh:
    cells = round(np.sqrt(0.5 * n_faces))
    return cylinder(WIDE, TALL, around=cells, along=cells, capped=False)


def _scaled(
    make: Callable[[int], TriangleMesh], axes: np.ndarray
) -> Callable[[int], TriangleMesh]:
    def made(n_faces: int) -> TriangleMesh:
        ball = make(n_faces)
        return TriangleMesh(ball.vertices * axes, ball.faces)

    return made


SHAPES = {
    "sphere": Shape(
        _scaled(_ball, np.full(3, R)),
        _scaled(_irregular_ball, np.full(3, R)),
        _sphere_truth,
    ),
    "cylinder": Shape(_regular_cylinder, _irregular_cylinder, _cylinder_truth),
    "torus": Shape(_regular_torus, _irregular_torus, _torus_truth),
    "ellipsoid": Shape(
        _scaled(_ball, AXES), _scaled(_irregular_ball, AXES), _ellipsoid_truth
    ),
}
