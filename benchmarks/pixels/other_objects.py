"""Captures of objects that aren't the plan's mesh, by the rig of one plan.

Usage: python -m benchmarks.pixels.other_objects [PLAN.json] [--only WORD] [--threads N]

Without a plan the sample is planned first. Objects: other heads in its place (of
`../shared` when it is there), the sample with waves, with a piece of 3 cm missing and
one added, and 10 mm beside its place. Each is rendered and reconstructed twice: by the
plan, whose mesh is another, and by one that knows the object. Prints how complete both
clouds are, and the rms error of their deviation maps; returns 1 if completeness differs
by over a point or the rms by over a fifth.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from geometry.files.interchange import to_trimesh
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from planning import RigPlan, load_mesh, load_rig, plan_rig
from planning.verify.audit.coverage.prediction import predict_measured
from planning.verify.reconstruction.captures.captured import reconstruct_rendered
from planning.verify.reconstruction.check.accuracy import (
    Expected,
    measure_completeness,
)
from planning.verify.reconstruction.check.deviation import measure_deviation
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.verification import bare

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data" / "meshes"
HEADS = (
    "face_scan_james.obj",
    "snowden_bust_lo.obj",
    "mediapipe_canonical_face_model.obj",
)
# Their files look along z, y is up; the sample looks along -y, z is up.
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
WAVES_MM = (0.2, 0.5, 2.0)
WAVELENGTH_M = 0.03
PIECE_M = 0.015
SHIFT_M = 0.01


def vertex_normals(mesh: TriangleMesh) -> np.ndarray:
    """Unit normals at vertices, (n, 3)."""
    return np.array(to_trimesh(mesh).vertex_normals)


def waved(mesh: TriangleMesh, amplitude_m: float) -> TriangleMesh:
    """The surface moved along its normals by waves in all three directions."""
    phase = 2.0 * np.pi * mesh.vertices / WAVELENGTH_M
    height = amplitude_m * np.sin(phase).prod(axis=1) * 2.0
    moved = mesh.vertices + np.clip(height, -amplitude_m, amplitude_m)[
        :, None
    ] * vertex_normals(mesh)
    return TriangleMesh(moved, mesh.faces)


def _about(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    """Where the nose ends, and the direction out of it: the foremost vertex."""
    normals = vertex_normals(mesh)
    foremost = int(np.argmin(mesh.vertices[:, 1]))
    return mesh.vertices[foremost] + np.array([0.03, 0.0, 0.05]), normals[foremost]


def dented(mesh: TriangleMesh) -> TriangleMesh:
    """Half a ball of 3 cm missing beside the nose."""
    point, out = _about(mesh)
    away = mesh.vertices - point
    height = away @ out
    aside = np.linalg.norm(away - height[:, None] * out, axis=1)
    inside = (aside < PIECE_M) & (np.abs(height) < 2.0 * PIECE_M)
    depth = np.sqrt(np.maximum(PIECE_M**2 - aside**2, 0.0)) * inside
    return TriangleMesh(mesh.vertices - depth[:, None] * out, mesh.faces)


def with_ball(mesh: TriangleMesh) -> TriangleMesh:
    """Half a ball of 3 cm added there."""
    point, _ = _about(mesh)
    nearest = int(np.argmin(np.linalg.norm(mesh.vertices - point, axis=1)))
    ball = trimesh.creation.icosphere(subdivisions=5, radius=PIECE_M)
    ball.apply_translation(mesh.vertices[nearest])
    n = len(mesh.vertices)
    return TriangleMesh(
        np.concatenate([mesh.vertices, ball.vertices]),
        np.concatenate([mesh.faces, ball.faces + n]),
    )


def in_place_of(mesh: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """Another head upright in the box of the first, as large as fits."""
    turned = TriangleMesh(other.vertices @ UPRIGHT.T, other.faces)
    (low, high), (its_low, its_high) = mesh.bounds, turned.bounds
    scale = ((high - low) / (its_high - its_low)).min()
    moved = (turned.vertices - 0.5 * (its_low + its_high)) * scale
    return TriangleMesh(moved + 0.5 * (low + high), turned.faces)


def objects(mesh: TriangleMesh) -> Iterator[tuple[str, TriangleMesh]]:
    """Yield what stands there in place of the mesh, with its name."""
    yield "the mesh itself", mesh
    for name in HEADS:
        if not (SHARED / name).exists():
            print(f"skipped: {name} isn't there")
            continue
        yield name, in_place_of(mesh, load_mesh(SHARED / name, unit="mm"))
    for amplitude in WAVES_MM:
        yield f"waves of {amplitude} mm", waved(mesh, 1e-3 * amplitude)
    yield "3 cm missing", dented(mesh)
    yield "3 cm added", with_ball(mesh)
    yield "10 mm beside its place", beside(mesh)


def beside(mesh: TriangleMesh) -> TriangleMesh:
    """The same, moved along x."""
    return TriangleMesh(mesh.vertices + np.array([SHIFT_M, 0.0, 0.0]), mesh.faces)


def with_object(plan: RigPlan, mesh: TriangleMesh) -> RigPlan:
    """The same rig about another object, all of which is target."""
    n = len(mesh.faces)
    known = mesh is plan.surface.mesh or n == len(plan.surface.region)
    surface = replace(
        plan.surface,
        mesh=mesh,
        **(
            {}
            if known
            else {
                "member": np.zeros(n, dtype=plan.surface.member.dtype),
                "region": np.zeros(n, dtype=plan.surface.region.dtype),
                "steep": np.zeros((n, 3)),
            }
        ),
    )
    return RigPlan(plan.document, surface)


def expected_of(plan: RigPlan) -> Expected:
    """What the poses should measure of the target."""
    predicted = predict_measured(plan, seed=0)
    return Expected(bare(predicted.samples), predicted.measured, predicted.by_pair)


def held_against(
    result: Reconstruction, plan: RigPlan, truth: RigPlan, expected: Expected
) -> tuple[float, float]:
    """How complete a cloud is of what stood there, and rms errors of its map [m].

    A point's error is how far its deviation from the plan's mesh is from that of the
    nearest point that stood there.
    """
    if not result.n_merged:
        return 0.0, float("nan")
    scanner = Scanner.of(truth)
    complete = measure_completeness(
        result.everything,
        result.merged.cloud,
        expected.within(scanner.target),
        scanner.limits.check.tau_m,
    )
    there = closest_points(scanner.mesh, result.merged.cloud.points).points
    told = measure_deviation(result.merged, Scanner.of(plan), "none").distances
    error = told - closest_points(plan.surface.mesh, there).distances
    return complete.fractions[1], float(np.sqrt(np.mean(error**2)))


def main(arguments: list[str]) -> int:
    """Print the table; return 1 if a cloud falls short."""
    parser = argparse.ArgumentParser()
    parser.add_argument("plan", nargs="?", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args(arguments)
    if options.plan is None:
        mesh = load_mesh(ROOT / "face.obj")
        plan = plan_rig(mesh, load_rig("default"), max_projectors=3, check=False)
    else:
        plan = RigPlan.load(options.plan)
    rows = ["| object | by its own plan: complete, rms | by the plan's mesh | |"]
    rows.append("|---|---|---|---|")
    worst = 0
    for name, mesh in objects(plan.surface.mesh):
        if options.only not in name:
            continue
        begin = time.monotonic()
        truth = with_object(plan, mesh)
        expected = expected_of(truth)
        figures = []
        for believed in (truth, plan):
            result = reconstruct_rendered(
                Scanner.of(believed),
                expected_of(believed),
                seed=0,
                threads=options.threads,
                truth=Scanner.of(truth),
            )
            figures.append(held_against(result, plan, truth, expected))
        (own, own_rms), (whole, rms) = figures
        good = whole >= own - 0.01 and rms <= 1.2 * own_rms
        worst |= not good
        rows.append(
            f"| {name} | {own:.1%}, {1e3 * own_rms:.3f} mm | {whole:.1%}, "
            f"{1e3 * rms:.3f} mm | {'' if good else 'FALLS SHORT'} |"
        )
        print(rows[-1], f"{time.monotonic() - begin:.0f} s", file=sys.stderr)
        for why in result.failures:
            print("   ", why, file=sys.stderr)
    print("\n".join(rows))
    return int(worst)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
