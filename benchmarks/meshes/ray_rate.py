"""Rate of the visibility engine against raw embree calls on the same rays.

Usage: python -m benchmarks.meshes.ray_rate [DATA] [ROUNDS]   (ringrig installed)

Raw: two threads, each one embree call on half of float32 arrays that were prepared
beforehand, not counted; facing pairs of 40 devices and 20,000 samples, once in the
caller's order and once sorted as the engine sorts its samples. Engine: everything that
it does per query in its own API, from the float64 pose to booleans or packed bits.
Rounds are interleaved; a ratio of rates is the median over rounds, of wall times and in
brackets of processor times, which other work on the machine disturbs less.
"""

import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.machine import machine
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.poses import fibonacci_cap
from geometry.rays.visibility import Visibility, morton_order
from geometry.rays.visibility_matrix import visibility_matrix
from geometry.shapes.primitives import sphere

ROOT = Path(__file__).resolve().parents[2]
SAMPLES, DEVICES = 20_000, 40


def main() -> int:
    """Print the tables; return 0."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data"
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 7
    print(f"{machine()}, load before the run {os.getloadavg()[0]:.1f}\n")
    print(
        "| mesh, faces | raw [Mray/s] | raw, sorted [Mray/s] "
        "| matrix / raw | matrix / raw sorted | device by device / raw "
        "| build 1000 x 20k [s] |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, mesh in _meshes(data):
        print(f"| {name}, {len(mesh.faces):,} " + _row(mesh, rounds), flush=True)
    return 0


def _meshes(data: Path) -> list[tuple[str, TriangleMesh]]:
    meshes = [(f"bumpy ball {k}", _bumpy(k)) for k in (5, 7, 8)]
    face = data / "meshes" / "face_scan_james.obj"
    return meshes + ([(face.name, load_mesh(face))] if face.is_file() else [])


def _bumpy(subdivisions: int) -> TriangleMesh:
    ball = sphere(1.0, subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    height = 1.0 + 0.08 * np.sin(7 * x) * np.sin(6 * y) * np.cos(5 * z)
    return TriangleMesh(0.1 * ball.vertices * height[:, None], ball.faces)


def _row(mesh: TriangleMesh, rounds: int) -> str:
    visibility = Visibility(mesh)
    samples = sample_surface(mesh, SAMPLES, seed=1)
    points, normals = samples.points, samples.normals
    middle, radius = mesh.bounds.mean(axis=0), np.ptp(mesh.bounds, axis=0).max()
    origins = middle + 3.0 * radius * fibonacci_cap(DEVICES, np.eye(3)[2], np.pi)
    sort = morton_order(visibility.caster.local(points))
    facing = [np.einsum("ij,ij->i", normals, o - points) > 0 for o in origins]
    n = int(np.sum(facing))
    pool = ThreadPoolExecutor(2)
    plain = _raw(visibility, pool, points, facing, origins, np.arange(SAMPLES))
    ordered = _raw(visibility, pool, points, facing, origins, sort)

    def one_by_one() -> None:
        for origin, front in zip(origins, facing, strict=True):
            visibility.blocked(origin, points[front], normals[front])

    jobs: list[Callable[[], object]] = [
        plain,
        ordered,
        lambda: visibility_matrix(visibility, origins, points, normals),
        one_by_one,
    ]
    seconds = np.array([[_seconds(job) for job in jobs] for _ in range(rounds + 1)])[1:]
    # Ratio of times: axes are job, wall or processor.
    against_plain = np.median(seconds[:, :1] / seconds, axis=0)
    against_sorted = np.median(seconds[:, 1:2] / seconds, axis=0)
    rate = n / np.median(seconds, axis=0) / 1e6
    cells = [f"{rate[0, 0]:.2f}", f"{rate[1, 0]:.2f}"]
    for ratio, job in (
        (against_plain, 2),
        (against_sorted, 2),
        (against_plain, 3),
    ):
        cells.append(f"{ratio[job, 0]:.2f} ({ratio[job, 1]:.2f})")
    many = middle + 3.0 * radius * fibonacci_cap(1000, np.eye(3)[2], np.pi)
    whole = _seconds(lambda: visibility_matrix(visibility, many, points, normals))
    pool.shutdown()
    return f"| {' | '.join(cells)} | {whole[0]:.2f} |"


def _raw(
    visibility: Visibility,
    pool: ThreadPoolExecutor,
    points: np.ndarray,
    facing: list[np.ndarray],
    origins: np.ndarray,
    order: np.ndarray,
) -> Callable[[], None]:
    starts, rays, reaches = [], [], []
    for origin, front in zip(origins, facing, strict=True):
        ends = points[order][front[order]]
        ray = ends - origin
        length = np.linalg.norm(ray, axis=1)
        starts.append(np.repeat(visibility.caster.local(origin[None]), len(ends), 0))
        rays.append((ray / length[:, None]).astype(np.float32))
        reach = (length * (1.0 - 1e-5)) * visibility.caster.scale
        reaches.append(reach.astype(np.float32))
    start, ray, reach = (np.concatenate(x) for x in (starts, rays, reaches))
    half = len(start) // 2

    def run() -> None:
        def trace(part: slice) -> None:
            visibility.caster.blocked_local(start[part], ray[part], reach[part])

        list(pool.map(trace, [slice(0, half), slice(half, None)]))

    return run


def _seconds(job: Callable[[], object]) -> tuple[float, float]:
    """Wall and processor seconds of all threads."""
    wall, cpu = time.perf_counter(), time.process_time()
    job()
    return time.perf_counter() - wall, time.process_time() - cpu


if __name__ == "__main__":
    sys.exit(main())
