"""Merged clouds against their parts: the paper's box and face, and planned rigs."""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree
from support import shared_meshes

from benchmarks.paper.squarest_projector import squarest_projectors
from geometry.files.readers import load_mesh
from geometry.mesh.sampling import SurfaceSamples, sample_surface
from geometry.rays.rays import RayCaster
from planning.experiments.ring_outcomes import lit_and_seen
from planning.experiments.run import DARK
from planning.experiments.setups import paper_experiment
from planning.model.plan import RequirementError
from planning.pipeline import plan_rig
from planning.rig.rig import load_rig
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.check.accuracy import (
    Expected,
    measure_accuracy,
    nearest_distance,
)
from planning.verify.reconstruction.check.overlaps import pixel_sizes
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.scanner import Scanner

MESHES = (
    "face_scan_james.obj",
    "snowden_bust_lo.obj",
    "tm_fixed_top.ply",
    "tm_reference.obj",
    "vtk_bunny.ply",
    "vtk_horse.ply",
)
ALBEDO = {"plain": 0.0, "textured": 0.5}
N_SAMPLES = 20_000
# A right point lies within so many of its deviations of the place its pixel looks at.
_SIGMAS = 3.0
_OUTLIER_M = 1e-3
_FEWEST = 50
_MM = 1e3


@dataclass(frozen=True)
class Row:
    """One object and albedo.

    Attributes:
        name: Of both.
        rms_m: Of the best pair, the best projector, all points, merged as before, and
            merged [m].
        false: Share beyond 1 mm: of all points, merged as before, merged.
        complete: At half a gap, one and two, of the same three; and the samples that
            merging lost, and won, at half a gap.
        right: Likewise, by right points alone, where their pixels look.
        n_samples: Of the surface.
        beside: Rms of merged points over that of a part at the same place: the worst of
            all pairs within a pixel, within a quarter of a gap, and of all projectors.
        shares: Points in the light of two projectors, redundant, and false at steps.
    """

    name: str
    rms_m: tuple[float, ...]
    false: tuple[float, ...]
    complete: tuple[tuple[float, ...], ...]
    right: tuple[tuple[float, ...], ...]
    n_samples: int
    beside: tuple[float, ...]
    shares: tuple[float, ...]


def rigs() -> Iterator[tuple[str, Scanner, Photometry]]:
    """Yield the experiments in parallel light, and six plans of three projectors."""
    for name in ("box", "face"):
        for variant in ("printed", "fits"):
            experiment = paper_experiment(name, variant=variant)
            yield f"{name}, `{variant}`", experiment.scanner, DARK
    for name in MESHES:
        entry = shared_meshes.BY_NAME[name]
        up = entry.words[-1] if "--up" in entry.words else None
        mesh = load_mesh(entry.path, **entry.options)
        rig = load_rig("default")
        try:
            plan = plan_rig(mesh, rig, max_projectors=3, up=up, check=False, threads=1)
        except RequirementError as short:
            plan = short.plan
        yield name.rsplit(".", 1)[0], Scanner.of(plan), Photometry()


def compare(name: str, scanner: Scanner, light: Photometry) -> Row:
    """Reconstruct, merge both ways, and hold all clouds to the mesh."""
    samples = sample_surface(scanner.mesh, N_SAMPLES, seed=0, within=scanner.target)
    samples = samples.take(lit_and_seen(scanner, samples.points, samples.normals))
    result = reconstruct(
        scanner, seed=0, threads=1, photometry=light, expected=Expected(samples)
    )
    cloud, merged, tau = result.everything, result.merged, scanner.limits.check.tau_m
    clouds = cloud, _before(cloud, scanner), merged.cloud
    errors = [np.abs(measure_accuracy(one, scanner.mesh).distances) for one in clouds]
    pairs = [
        (cloud.projector == p) & (cloud.camera == c) for (p, c), _ in scanner.pairs()
    ]
    projectors = [cloud.projector == p for p in range(len(scanner.projectors))]
    parts = [
        [of for of in kind if np.count_nonzero(of) >= _FEWEST]
        for kind in (pairs, projectors)
    ]
    best = [min(_rms(errors[0][of]) for of in kind) for kind in parts]

    pixel = float(np.median(pixel_sizes(cloud, scanner)))

    def beside(of: Array, reach_m: float) -> float:
        near, _ = KDTree(cloud.points[of]).query(merged.cloud.points)
        return _rms(errors[2][near <= reach_m]) / _rms(errors[0][of])

    right = cloud, clouds[1], cloud.take(merged.stays)
    steps = float(merged.steps.mean())
    return Row(
        name,
        (*best, *map(_rms, errors)),
        tuple(float(np.mean(error > _OUTLIER_M)) for error in errors),
        _complete(clouds, samples, tau),
        _complete([_right(one, scanner) for one in right], samples, tau),
        len(samples),
        (
            max(beside(of, pixel) for of in parts[0]),
            *(max(beside(of, 0.25 * tau) for of in kind) for kind in parts),
        ),
        (float(merged.shared.mean()), result.redundant_fraction - steps, steps),
    )


def _before(cloud: Cloud, scanner: Scanner) -> Cloud:
    gaps = np.empty(len(cloud))
    for p, projector in enumerate(scanner.projectors):
        of = cloud.projector == p
        depth = projector.to_ring(cloud.points[of])[:, 2]
        gaps[of] = projector.pattern.gaps_m(cloud.ring[of], depth)
    pitch_px = float(np.median(gaps / pixel_sizes(cloud, scanner)))
    return squarest_projectors(cloud, gap_m=float(np.median(gaps)), pitch_px=pitch_px)


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _right(cloud: Cloud, scanner: Scanner) -> Cloud:
    """Return the right points, each at the place of the surface its pixel looks at."""
    caster, seen = (
        RayCaster(scanner.mesh, threads=1),
        np.full_like(cloud.points, np.nan),
    )
    for c, camera in enumerate(scanner.cameras):
        of = np.flatnonzero(cloud.camera == c)
        faces, away = caster.first_hits(camera.centre, cloud.rays[of])
        hit = np.where(faces >= 0, away, np.nan)[:, None]
        seen[of] = camera.centre + hit * cloud.rays[of]
    off = np.linalg.norm(cloud.points - seen, axis=1)
    sigma = np.linalg.norm(cloud.shift, axis=1) * np.hypot(
        cloud.noise_px, cloud.bias_px
    )
    return replace(cloud, points=seen).take(off <= _SIGMAS * sigma)


def _complete(
    clouds: Sequence[Cloud], samples: SurfaceSamples, tau: float
) -> tuple[tuple[float, ...], ...]:
    nears = [nearest_distance(one, samples, 2.01 * tau) for one in clouds]
    before, after = nears[0] <= 0.5 * tau, nears[-1] <= 0.5 * tau
    return (
        *(tuple(float(np.mean(n <= k * tau)) for k in (0.5, 1.0, 2.0)) for n in nears),
        (float(np.sum(before & ~after)), float(np.sum(after & ~before))),
    )


def print_tables() -> None:
    """Print errors, completeness and shares."""
    print("\n## Merged clouds and their parts\n", flush=True)
    rows: list[Row] = []
    for name, scanner, light in rigs():
        for words, albedo in ALBEDO.items():
            lit = replace(light, albedo_variation=albedo)
            rows.append(compare(f"{name} | {words}", scanner, lit))
            print(rows[-1], file=sys.stderr, flush=True)
    print("Rms [mm] and share beyond 1 mm. Before: one projector a tile, one camera a")
    print(
        "cell. Same place: rms of merged points within a pixel, then a quarter of a gap"
    )
    print("of a part's, over that part's; the worst of all pairs, of all projectors.\n")
    parts = "best pair | best projector | all points | before | now"
    more = "> 1 mm: all, before, now | same place: pair, pair, projector"
    print(f"| object | albedo | {parts} | {more} |")
    print("|---" * 9 + "|")
    for row in rows:
        rms = " | ".join(f"{_MM * value:.4f}" for value in row.rms_m)
        false = ", ".join(f"{100 * share:.2f} %" for share in row.false)
        beside = ", ".join(f"{value:.2f}" for value in row.beside)
        print(f"| {row.name} | {rms} | {false} | {beside} |")
    right = f"by points within {_SIGMAS:g} sigma of where their pixels look, put there"
    for words, select in (("by any point", 0), (right, 1)):
        print(f"\nCompleteness at half / one / two gaps [%], {words}.\n")
        print("| object | albedo | all points | before | now | lost, won of samples |")
        print("|---|---|---|---|---|---|")
        for row in rows:
            *kinds, (lost, won) = row.right if select else row.complete
            cells = " | ".join(
                " / ".join(f"{100 * share:.2f}" for share in shares) for shares in kinds
            )
            counts = f"{lost:.0f}, {won:.0f} of {row.n_samples}"
            print(f"| {row.name} | {cells} | {counts} |")
    print("\nShares of all points [%].\n")
    print("| object | albedo | in the light of two | redundant | false at steps |")
    print("|---|---|---|---|---|")
    for row in rows:
        cells = " | ".join(f"{100 * share:.1f}" for share in row.shares)
        print(f"| {row.name} | {cells} |")
