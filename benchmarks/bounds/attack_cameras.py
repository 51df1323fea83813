"""The cameras' proof is attacked: no pose measures a sample that its cell lacks.

Usage: python -m benchmarks.bounds.attack_cameras [--meshes NAME ...] [--poses 20000]
       [--lens default long] [--rows 512] [--finest 7] [--seed 0]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any):
projectors as planned, three at most, and random admissible camera poses, aimed at or
beside the object at any roll, against the cells that the bound on cameras rests on:
those without shadows, those among shadows (of two sizes), and those by aim. What a pose
measures is said by the predicates of `planning.verify.audit`, which share no code with
the planner.

`--lens long` narrows the cameras' field to a quarter, so that it binds.

A pair that the cells lack is looked at again in float64 against every face; what stays
is a violation. Exit 1 if there is any.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.bounds import attack_cells
from benchmarks.bounds.attack_cells import OwnLight, Tally, Tree
from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.devices import PinholeModel
from geometry.files.readers import load_mesh
from geometry.poses import look_at
from planning import load_rig
from planning.model.devices.planned import PlannedProjector
from planning.model.progress import Stopwatch
from planning.model.requirements import Workspace
from planning.projectors.projector_poses import widen_margins
from planning.proofs.all_poses import Effort
from planning.proofs.camera_bound import camera_trees
from planning.proofs.cells.image_cone import image_cone
from planning.report.partial_plan import PlanRequest
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.measuring.measured import LitSamples, lit_samples
from planning.scene.scene import Scene
from planning.steps.prepare import prepared
from planning.steps.stages import first_projectors
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    PAIR_CAUSES,
    SEEN,
    pair_steps,
    sight_steps,
)

_BATCH = 500
_STREAM = 200


class OwnSight:
    """Says what cameras measure, without the planner.

    Args:
        scene: Surface and limits; nothing that it computes is used.
        rows: Samples and who lights them.
        projectors: As they stand.
    """

    def __init__(
        self, scene: Scene, rows: LitSamples, projectors: Sequence[PlannedProjector]
    ) -> None:
        samples, limits = rows.target.samples, scene.requirements
        n = len(samples.points)
        self._samples = AuditSamples(
            samples.points,
            samples.normals,
            samples.faces,
            rows.target.steep,
            np.full(n, -1),
            np.ones(n, dtype=bool),
            np.full(n, samples.weight),
        )
        self._lit, self._limits = rows.lit, limits
        self._lamps = [
            AuditProjector(
                p.device, p.world_from_device, p.world_from_ring, p.ring_radii
            )
            for p in projectors
        ]
        self._shadow = Shadow(scene.mesh, threads=1)
        self._double = OwnLight(scene.mesh, rows.target, 0.0, 0.0, (0.0, np.inf))

    def measured(self, device: PinholeModel, pose: NDArray[np.float64]) -> set[int]:
        """Return the samples that a camera measures with any projector."""
        eye, limits = AuditCamera(device, pose), self._limits
        seen = sight_steps(eye, self._samples, limits.camera, self._shadow) == SEEN
        found = np.zeros(len(self._samples), dtype=bool)
        for p, lamp in enumerate(self._lamps):
            own = np.flatnonzero(seen & self._lit[:, p] & ~found)
            steps = pair_steps(lamp, eye, self._samples.take(own), limits.triangulation)
            found[own] = steps == len(PAIR_CAUSES)
        return set(np.flatnonzero(found).tolist())

    def free_in_double(self, sample: int, position: NDArray[np.float64]) -> bool:
        """Return whether no face at all stands between, in float64."""
        towards = position - self._samples.points[sample]
        return self._double.free_in_double(sample, towards / np.linalg.norm(towards))


def attack(
    scene: Scene,
    device: PinholeModel,
    rows: LitSamples,
    projectors: Sequence[PlannedProjector],
    tree: Tree,
    n_poses: int,
    *,
    seed: int = 0,
) -> Tally:
    """Try random admissible camera poses against a tree.

    Args:
        scene: Surface and limits.
        device: Optics of the cameras.
        rows: Samples of the tree, and who lights them.
        projectors: As they stand.
        tree: The cells.
        n_poses: Poses to try.
        seed: Of the poses.
    """
    rng, own = np.random.default_rng((seed, n_poses)), OwnSight(scene, rows, projectors)
    n_measured, suspects, depth = 0, 0, 0
    violations: list[tuple[tuple[float, ...], int]] = []
    for begin in range(0, n_poses, _BATCH):
        n = min(_BATCH, n_poses - begin)
        poses = random_poses(scene.requirements.workspace, device, rows, n, rng)
        keys = keys_of(scene.requirements.workspace, device, poses)
        held, levels = attack_cells.held_by_cells(tree, keys)
        depth = max(depth, levels)
        for pose, key, cells in zip(poses, keys, held, strict=True):
            measured = own.measured(device, pose)
            n_measured += len(measured)
            for sample in sorted(measured - set(np.flatnonzero(cells).tolist())):
                suspects += 1
                if own.free_in_double(sample, pose[:3, 3]):
                    violations.append((tuple(key.tolist()), sample))
    return Tally(n_poses, n_measured, suspects, tuple(violations), depth)


def keys_of(
    space: Workspace, device: PinholeModel, poses: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return what cells hold: Q - centre and the axis of the image's cone, (n, 6)."""
    axes = poses[:, :3, :3] @ image_cone(device).axis
    return np.column_stack([poses[:, :3, 3] - np.array(space.centre), axes])


def random_poses(
    space: Workspace,
    device: PinholeModel,
    rows: LitSamples,
    n: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return poses at random places of the workspace, at any roll, (n, 4, 4).

    They look at a sample, less far or farther beside it than the image is wide.
    """
    points = rows.target.samples.points
    (near, far), beta = space.camera_radius_m, image_cone(device).half_angle
    poses: list[NDArray[np.float64]] = []
    while len(poses) < n:
        outwards = rng.normal(size=3)
        outwards /= np.linalg.norm(outwards)
        offset = rng.uniform(near, far) * outwards
        low = space.floor_m is not None and offset @ np.array(space.up) < space.floor_m
        if outwards @ np.array(space.axis) < np.cos(space.half_angle) or low:
            continue
        position = np.array(space.centre) + offset
        aim = points[rng.integers(len(points))]
        aside = np.tan(beta) * np.linalg.norm(aim - position) * rng.uniform(-1, 1, 3)
        turn = rng.normal(size=3)
        poses.append(look_at(position, aim + rng.choice([0.0, 1.0]) * aside, turn))
    return np.stack(poses)


def trees_of(
    scene: Scene, device: PinholeModel, rows: LitSamples, finest: int, aims: int
) -> dict[str, Tree]:
    """Return the planner's cells; without shadows only, where it leaves these out."""
    effort = Effort(finest=finest, aims=aims, maps=finest, budget=1.0, shadows=np.inf)
    names = ("without shadows", "among shadows", "by aim")
    trees = camera_trees(scene, (device,), rows, effort)
    return {
        name: tree
        for name, (tree, shadows) in zip(names, trees, strict=False)
        if shadows or not name.startswith("among")
    }


def main() -> int:
    """Print the table; return 1 if a bound rests on a cell that lacks a sample."""
    given = _arguments()
    print(
        f"{machine()}\n\n"
        f"{given.rows} samples a mesh, cells down to {1 << given.finest} an edge of "
        f"the cube (a quarter without shadows), seed {given.seed}\n\n"
        "| mesh | faces | lens | cells | poses | measured pairs | suspects | "
        "violations | levels | seconds |\n|---|---|---|---|---|---|---|---|---|---|",
        flush=True,
    )
    total = 0
    for path, options, up in jobs(given.meshes):
        mesh, _ = cut_for_curvature(load_mesh(path, **options))
        wishes = Wishes(max_projectors=3, up=up)
        order = PlanRequest(mesh, load_rig("default"), wishes)
        ready = prepared(order, Stopwatch())
        projectors = widen_margins(ready.scene, first_projectors(ready, Stopwatch()))
        target = ready.scene.target_samples(Draw(given.rows, _STREAM))
        rows = lit_samples(ready.scene, projectors, target)
        for lens in given.lens:
            device = lens_of(order.rig.camera_device(), lens)
            trees = trees_of(ready.scene, device, rows, given.finest, 4)
            for name, tree in trees.items():
                begin = time.perf_counter()
                tally = attack(
                    ready.scene,
                    device,
                    rows,
                    projectors,
                    tree,
                    given.poses,
                    seed=given.seed,
                )
                total += len(tally.violations)
                print(
                    f"| {path.name} | {len(mesh.faces):,} | {lens} | {name} | "
                    f"{tally.poses:,} | {tally.lit:,} | {tally.suspects} | "
                    f"{len(tally.violations)} | {tally.depth} | "
                    f"{time.perf_counter() - begin:.0f} |",
                    flush=True,
                )
                for key, sample in tally.violations[:3]:
                    print(f"violation: sample {sample}, pose {key}", file=sys.stderr)
    print(f"\n{total} violations", flush=True)
    return 1 if total else 0


def lens_of(device: PinholeModel, lens: str) -> PinholeModel:
    """Return a camera as it comes, or with a field a quarter as wide."""
    if lens == "default":
        return device
    matrix = device.camera_matrix.copy()
    matrix[[0, 1], [0, 1]] *= 4.0
    return replace(device, camera_matrix=matrix)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="attack on the cells of cameras")
    parser.add_argument("--meshes", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--poses", type=int, default=20_000)
    lenses = ("default", "long")
    parser.add_argument("--lens", nargs="+", default=lenses, choices=lenses)
    parser.add_argument("--rows", type=int, default=512, help="samples of the target")
    parser.add_argument("--finest", type=int, default=7, help="2^finest cells an edge")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
