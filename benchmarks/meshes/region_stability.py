"""Measure how well dominant regions survive remeshing, decimation and noise.

Usage: python -m benchmarks.meshes.region_stability [DATA] [NAME ...]   (ringrig
    installed)

DATA is the folder with the shared meshes, `../shared/data` by default; without it only
the sample head is measured. Prints, for each mesh, the number of regions and the
intersection over union of its dominant area with that of the same object

- remeshed: every edge cut at a random place, then simplified to the number it had,
- decimated to a quarter of its faces,
- with 0.1 % of its size as vertex noise, along the normals and in all directions,

by area, each face looked up on the other surface by its closest point. Meshes are cut
as `plan_rig` does (`geometry.curvature.refinement`) before regions are found. The
simplifier is `fast_simplification` (in float32, of the `dev` extra). Where it moves a
surface, no answer can stay: how far the quarter lies off the mesh is printed as well
(95 % of the centroids of its faces), and the last column is the quarter by libigl's
`qslim`, where the mesh is one that it takes (manifold).
"""

import sys
from pathlib import Path

import fast_simplification
import igl
import numpy as np

from benchmarks.machine import machine
from geometry.curvature.curvature import principal_curvatures
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from geometry.regions.regions import DominantRegions, dominant_regions

ROOT = Path(__file__).resolve().parents[2]
MESHES = (
    ("face_scan_james.obj", "mm"),
    ("snowden_bust_lo.obj", "in"),
    ("vtk_turbineblade.ply", "mm"),
    ("tm_fixed_top.ply", "mm"),
    ("vtk_bunny.ply", "m"),
    ("vtk_horse.ply", "m"),
    ("vtk_Angel_decimated.ply", "mm"),
    ("tm_reference.obj", "mm"),
    ("tm_counter.unitsmm.STL", "mm"),
    ("tm_ADIS16480.STL", "m"),
    ("mediapipe_canonical_face_model.obj", "cm"),
)
NOISE = 1e-3


def main() -> int:
    """Print the table; return 0."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data"
    wanted = sys.argv[2:]
    print(f"{machine()}\n")
    print(
        "| mesh | faces | regions | dominant | remeshed | quarter of the faces "
        "| noise along normals | noise in all directions | regions with noise "
        "| quarter lies off, in radii | quarter by qslim |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    jobs = [(ROOT / "face.obj", "mm")]
    if (data / "meshes").is_dir():
        jobs += [(data / "meshes" / name, unit) for name, unit in MESHES]
    for path, unit in jobs:
        if not wanted or any(word in path.name for word in wanted):
            print(_row(path, unit), flush=True)
    return 0


def overlap(
    mesh: TriangleMesh,
    found: DominantRegions,
    other: TriangleMesh,
    there: DominantRegions,
) -> float:
    """Intersection over union of two dominant areas, averaged over both surfaces."""
    common, either = 0.0, 0.0
    for a, in_a, b, in_b in (
        (mesh, found.face_region >= 0, other, there.face_region >= 0),
        (other, there.face_region >= 0, mesh, found.face_region >= 0),
    ):
        seen = in_b[closest_points(b, a.face_centroids).faces]
        common += float(a.face_areas[in_a & seen].sum() / a.area)
        either += float(a.face_areas[in_a | seen].sum() / a.area)
    return common / either


def remeshed(mesh: TriangleMesh, seed: int = 0) -> TriangleMesh:
    """The same surface cut by other triangles, as many."""
    rng = np.random.default_rng(seed)
    ends = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, where = np.unique(ends, axis=0, return_inverse=True)
    share = rng.uniform(0.3, 0.7, (len(unique), 1))
    middle = mesh.vertices[unique[:, 0]] * share + mesh.vertices[unique[:, 1]] * (
        1.0 - share
    )
    ab, bc, ca = (len(mesh.vertices) + where.reshape(-1, 3)).T
    a, b, c = mesh.faces.T
    corners = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    fine = TriangleMesh(
        np.concatenate([mesh.vertices, middle]),
        np.concatenate([np.column_stack(three) for three in corners]),
    )
    return decimated(fine, len(mesh.faces))


def decimated(mesh: TriangleMesh, n_faces: int) -> TriangleMesh:
    """Simplified by collapsing edges of least quadric error."""
    scale = mesh.size
    vertices, faces = fast_simplification.simplify(
        np.array((mesh.vertices - mesh.centre) / scale, dtype=np.float32),
        np.array(mesh.faces, dtype=np.int32),
        target_count=n_faces,
    )
    used, local = np.unique(faces, return_inverse=True)
    return TriangleMesh(
        scale * vertices[used].astype(float) + mesh.centre, local.reshape(-1, 3)
    )


def qslim(mesh: TriangleMesh, n_faces: int) -> TriangleMesh | None:
    """Simplified by libigl's quadrics; None: it refuses the mesh."""
    found = igl.qslim(
        np.ascontiguousarray((mesh.vertices - mesh.centre) / mesh.size),
        np.ascontiguousarray(mesh.faces),
        n_faces,
    )
    vertices, faces = found[0], found[1]
    if not len(faces):
        return None
    used, local = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.size * vertices[used] + mesh.centre, local.reshape(-1, 3))


def noisy(mesh: TriangleMesh, *, along_normals: bool, seed: int = 0) -> TriangleMesh:
    """Vertices moved by a normal distribution of 0.1 % of the size."""
    rng = np.random.default_rng(seed)
    if along_normals:
        weighted = mesh.face_normals * mesh.face_areas[:, None]
        sums = np.stack(
            [
                np.bincount(
                    mesh.faces.ravel(),
                    np.repeat(weighted[:, k], 3),
                    len(mesh.vertices),
                )
                for k in range(3)
            ],
            axis=1,
        )
        ways = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)
        moves = ways * rng.normal(size=(len(ways), 1))
    else:
        moves = rng.normal(size=mesh.vertices.shape) / np.sqrt(3.0)
    return TriangleMesh(mesh.vertices + NOISE * mesh.size * moves, mesh.faces)


def _regions(mesh: TriangleMesh) -> DominantRegions:
    return dominant_regions(mesh, principal_curvatures(mesh))


def _cut(mesh: TriangleMesh) -> TriangleMesh:
    return cut_for_curvature(mesh)[0]


def _row(path: Path, unit: str) -> str:
    mesh = load_mesh(path, unit=unit)
    base = _cut(mesh)
    found = _regions(base)
    quarter = decimated(mesh, len(mesh.faces) // 4)
    cells: list[str] = []
    counts: list[int] = []
    for k, other in enumerate(
        (
            remeshed(mesh),
            quarter,
            noisy(mesh, along_normals=True),
            noisy(mesh, along_normals=False),
        )
    ):
        other = _cut(other)
        there = _regions(other)
        cells.append(f"{overlap(base, found, other, there):.3f}")
        if k >= 2:
            counts.append(len(there))
    off = quarter.face_centroids - closest_points(mesh, quarter.face_centroids).points
    radii = np.quantile(np.linalg.norm(off, axis=1), 0.95) / (0.02 * mesh.size)
    other = qslim(mesh, len(mesh.faces) // 4)
    last = "-"
    if other is not None:
        other = _cut(other)
        last = f"{overlap(base, found, other, _regions(other)):.3f}"
    return (
        f"| {path.name} | {len(mesh.faces):,} | {len(found)} "
        f"| {100 * found.dominant_share:.0f} % | {' | '.join(cells)} "
        f"| {', '.join(map(str, counts))} | {radii:.2f} | {last} |"
    )


if __name__ == "__main__":
    sys.exit(main())
