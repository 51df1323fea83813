"""Overlap by the paper's test and by per-projector frames; merged clouds and parts.

Two projectors and three cameras about a face, a box and a sphere, plain and textured:
balanced accuracy (lit once or twice) of three tests against ray casting, mean over the
cameras: the paper's one image with both projectors on, its threshold by three classes
or the best that exists; and a white frame of each projector. Then, of the paper's two
experiments and of planned rigs, errors and completeness of merged clouds beside those
of their parts, and as merging was before (`benchmarks.paper.merging`).

    python -m benchmarks.paper.redundancy > benchmarks/paper/results/redundancy.md
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from support import reconstruction_rigs
from support.image_overlap import (
    overlap_by_frames,
    overlap_by_intensity,
)
from support.plain_shapes import box
from support.white_frames import balanced_accuracy, best_threshold, render_whites

from benchmarks.paper.merging import print_tables
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere
from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.faults.missing import light_falls
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view

RIGS = reconstruction_rigs
GAP = 3.5e-3
TEXTURE = 0.5


@dataclass(frozen=True)
class Overlap:
    """Balanced accuracy of each test, mean over the cameras that see both kinds."""

    paper: float
    oracle: float
    frames: float
    doubly_lit: float


def objects() -> dict[str, TriangleMesh]:
    """Return the three objects about the origin."""
    path = Path(__file__).resolve().parents[2] / "face.obj"
    face = load_mesh(path, unit="mm")
    side = 0.1
    cube = box((side, side, side), divisions=8)
    return {
        "face": TriangleMesh(face.vertices - face.centre, face.faces),
        "box": cube,
        "sphere": sphere(0.08, subdivisions=5),
    }


def overlap(plan: RigPlan, photometry: Photometry) -> Overlap:
    """Hold the tests against ray casting in every camera's image."""
    mesh = plan.surface.mesh
    caster = RayCaster(mesh, threads=1)
    rows: list[tuple[float, ...]] = []
    for c, planned in enumerate(plan.cameras):
        camera = calibrate_camera(planned)
        seen = view(camera, mesh, caster, photometry)
        assert seen is not None
        shown = tuple(
            Shown(device, device, device.pattern_for(camera), caster)
            for p in plan.projectors
            for device in (calibrate_projector(p),)
        )
        whites = render_whites(seen, shown, photometry, (c,))
        lit = lit_by(plan, camera, caster, whites.dark.shape, whites.corner)
        best = best_threshold(whites.together, whites.dark, lit)
        told = (
            overlap_by_intensity(whites.together, whites.dark),
            overlap_by_intensity(whites.together, whites.dark, best),
            overlap_by_frames(whites.alone, whites.dark),
        )
        share = float(np.mean(lit[lit > 0] >= 2))
        rows.append((*(balanced_accuracy(double, lit) for double in told), share))
    return Overlap(*(float(mean) for mean in np.nanmean(rows, axis=0)))


def lit_by(
    plan: RigPlan,
    camera: CameraCalibration,
    caster: RayCaster,
    shape: tuple[int, int],
    corner: tuple[int, int],
) -> NDArray[np.int64]:
    """Return by how many projectors each pixel of a window is lit, by ray casting."""
    v, u = np.indices(shape)
    pixels = np.column_stack([u.ravel() + corner[0], v.ravel() + corner[1]])
    rays = camera.rays(pixels.astype(np.float64))
    faces, distances = caster.first_hits(camera.centre, rays)
    hit = np.flatnonzero(faces >= 0)
    points = camera.centre + distances[hit, None] * rays[hit]
    normals = plan.surface.mesh.face_normals[faces[hit]]
    lit = np.zeros(len(pixels), dtype=np.int64)
    for p in plan.projectors:
        device = calibrate_projector(p)
        lit[hit] += light_falls(device, caster, points, normals)
    return lit.reshape(shape)


def rig(mesh: TriangleMesh, light: str = "diverging") -> RigPlan:
    """Return two projectors and three cameras about the front of an object."""
    plan = RIGS.small_rig(mesh, light)
    document = plan.to_document()
    document["requirements"]["check"] = RIGS.CHECK | {"tau_m": GAP}
    return RigPlan.from_document(document, plan.surface)


def main() -> None:
    """Print all tables."""
    cases = [
        (name, words, rig(mesh), replace(Photometry(), albedo_variation=texture))
        for name, mesh in objects().items()
        for words, texture in (("plain", 0.0), ("textured", TEXTURE))
    ]
    print("Command: `python -m benchmarks.paper.redundancy`\n")
    print("## Which pixels two projectors light\n")
    print("Balanced accuracy, lit once or twice.\n")
    print("| object | albedo | lit twice | paper, auto | paper, best | frames |")
    print("|---|---|---|---|---|---|")
    for name, words, plan, photometry in cases:
        found = overlap(plan, photometry)
        print(
            f"| {name} | {words} | {100 * found.doubly_lit:.0f} % | "
            f"{100 * found.paper:.1f} % | {100 * found.oracle:.1f} % | "
            f"{100 * found.frames:.1f} % |",
            flush=True,
        )
    print_tables()


if __name__ == "__main__":
    main()
