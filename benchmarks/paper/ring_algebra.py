"""Points from exact edges, for a million random rays of each light: no wrong root.

Random poses of projector and camera, the ring axis off the projector's centre or turned
against its axis, lens distortion. Random points before the projector are imaged through
the lens to sub-pixel positions; the decoder's own rays, root bit (as the projector
draws it there) and intersection must give the points back. Wrong: off by a micrometre.

    python -m benchmarks.paper.ring_algebra [rays]
"""

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.decode.triangulate import intersect_rings
from planning.verify.reconstruction.light_laws import LIGHTS, LightName
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings

MIN_CONDITIONING = 0.1
_POINTS_A_POSE = 2000
_MM = 1e3
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """What came of random rays.

    Attributes:
        n_poses: Random rigs.
        n_rays: Rays with |r.m| >= 0.1, in the image.
        n_wrong: Of them, points on the other root or without an intersection.
        max_error_m: Largest distance from the truth of the others [m].
        max_offset: Largest distance of the ring axis from the device's, [m] or radians.
        n_inside: Rays of cameras inside their cylinder or cone: one positive root.
    """

    n_poses: int
    n_rays: int
    n_wrong: int
    max_error_m: float
    max_offset: float
    n_inside: int


def run(light: LightName, n_rays: int, seed: int = 0) -> Outcome:
    """Triangulate until so many rays were tried."""
    rng = np.random.default_rng(seed)
    poses = tried = wrong = inside = 0
    worst = offset = 0.0
    while tried < n_rays:
        poses += 1
        projector, off = _projector(rng, light)
        camera = _camera(rng, projector)
        points = _points(rng, projector)
        pixels = camera.project(points)
        seen = np.all(np.isfinite(pixels), axis=1)
        seen &= np.all((pixels > -0.5) & (pixels < _image(camera)), axis=1)
        drawn, depth = projector.panel(points)
        seen &= projector.in_panel(drawn) & (depth > 0.0)
        points, pixels, drawn = points[seen], pixels[seen], drawn[seen]
        plane = projector.ring_plane(drawn)
        radii = np.hypot(plane[:, 0], plane[:, 1])
        # The root bit is what the projector draws at the pixel that lights the point.
        patterns = projector.pattern_for(camera)
        roots = np.where(patterns.root_side(plane) > 0.0, 1, -1).astype(np.int8)
        rays = camera.rays(pixels)
        settled = np.all(np.isfinite(rays), axis=1)
        true = true_conditioning(projector, camera, points)
        good = settled & (np.abs(true) >= MIN_CONDITIONING)
        hits = intersect_rings(camera.centre, rays, radii, roots, projector)
        error = np.linalg.norm(hits.points - points, axis=1)[good]
        other = ~(error < 1e-6)
        tried += int(good.sum())
        wrong += int(other.sum())
        worst = max(worst, float(error[~other].max(initial=0.0)))
        offset = max(offset, off)
        inside += int(np.count_nonzero(_within(projector, camera, radii)[good]))
    return Outcome(poses, tried, wrong, worst, offset, inside)


def true_conditioning(
    projector: ProjectorCalibration, camera: CameraCalibration, points: Matrix
) -> Matrix:
    """Return r.m of points (n, 3), from the points and no intersection, shape (n,)."""
    rays = points - camera.centre
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    local = projector.to_ring(points)
    x, y, z = local.T
    across = np.hypot(x, y)
    tilt = across / z if projector.light.name == "diverging" else np.zeros(len(points))
    normals = np.column_stack([x / across, y / across, -tilt])
    normals /= np.sqrt(1.0 + tilt * tilt)[:, None]
    return np.einsum("ij,ij->i", rays @ projector.world_from_ring[:3, :3], normals)


def _projector(
    rng: np.random.Generator, light: LightName
) -> tuple[ProjectorCalibration, float]:
    """Return a projector anywhere, and how far its ring axis is off its own."""
    pose = np.eye(4)
    pose[:3, :3] = _turn(rng)
    pose[:3, 3] = rng.uniform(-2.0, 2.0, 3)
    shift = np.eye(4)
    if light == "parallel":
        shift[:2, 3] = rng.uniform(-0.3, 0.3, 2)
        off = float(np.linalg.norm(shift[:2, 3]))
        matrix = np.array([[5e3, 0.0, 999.5], [0.0, 5e3, 999.5], [0.0, 0.0, 1.0]])
        resolution, beam = (2000, 2000), 0.2
    else:
        turn = rng.uniform(-0.3, 0.3, 2)
        off = float(np.linalg.norm(turn))
        shift[:3, :3] = _about(np.array([*turn, 0.0]))
        matrix = np.array([[1800.0, 0.0, 639.5], [0.0, 1800.0, 399.5], [0.0, 0.0, 1.0]])
        resolution, beam = (1280, 800), None
    none = DrawnRings(LIGHTS[light], np.zeros(0))
    calibration = ProjectorCalibration(
        "P1", pose, matrix, resolution, pose @ shift, beam, none
    )
    return calibration, off


def _camera(
    rng: np.random.Generator, projector: ProjectorCalibration
) -> CameraCalibration:
    """Return a camera that looks at the lit room from anywhere, with a bent lens."""
    target = projector.centre + projector.axis * rng.uniform(0.8, 1.2)
    away = rng.normal(size=3)
    eye = target + away / np.linalg.norm(away) * rng.uniform(0.6, 1.6)
    ahead = target - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, rng.normal(size=3))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(ahead, right), ahead])
    pose[:3, 3] = eye
    focal = rng.uniform(1200.0, 8000.0)
    matrix = np.array([[focal, 0.0, 1023.5], [0.0, focal, 767.5], [0.0, 0.0, 1.0]])
    lens = tuple(rng.uniform(-1.0, 1.0, 5) * [0.15, 0.05, 2e-3, 2e-3, 0.02])
    return CameraCalibration("C1", pose, matrix, (2048, 1536), lens)


def _points(rng: np.random.Generator, projector: ProjectorCalibration) -> Matrix:
    """Return points of the lit room, 0.7 to 1.3 m before the projector, (n, 3)."""
    local = rng.uniform([-0.2, -0.2, 0.7], [0.2, 0.2, 1.3], (_POINTS_A_POSE, 3))
    return local @ projector.world_from_device[:3, :3].T + projector.centre


def _within(
    projector: ProjectorCalibration, camera: CameraCalibration, radii: Matrix
) -> NDArray[np.bool_]:
    """Whether the camera stands inside the ring surface of each ray, shape (n,)."""
    x, y, z = projector.to_ring(camera.centre[None])[0]
    reach = radii if projector.light.name == "parallel" else radii * z
    return np.hypot(x, y) < reach


def _image(camera: CameraCalibration) -> Matrix:
    return np.array(camera.resolution) - 0.5


def _turn(rng: np.random.Generator) -> Matrix:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.linalg.det(q)


def _about(vector: Matrix) -> Matrix:
    """Return the rotation about a vector by its length in radians, (3, 3)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def main() -> None:
    """Print the table."""
    n = int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000
    print("| light | poses | rays | inside their ring | wrong root | largest error |")
    print("|---|---|---|---|---|---|")
    for light in ("diverging", "parallel"):
        found = run(light, n)
        print(
            f"| {light} | {found.n_poses} | {found.n_rays} | {found.n_inside} | "
            f"{found.n_wrong} | {_MM * found.max_error_m:.1e} mm |",
            flush=True,
        )


if __name__ == "__main__":
    main()
