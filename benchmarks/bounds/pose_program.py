"""What multipliers can prove at most: the linear program over poses.

Usage: python -m benchmarks.bounds.pose_program [NAME ...] [--shares 0.9 0.95]
    [--rounds N] [--target dominant|surface|outside]   (ringrig installed, a checkout)

A bound over all poses that multipliers of the samples prove is at most the fractional
cover of real poses::

    min sum_j x_j   s.t.  sum_j lit_ij x_j >= y_i,  sum_i y_i >= R,  x >= 0, y <= 1

First it is over the candidates. Then poses around those that light most by its
multipliers are priced, and those that cost more than 1 join, N times (10) or until none
does. So each number of the last column is one that no such bound exceeds, however fine
its cells; it may still fall. For diverging light, a tangent limit of 40 degrees and the
2,000 samples that the planner starts from, as `continuous_bounds` has them.
"""

import argparse
import sys
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import block_array, csr_array, eye_array

from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from planning.projectors.candidate_set import CandidateSource
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.quotas import required_samples
from planning.report.partial_plan import Prepared
from planning.rig.wishes import TargetName
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT

from .continuous_bounds import jobs, ready_for, stage_of

_TANGENT_DEG = 40.0
# How far out poses are priced around the dearest, in spacings of so fine a lattice; how
# many of these there are, and how many join at each scale.
_SCALES, _LATTICE, _DEAREST, _JOIN = (1.0, 0.4, 0.15, 0.05), 600, 40, 60
_GAIN = 1e-4

_Mask = NDArray[np.bool_]
_Array = NDArray[np.float64]


def main() -> int:
    """Print the table; return 1 where the program exceeds a count."""
    parser = argparse.ArgumentParser(description="the linear program over poses")
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--shares", nargs="+", type=float, default=(0.9, 0.95))
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--target", choices=get_args(TargetName))
    given = parser.parse_args()
    print(f"{machine()}\n")
    print("| mesh | share | count | over candidates | over more poses | poses |")
    print("|" + 6 * "---|")
    false = False
    for path, options, up in jobs(given.names):
        mesh, _ = cut_for_curvature(load_mesh(path, **options))
        for share in given.shares:
            ready = ready_for(
                mesh, "diverging", up, share, _TANGENT_DEG, target=given.target
            )
            stage = stage_of(ready)
            if stage is None:
                continue
            count = stage.certificate.needed.count
            values, n_poses = _priced(ready, stage, share, given.rounds)
            cells = f"{values[0]:.2f} | {values[-1]:.2f} | {n_poses:,}"
            print(f"| {path.name} | {share:g} | {count} | {cells} |", flush=True)
            false |= bool(values[0] > count + 1e-6)
    return int(false)


def _priced(
    ready: Prepared, stage: ProjectorStage, share: float, rounds: int
) -> tuple[list[float], int]:
    """Values of the program as poses join, and how many poses there are at last."""
    candidates, source = stage.candidates, CandidateSource(ready.scene, ready.templates)
    reached = np.flatnonzero(candidates.reached)
    samples, lit = candidates.samples.take(reached), candidates.lit[reached]
    required = required_samples(candidates.reached, share)
    poses = list(candidates.projectors)
    values: list[float] = []
    for _ in range(1 + rounds):
        value, multipliers = _solved(lit, required)
        values.append(value)
        before = len(poses)
        for scale in _SCALES:
            dearest = np.argsort(-(multipliers @ lit), kind="stable")[:_DEAREST]
            base = [poses[i] for i in dearest]
            around = source.around(base, _LATTICE, scale, far=True)
            lights = lit_stages(ready.scene, around, samples) == LIT
            cost = multipliers @ lights
            some = np.argsort(-cost, kind="stable")[:_JOIN]
            some = some[cost[some] > 1.0 + _GAIN]
            poses += [around[i] for i in some]
            lit = np.hstack([lit, lights[:, some]])
        if len(poses) == before:
            break
    return values, len(poses)


def _solved(lit: _Mask, required: int) -> tuple[float, _Array]:
    """Value of the program over some poses, and the multipliers of the samples."""
    n, k = lit.shape
    # What is missed of each sample, z = 1 - y, stands in for y.
    spare = csr_array(np.ones((1, n)))
    rows = block_array([[-csr_array(lit.astype(float)), -eye_array(n)], [None, spare]])
    answer = linprog(
        np.append(np.ones(k), np.zeros(n)),
        A_ub=rows,
        b_ub=np.append(-np.ones(n), n - required),
        bounds=[(0.0, None)] * k + [(0.0, 1.0)] * n,
        method="highs",
    )
    return float(answer.fun), -answer.ineqlin.marginals[:n]


if __name__ == "__main__":
    sys.exit(main())
