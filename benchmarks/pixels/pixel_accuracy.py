"""What decoded rings measure of known objects: edge bias, and errors of points.

Usage: python -m benchmarks.pixels.pixel_accuracy
(ringrig installed, from a checkout)

One projector and one camera 1 m away under 30 degrees, the camera across the rings (as
a plan would have it), rings 4 mm apart, |r.m| at least 0.1. Edges on a
plane against their closed form in pixels, without noise and with it; points on the
sample head and on a sphere against the mesh. Realistic: 5 % of ambient light, 20 % of
texture, shot and read noise, 8 bits, blur of lens and projector (the defaults of
`Photometry`).
"""

import sys
from pathlib import Path

import numpy as np
from support import reconstruction_rigs
from support.reconstruction_rigs import reconstruct_plan
from verify.reconstruction import test_reconstruction_decode

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning import load_mesh
from planning.verify.reconstruction.check.accuracy import measure_accuracy
from planning.verify.reconstruction.decode.edges import find_edges
from planning.verify.reconstruction.render.photometry import Photometry

ROOT = Path(__file__).resolve().parents[2]
RIGS, PLANE = reconstruction_rigs, test_reconstruction_decode
CLEAN = Photometry(noisy=False, ambient=0.0, albedo_variation=0.0)
FOCAL = (1400.0, 3000.0, 3478.0, 8000.0)
LIGHTS = ("diverging", "parallel")
GAP = 4e-3
# Azimuth and elevation [deg]. The ring axis stands above the object in diverging light,
# beside it in parallel light: so do the cameras.
SOURCE, CAMERAS = (-15.0, 5.0), {"diverging": (-15.0, -25.0), "parallel": (15.0, 5.0)}


def main() -> int:
    """Print both tables."""
    print("Edges on a plane, in pixels:\n")
    print("| light | f [px] | light and sensor | edges | mean | rms | largest |")
    print("|---|---|---|---|---|---|---|")
    for light in LIGHTS:
        for focal in FOCAL:
            for name, lens in (("ideal", CLEAN), ("realistic", Photometry())):
                frames, patterns, pair = PLANE.shot(RIGS, light, focal, lens)
                edges, *_ = find_edges(frames, patterns)
                error = PLANE.edge_error_px(edges, patterns, pair)
                print(
                    f"| {light} | {focal:g} | {name} | {len(error)} | "
                    f"{error.mean():+.4f} | {_rms(error):.4f} | "
                    f"{np.abs(error).max():.3f} |",
                    flush=True,
                )
    print("\nPoints of one pair, in millimetres:\n")
    print("| object | light | f [px] | light and sensor | points | rms | p95 | mean |")
    print("|---|---|---|---|---|---|---|---|")
    for name, mesh in (("head", _head()), ("sphere", sphere(0.08, subdivisions=6))):
        for light in LIGHTS:
            for focal in FOCAL[:3]:
                for lens in (CLEAN, Photometry()):
                    _print_points(name, mesh, light, focal, lens)
    return 0


def _print_points(
    name: str, mesh: TriangleMesh, light: str, focal: float, lens: Photometry
) -> None:
    make = RIGS.diverging if light == "diverging" else RIGS.parallel
    source = make("P1", RIGS.direction(*SOURCE), 1.05 * mesh.radius, GAP)
    seen = RIGS.camera("C1", RIGS.direction(*CAMERAS[light]), focal=focal)
    plan = RIGS.plan_of(mesh, [source], [seen])
    cloud = reconstruct_plan(plan, seed=0, photometry=lens).everything
    error = measure_accuracy(cloud, mesh)
    kind = "realistic" if lens.noisy else "ideal"
    print(
        f"| {name} | {light} | {focal:g} | {kind} | {len(cloud)} | "
        f"{1e3 * error.rms_m:.3f} | {1e3 * error.p95_m:.3f} | "
        f"{1e3 * error.bias_m:+.4f} |",
        flush=True,
    )


def _head() -> TriangleMesh:
    mesh = load_mesh(ROOT / "face.obj")
    return TriangleMesh(mesh.vertices - mesh.centre, mesh.faces)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    sys.exit(main())
