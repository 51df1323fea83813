"""What three projectors light of the sample at most where no region stays dark.

Usage: python -m benchmarks.plans.dark_region [--starts N]

Asks for 30 % of every region of at least 1 % of the target. Of a lattice of 640 poses
at the far end of the shell, all threes with a pose that lights a fifth of region 8 (the
back of an ear) and that together light 87.5 % of 4,000 samples and half of every floor
are listed; the best N of them that stand 16 degrees apart are moved, three at once,
over poses from less and less far (every three of 61 each), by 4,000, then by 12,000
samples. Prints what is lit of 60,000 samples that had no say, of all and of the worst
region, by the poses and by the same directions from farther away.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from benchmarks.bounds.continuous_bounds import jobs
from geometry.curvature.refinement import cut_for_curvature
from planning import load_mesh, load_rig
from planning.model.devices.device_poses import moved_to
from planning.model.devices.planned import PlannedProjector
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import CandidateSet, CandidateSource
from planning.proofs.quotas import Quotas, RegionFloors
from planning.report.partial_plan import PlanRequest
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.scene import Scene
from planning.steps.prepare import prepared

_N, _REGION, _FLOOR, _SHARE = 640, 8, 0.3, 0.01
_COARSE, _FINE = (1.0, 1.0, 0.5, 0.25), (0.5, 0.25, 0.12)
_ROUGH, _EXACT, _FRESH = Draw(4000, 5000), Draw(12_000, 7000), Draw(60_000, 7900)
_FURTHER = (0.0, 0.1, 0.2, 0.3)
# A sample that a floor lacks counts as so many of all.
_LACK = 5.0
_Three = tuple[PlannedProjector, ...]


def main() -> int:
    """Print a table."""
    parser = argparse.ArgumentParser(description="three projectors, no dark region")
    parser.add_argument("--starts", type=int, default=25)
    starts = parser.parse_args().starts
    ((path, options, _),) = jobs(["face.obj"])
    mesh, _ = cut_for_curvature(load_mesh(path, **options))
    wishes = Wishes(max_projectors=20, region_coverage=_FLOOR)
    ready = prepared(PlanRequest(mesh, load_rig("default"), wishes), Stopwatch())
    required = replace(ready.scene.requirements, region_share=_SHARE)
    scene = replace(ready.scene, requirements=required)
    source = CandidateSource(scene, ready.templates)
    shell = required.workspace.projector_radius_m[1]
    print(
        "| start | lit by 12,000 samples | "
        + " | ".join(
            f"lit of 60,000 and worst region at {shell + m:.2f} m" for m in _FURTHER
        )
        + " |\n|---|---|"
        + "---|" * len(_FURTHER)
    )
    for number, three in enumerate(_starts(scene, source, starts), 1):
        moved, _ = _moved(scene, source, three, _ROUGH, _COARSE)
        moved, lit = _moved(scene, source, moved, _EXACT, _FINE)
        cells = [f"{lit:.2%}"]
        for further in _FURTHER:
            all_lit, worst = _judged(scene, _at(moved, scene, shell + further))
            cells.append(f"{all_lit:.2%}, {worst:.0%}")
        print(f"| {number} | {' | '.join(cells)} |", flush=True)
    return 0


def _at(projectors: _Three, scene: Scene, radius_m: float) -> _Three:
    """The same directions from the centre, at another distance."""
    centre, moved = (
        np.array(scene.requirements.workspace.centre),
        list[PlannedProjector](),
    )
    for projector in projectors:
        pose = projector.world_from_device.copy()
        offset = pose[:3, 3] - centre
        pose[:3, 3] = centre + (radius_m - 1e-4) * offset / np.linalg.norm(offset)
        moved.append(moved_to(projector, pose))
    return tuple(moved)


def _starts(scene: Scene, source: CandidateSource, n: int) -> Iterator[_Three]:
    """The best threes of a lattice that light region 8, apart from each other."""
    samples = scene.target_samples(_ROUGH)
    far = scene.requirements.workspace.projector_radius_m[1]
    lattice = CandidateSet.over(scene, samples, _at(source.lattice(_N), scene, far))
    lit = lattice.lit
    inside = scene.region[samples.samples.faces] == _REGION
    single, threes = lit.sum(axis=0), list[tuple[int, int, int, int]]()
    for first in np.flatnonzero(lit[inside].sum(axis=0) >= 0.2 * inside.sum()):
        rest = lit[~lit[:, first]].astype(np.float32)
        gain = rest.sum(axis=0)
        total = single[first] + gain[:, None] + gain - rest.T @ rest
        for a, b in zip(*np.nonzero(np.triu(total) >= 0.875 * len(lit)), strict=True):
            threes.append((-int(total[a, b]), int(first), int(a), int(b)))
    regions = RegionFloors.of(scene, samples)
    every = regions.counts(np.ones(len(lit), dtype=bool))
    centre, used = scene.requirements.workspace.centre, list[NDArray[np.float64]]()
    for _, *chosen in sorted(threes):
        met = regions.counts(lit[:, chosen].any(axis=1)) >= 0.5 * _FLOOR * every
        if not met[1:].all():
            continue
        three = lattice.of(np.array(chosen))
        offsets = np.array([p.world_from_device[:3, 3] - centre for p in three])
        backs = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
        near = np.cos(np.radians(16.0))
        if not any(
            np.all(np.sum(backs[list(order)] * other, axis=1) > near)
            for other in used
            for order in permutations(range(3))
        ):
            used.append(backs)
            yield three
        if len(used) == n:
            return


def _moved(
    scene: Scene,
    source: CandidateSource,
    three: _Three,
    draw: Draw,
    scales: tuple[float, ...],
) -> tuple[_Three, float]:
    """The best three of poses around each, at each scale; and the share they light."""
    samples, share = scene.target_samples(draw), 0.0
    far = scene.requirements.workspace.projector_radius_m[1]
    regions = RegionFloors.of(scene, samples)
    quotas = Quotas.of(regions, np.ones(len(samples), dtype=bool), 0.9, spare=1.0)
    for scale in scales:
        around = [
            (p, *_at(source.around([p], _N, 0.8 * scale), scene, far)) for p in three
        ]
        sets = [CandidateSet.over(scene, samples, poses) for poses in around]
        best = -np.inf
        for i in range(len(around[0])):
            dark, total, lack = ~sets[0].lit[:, i], 0.0, 0.0
            for number in range(regions.n_rows):
                rows = dark & (regions.row == number)
                a, b = (one.lit[rows].astype(np.float32) for one in sets[1:])
                lit = a.sum(axis=0)[:, None] + b.sum(axis=0) - a.T @ b
                lit += int((regions.row == number).sum() - rows.sum())
                total = total + lit
                lack = lack + np.clip(quotas.floors[number] - lit, 0.0, None)
            worth = total - _LACK * lack
            j, k = np.unravel_index(int(np.argmax(worth)), worth.shape)
            if worth[j, k] > best:
                best, share = worth[j, k], float(total[j, k]) / len(samples)
                three = around[0][i], around[1][j], around[2][k]
    return three, share


def _judged(scene: Scene, projectors: _Three) -> tuple[float, float]:
    samples = scene.target_samples(_FRESH)
    regions = RegionFloors.of(scene, samples)
    lit = CandidateSet.over(scene, samples, projectors).reached
    every = regions.counts(np.ones(len(lit), dtype=bool))
    return float(lit.mean()), float(
        (regions.counts(lit) / np.maximum(every, 1))[1:].min()
    )


if __name__ == "__main__":
    raise SystemExit(main())
