"""False answers of the visibility engine against float64, mesh by mesh.

Usage: python -m benchmarks.meshes.ray_exactness [DATA] [RAYS]   (ringrig installed)

Samples inside their faces (barycentric coordinates above 0.02), eight devices about
each mesh at three half diagonals, or as the row says. Reference: first hits of
`igl.AABB` in float64, the mesh scaled to 10^6 units (its ray test takes determinants
below 1e-6 for edge-on, and misses small faces otherwise). Every false answer is counted
by the cosine of incidence at which its ray meets the sample's face.
"""

import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import igl
import numpy as np
from support.plain_shapes import box, grid

from benchmarks.machine import machine
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.visibility import Visibility
from geometry.shapes.primitives import sphere

ROOT = Path(__file__).resolve().parents[2]
BANDS = (1e-4, 1e-3, 1e-2, 1.0)
SHARED = {
    "tm_ADIS16480.STL": "m",
    "tm_counter.unitsmm.STL": "mm",
    "tm_fixed_top.ply": "mm",
    "tm_reference.obj": "mm",
    "vtk_turbineblade.ply": "mm",
    "face_scan_james.obj": "mm",
}


def main() -> int:
    """Print the table; return 0."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data"
    n = int(sys.argv[2]) if len(sys.argv) > 2 else 40_000
    print(f"{machine()}\n")
    print("Each cell: rays, falsely blocked / falsely clear, by cosine of incidence.\n")
    print(
        "| mesh | cos 1e-4 to 1e-3 | 1e-3 to 1e-2 | above 1e-2 "
        "| highest occluder that was missed [half diagonals] |"
    )
    print("|---|---|---|---|---|")
    for name, mesh, distance in _cases(data):
        print(f"| {name} | {_row(mesh, distance, n)} |", flush=True)
    return 0


def _cases(data: Path) -> Iterator[tuple[str, TriangleMesh, float]]:
    ball = _bumpy(6)
    for name, scale, centre, distance in (
        ("bumpy ball, 82k faces, radius 1 m", 1.0, 0.0, 3.0),
        ("the same, device at 1.15 m", 1.0, 0.0, 1.15),
        ("radius 1 mm", 1e-3, 0.0, 3e-3),
        ("radius 1 km", 1e3, 0.0, 3e3),
        ("5 mm part, device at 2 m", 0.0025, 0.0, 2.0),
        ("the same, coordinates at 10^3 m", 0.0025, 1e3, 2.0),
        ("the same, coordinates at 10^6 m", 0.0025, 1e6, 2.0),
    ):
        moved = ball.vertices * scale + centre * np.array([1.0, -1.0, 1.0])
        yield name, TriangleMesh(moved, ball.faces), distance
    fine = _bumpy(8)
    yield (
        "1.3 M faces, 5 mm part, device at 2 m",
        TriangleMesh(0.0025 * fine.vertices, fine.faces),
        2.0,
    )
    for gap in (0.1, 1e-2, 1e-3, 1e-4):
        plate = grid(1.0, 1.0, divisions=(50, 50))
        above = plate.vertices + [0.0, 0.0, 0.02 * gap]
        yield f"plates {gap:g} edges apart", _joined(plate, above, plate.faces), 2.0
    part, cube = box((1.0, 1.0, 0.001)), box((0.001, 0.001, 0.001), divisions=20)
    for x in (-0.4, 0.0, 0.3):
        part = _joined(part, cube.vertices + [x, 0.1, 0.00101], cube.faces)
    yield "plate of 1 m, cubes of 1 mm 10 um above it", part, 1.5
    for name, unit in SHARED.items():
        path = data / "meshes" / name
        if path.is_file():
            mesh = load_mesh(path, unit=unit)
            half = 0.5 * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
            yield f"`{name}`, {len(mesh.faces):,} faces", mesh, 3.0 * half


def _bumpy(subdivisions: int) -> TriangleMesh:
    ball = sphere(1.0, subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    height = 1.0 + 0.08 * np.sin(7 * x) * np.sin(6 * y) * np.cos(5 * z)
    return TriangleMesh(ball.vertices * height[:, None], ball.faces)


def _joined(
    mesh: TriangleMesh, vertices: np.ndarray, faces: np.ndarray
) -> TriangleMesh:
    return TriangleMesh(
        np.concatenate([mesh.vertices, vertices]),
        np.concatenate([mesh.faces, faces + len(mesh.vertices)]),
    )


def _row(mesh: TriangleMesh, distance: float, n: int) -> str:
    rng = np.random.default_rng(0)
    area = mesh.face_areas
    faces = rng.choice(len(area), n, p=area / area.sum())
    inside = rng.dirichlet([1.0, 1.0, 1.0], n) * 0.94 + 0.02
    points = np.einsum("ij,ijk->ik", inside, mesh.corners[faces])
    normals = mesh.face_normals[faces]
    away = rng.normal(size=(8, 3))
    away *= distance / np.linalg.norm(away, axis=1, keepdims=True)
    middle, visibility = mesh.bounds.mean(axis=0), Visibility(mesh)
    half = 0.5 * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    vertices = np.ascontiguousarray((mesh.vertices - middle) * (1e6 / half))
    tree, corners = igl.AABB(), np.ascontiguousarray(mesh.faces)
    tree.init(vertices, corners)
    found: list[np.ndarray] = []
    parts = np.array_split(np.arange(n), 8)
    for part, origin in zip(parts, middle + away, strict=True):
        rays = points[part] - origin
        length = np.linalg.norm(rays, axis=1)
        rays /= length[:, None]
        cosine = -np.einsum("ij,ij->i", normals[part], rays)
        front = cosine > BANDS[0]
        part, rays, cosine = part[front], rays[front], cosine[front]
        ends = (points[part] - middle) * (1e6 / half)
        back = np.minimum(length[front] * (1e6 / half), 2.2e6)
        starts = np.ascontiguousarray(ends - back[:, None] * rays)
        hit, at, _ = tree.intersect_ray_first(vertices, corners, starts, rays)
        height = (back - at) * cosine / 1e6
        truth = (hit >= 0) & (hit != faces[part]) & (height > 1e-11)
        blocked = visibility.blocked(origin, points[part], normals[part])
        found.append(np.column_stack([cosine, truth, blocked, height]))
    return _counted(np.concatenate(found))


def _counted(found: np.ndarray) -> str:
    cosine, truth, blocked = found[:, 0], found[:, 1] > 0, found[:, 2] > 0
    cells = []
    for low, high in pairwise(BANDS):
        band = (cosine > low) & (cosine <= high)
        false = (blocked & ~truth)[band].sum(), (truth & ~blocked)[band].sum()
        cells.append(f"{band.sum():,}, {false[0]} / {false[1]}")
    missed = found[truth & ~blocked, 3]
    cells.append(f"{missed.max():.1e}" if len(missed) else "none")
    return " | ".join(cells)


if __name__ == "__main__":
    sys.exit(main())
