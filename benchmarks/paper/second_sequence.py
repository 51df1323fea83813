"""A second sequence whose rings are determined, against one that halves every gap.

Usage: python -m benchmarks.paper.second_sequence [PLAN ...]

Runs the paper's box and face (a lens that sees all rings) under parallel and diverging
light, then plans of the sample and of a scanned face with at most three projectors,
free ring axes (or the plans named, `plan.json`). Each is measured by a first sequence,
then again with as many rings: midway between the first ones, or where
`planning.verify.reconstruction.density.second_sequence` places them from the first
points. Prints how far the surface is from straight lines between neighbouring rings of
both sequences, along the beam, at eight places of each gap and 720 azimuths, where a
projector lights it and no step is crossed: rms, 99 % and largest. And the share of what
is measurable with a point within half a gap of the first rings, and one; of a plan
within half of tau and tau.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.machine import machine
from geometry.files.readers import load_mesh
from geometry.rays.rays import RayCaster
from planning import RequirementError, RigPlan, load_rig, plan_rig
from planning.experiments.run import double_density, run_experiment
from planning.experiments.setups import paper_experiment
from planning.verify.audit.coverage.prediction import predict_measured
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.check.accuracy import nearest_distance
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.density.second_sequence import (
    both_sequences,
    second_sequence,
)
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.verification import bare

AZIMUTHS, PLACES = 720, 8
MM = 1e3


def main() -> int:
    """Print the table; return 0."""
    print(f"{machine()}\n")
    print("| object | light | second rings | number | rms [mm] | 99 % | largest |")
    print("|---|---|---|---|---|---|---|")
    complete = [*experiments(), *plans(sys.argv[1:])]
    print("\n| object | light | second rings | complete at half a gap | at one |")
    print("|---|---|---|---|---|")
    for cells, shares in complete:
        print(f"| {' | '.join(cells)} | {' | '.join(f'{s:.4f}' for s in shares)} |")
    return 0


def experiments() -> Iterator[tuple[list[str], tuple[float, float]]]:
    """Yield the completeness of box and face."""
    for name in ("box", "face"):
        for light in ("parallel", "diverging"):
            experiment = paper_experiment(name, light=light, variant="fits")
            outcome = run_experiment(experiment)
            first, scanner = outcome.union, experiment.scanner
            for label, second in seconds(scanner, first.cloud).items():
                cells = [name, light, label]
                print_errors(cells, scanner, second)
                if second is None:
                    yield cells, first.complete
                else:
                    yield cells, double_density(outcome, second).complete


def plans(paths: list[str]) -> Iterator[tuple[list[str], tuple[float, float]]]:
    """Yield the completeness of plans."""
    named = [(path, RigPlan.load(path)) for path in paths]
    for label, plan in named or made():
        scanner = Scanner.of(plan)
        predicted = predict_measured(plan, seed=0, threads=2)
        samples = bare(predicted.samples.take(np.flatnonzero(predicted.measured)))
        tau = scanner.limits.check.tau_m
        first = reconstruct(scanner, seed=0).everything
        for rings, second in seconds(scanner, first).items():
            cells = [label, plan.projectors[0].light, rings]
            print_errors(cells, scanner, second)
            cloud = first
            if second is not None:
                again = reconstruct(second, seed=1).everything
                cloud = Cloud.join([first, again])
            apart = nearest_distance(cloud, samples, 1.01 * tau)
            half, whole = (float(np.mean(apart <= s * tau)) for s in (0.5, 1.0))
            yield cells, (half, whole)


def made() -> Iterator[tuple[str, RigPlan]]:
    """Plan the sample, and a scanned face under parallel light."""
    lights = {"face.obj": "diverging", "face_scan_james.obj": "parallel"}
    for path, options, up in jobs(list(lights)):
        mesh, rig = load_mesh(path, **options), load_rig(light=lights[path.name])
        wishes = {"max_projectors": 3, "up": up, "ring_axis": "free", "check": False}
        try:
            yield f"plan of {path.name}", plan_rig(mesh, rig, **wishes)
        except RequirementError as error:
            yield f"plan of {path.name}", error.plan


def seconds(scanner: Scanner, cloud: Cloud) -> dict[str, Scanner | None]:
    """Return the rig with the rings of a second sequence, by how they are placed."""
    halved = []
    for one in scanner.projectors:
        radii = one.pattern.radii
        middle = 0.5 * (np.concatenate([[0.0], radii[:-1]]) + radii)
        halved.append(replace(one, pattern=replace(one.pattern, radii=middle)))
    return {
        "none": None,
        "halved": replace(scanner, projectors=tuple(halved)),
        "determined": second_sequence(scanner, cloud),
    }


def print_errors(cells: list[str], scanner: Scanner, second: Scanner | None) -> None:
    """Print how far chords between the rings of both sequences are off."""
    rig = scanner if second is None else both_sequences(scanner, second)[0]
    number = (
        0 if second is None else sum(len(p.pattern.radii) for p in second.projectors)
    )
    caster = RayCaster(scanner.mesh, threads=2)
    errors, areas = zip(
        *(chord_errors(p, scanner, caster) for p in rig.projectors), strict=True
    )
    off, area = np.concatenate(errors), np.concatenate(areas)
    order = np.argsort(off)
    upper = off[order][np.searchsorted(np.cumsum(area[order]), 0.99 * area.sum())]
    rms = np.sqrt(np.sum(area * off**2) / area.sum())
    print(
        f"| {' | '.join(cells)} | {number} | {MM * rms:.4f} | {MM * upper:.3f} "
        f"| {MM * off.max():.3f} |",
        flush=True,
    )


def chord_errors(
    projector: ProjectorCalibration, scanner: Scanner, caster: RayCaster
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances along the beam and the areas in the ring plane, (k,) each."""
    radii, light = projector.pattern.radii, projector.light
    # The chord through the centre joins two places of the innermost ring.
    ends = np.concatenate([[-radii[0]], radii])
    share = (np.arange(PLACES) + 0.5) / PLACES
    turn = (np.arange(AZIMUTHS) + 0.5) * (2.0 * np.pi / AZIMUTHS)
    off, area = [], []
    for a, b in pairwise(ends):
        rho = np.concatenate([[a], a + (b - a) * share, [b]])
        z, lit = hits(projector, scanner, caster, rho, turn)
        s, t = light.slope_run(rho[:, None], z)
        with np.errstate(invalid="ignore"):
            rise = np.abs(np.diff(t, axis=0)) / np.diff(s, axis=0)
            whole = lit.all(axis=0)
            whole &= (rise <= np.tan(scanner.limits.max_lit)).all(axis=0)
        w = light.chart(z[:, whole])
        inside = rho[1:-1, None]
        chord = w[0] + (w[-1] - w[0]) * ((inside - a) / (b - a))
        strays = np.abs(w[1:-1] - chord) * light.chart_m(inside, z[1:-1, whole])
        off.append(strays.ravel())
        area.append(np.broadcast_to(np.abs(inside) * (b - a), strays.shape).ravel())
    return np.concatenate(off), np.concatenate(area)


def hits(
    projector: ProjectorCalibration,
    scanner: Scanner,
    caster: RayCaster,
    rho: np.ndarray,
    turn: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return z of the first hits and whether they are lit, (n_rho, n_turn) each."""
    flat = rho[:, None, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    origins, beams = projector.light.rays(
        flat.reshape(-1, 2), projector.world_from_ring
    )
    faces, away = caster.first_hits(origins, beams)
    met = faces >= 0
    points = origins + np.where(met, away, 1.0)[:, None] * beams
    z = np.where(met, projector.to_ring(points)[:, 2], np.nan)
    normals = scanner.mesh.face_normals[faces]
    cosine = projector.incidence_cosine(points, normals)
    pixels, _ = projector.panel(points)
    lit = met & (cosine >= np.cos(scanner.limits.max_lit)) & projector.in_panel(pixels)
    shape = len(rho), len(turn)
    return z.reshape(shape), lit.reshape(shape)


if __name__ == "__main__":
    sys.exit(main())
