"""Overlap by the paper's test and by per-projector frames; what its removal costs.

Two projectors and three cameras about a face, a box and a sphere, plain and textured.
First, balanced accuracy (lit once or twice) of three tests against ray casting, mean
over the cameras: the paper's one image with both projectors on, its threshold by three
classes or the best that exists; and a white frame of each projector. Then eqs. (5)-(7):
points removed, one-sided completeness at half, one and two ring gaps of the samples
that the rig is made for, and rms, before and after.

    python -m benchmarks.paper.redundancy
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
from support.reconstruction_rigs import reconstruct_plan
from support.white_frames import balanced_accuracy, best_threshold, render_whites

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples, sample_surface
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere
from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.check.accuracy import (
    measure_accuracy,
    nearest_distance,
)
from planning.verify.reconstruction.faults.missing import light_falls
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view

RIGS = reconstruction_rigs
GAP = 3.5e-3
TEXTURE = 0.5
N_SAMPLES = 20_000
# What the rig is made for: lit and seen at most at these angles.
_MAX_LIT, _MAX_SEEN = np.cos(np.deg2rad(60.0)), np.cos(np.deg2rad(60.0))
_MM = 1e3


@dataclass(frozen=True)
class Overlap:
    """Balanced accuracy of each test, mean over the cameras that see both kinds."""

    paper: float
    oracle: float
    frames: float
    doubly_lit: float


@dataclass(frozen=True)
class Removal:
    """Before and after redundancy is removed."""

    removed: float
    before: tuple[float, float, float]
    after: tuple[float, float, float]
    rms_m: tuple[float, float]


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


def removal(plan: RigPlan, photometry: Photometry, *, seed: int = 0) -> Removal:
    """Reconstruct, and compare the cloud before and after."""
    samples = served(plan)
    found = reconstruct_plan(plan, seed=seed, samples=samples, photometry=photometry)
    clouds = found.everything, found.merged.cloud
    thresholds = 0.5 * GAP, GAP, 2.0 * GAP
    shares: list[tuple[float, float, float]] = []
    for cloud in clouds:
        near = nearest_distance(cloud, samples, 2.01 * GAP)
        half, one, two = (float(np.mean(near <= limit)) for limit in thresholds)
        shares.append((half, one, two))
    rms = [measure_accuracy(c, plan.surface.mesh).rms_m for c in clouds]
    return Removal(found.redundant_fraction, shares[0], shares[1], (rms[0], rms[1]))


def served(plan: RigPlan) -> SurfaceSamples:
    """Return samples that a projector lights and a camera sees squarely enough."""
    mesh = plan.surface.mesh
    caster = RayCaster(mesh, threads=1)
    samples = sample_surface(mesh, N_SAMPLES, seed=5)
    points, normals = samples.points, samples.normals
    lit = np.zeros(len(samples), dtype=bool)
    for p in plan.projectors:
        device = calibrate_projector(p)
        falls = light_falls(device, caster, points, normals)
        lit |= falls & (device.incidence_cosine(points, normals) >= _MAX_LIT)
    seen = np.zeros(len(samples), dtype=bool)
    for planned in plan.cameras:
        centre = planned.world_from_device[:3, 3]
        rays = points - centre
        reach = np.linalg.norm(rays, axis=1)
        rays /= reach[:, None]
        clear = ~caster.occluded(centre, rays, reach * (1.0 - 2e-5))
        seen |= clear & (-np.einsum("ij,ij->i", rays, normals) >= _MAX_SEEN)
    return samples.take(lit & seen)


def rig(mesh: TriangleMesh, light: str = "diverging") -> RigPlan:
    """Return two projectors and three cameras about the front of an object."""
    plan = RIGS.small_rig(mesh, light)
    document = plan.to_document()
    document["requirements"]["check"] = RIGS.CHECK | {"tau_m": GAP}
    return RigPlan.from_document(document, plan.surface)


def main() -> None:
    """Print both tables."""
    cases = [
        (name, words, rig(mesh), replace(Photometry(), albedo_variation=texture))
        for name, mesh in objects().items()
        for words, texture in (("plain", 0.0), ("textured", TEXTURE))
    ]
    print("balanced accuracy, lit once or twice\n")
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
    print("\nredundancy removed; completeness at half / one / two ring gaps\n")
    print("| object | albedo | points removed | before | after | rms before | after |")
    print("|---|---|---|---|---|---|---|")
    for name, words, plan, photometry in cases:
        gone = removal(plan, photometry)
        before, after = (
            " / ".join(f"{100 * share:.2f}" for share in shares)
            for shares in (gone.before, gone.after)
        )
        rms = [f"{_MM * value:.3f} mm" for value in gone.rms_m]
        print(
            f"| {name} | {words} | {100 * gone.removed:.0f} % | {before} | {after} | "
            f"{rms[0]} | {rms[1]} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
