"""The proof is attacked: no pose lights a sample that the cell it stands in lacks.

Usage: python -m benchmarks.bounds.attack_cells [--meshes NAME ...] [--poses 100000]
       [--light parallel diverging] [--rig-fit default close] [--rows 512]
       [--finest 6] [--seed 0]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any):
random admissible poses, each against all samples of the target, in the tree of cells
that a bound over all poses rests on. The code that says what is lit is this file's own:
numpy for incidence and tangent angle, trimesh's embree for shadows, with offsets of its
own, and it finds a pose's cell by a formula of its own. The field of view is left out,
as in the cells: some aim shows each sample.

`--rig-fit default` is the rig as it comes; `close` brings its shell to 1.55 to 2.2
radii of the object, where a cell of positions looks widest, with a range to match and a
beam a tenth as wide as the object. A mesh that
reaches into the shell has no cells with shadows, and is passed over.

A pair that the tree lacks is looked at again in float64 against every face; what
stays is a violation. Exit 1 if there is any.
"""

import argparse
import os
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.ray.ray_pyembree import RayMeshIntersector

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from planning import load_rig
from planning.model.devices.planned import PlannedProjector
from planning.model.progress import Stopwatch
from planning.model.requirements import Workspace
from planning.proofs.all_poses import BoundQuestion, Effort
from planning.proofs.cells.aim_cells import AimTree
from planning.proofs.cells.direction_cells import DirectionTree
from planning.proofs.cells.position_cells import PositionTree
from planning.proofs.projector_bound import bound_projectors
from planning.report.partial_plan import PlanRequest
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.steps.prepare import prepared

ROOT = Path(__file__).resolve().parents[2]
LIGHTS = ("parallel", "diverging")
FITS = ("default", "close")
Tree = DirectionTree | PositionTree | AimTree
# Rays start this high above a sample's face, in half diagonals of the mesh: far over
# the roundings of float32, and well under what the planner lets no ray decide.
_HEIGHT = 1e-5
_BATCH = 500
_STREAM = 100


@dataclass(frozen=True, eq=False)
class Poses:
    """Random poses: where a device stands, or what its light runs towards.

    Attributes:
        towards: Unit vectors from each sample to the device, shape (m, n, 3).
        distance: Of the device from each sample in [m], inf in parallel light, (m, n).
        key: What a cell holds: the direction u = -L, or Q - centre in [m], (m, 3).
        inside: Samples that the beam can hold at that pose, (m, n).
    """

    towards: NDArray[np.float64]
    distance: NDArray[np.float64]
    key: NDArray[np.float64]
    inside: NDArray[np.bool_]


@dataclass(frozen=True)
class Tally:
    """What an attack saw.

    Attributes:
        poses: Tried.
        lit: Pairs of pose and sample that are lit.
        suspects: Lit pairs whose sample a cell of the pose lacks.
        violations: Those that float64 confirms: pose key and sample.
        depth: Levels of cells looked at, at most.
    """

    poses: int
    lit: int
    suspects: int
    violations: tuple[tuple[tuple[float, ...], int], ...]
    depth: int


class OwnLight:
    """Says what is lit, without the planner.

    Args:
        mesh: The occluder.
        rows: Samples.
        max_incidence: theta_max [rad].
        min_tangent_angle: tau_min [rad].
        range_m: Least and largest distance in diverging light [m].
    """

    def __init__(
        self,
        mesh: TriangleMesh,
        rows: Target,
        max_incidence: float,
        min_tangent_angle: float,
        range_m: tuple[float, float],
    ) -> None:
        used = mesh.vertices[np.unique(mesh.faces)]
        low, high = used.min(axis=0), used.max(axis=0)
        self._middle, self._half = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low)
        self._corners = (mesh.vertices[mesh.faces] - self._middle) / self._half
        body = trimesh.Trimesh(
            (mesh.vertices - self._middle) / self._half, mesh.faces, process=False
        )
        self._embree = RayMeshIntersector(body)
        self._points = (rows.samples.points - self._middle) / self._half
        self._normals, self._steep = rows.samples.normals, rows.steep
        self._least = np.cos(max_incidence)
        self._most = np.cos(min_tangent_angle)
        self._range = range_m

    def lit(self, poses: Poses) -> NDArray[np.bool_]:
        """Return which samples each pose lights, shape (m, n)."""
        facing = np.einsum("mni,ni->mn", poses.towards, self._normals)
        along = np.abs(np.einsum("mni,ni->mn", poses.towards, self._steep))
        near, far = self._range
        lit = (facing >= self._least) & (along <= self._most) & poses.inside
        lit &= ~np.isfinite(poses.distance) | (
            (poses.distance >= near) & (poses.distance <= far)
        )
        pose, sample = np.nonzero(lit)
        u = poses.towards[pose, sample]
        starts = self._starts(sample, u)
        # Outside the shell nothing stands: any hit is on the way to the device.
        blocked = self._embree.intersects_any(starts, u)
        lit[pose[blocked], sample[blocked]] = False
        return lit

    def free_in_double(self, sample: int, u: NDArray[np.float64]) -> bool:
        """Return whether no face at all is met, by Moeller and Trumbore's test."""
        start = self._starts(np.array([sample]), u[None])[0]
        a, b, c = (self._corners[:, k] for k in range(3))
        e1, e2 = b - a, c - a
        h = np.cross(u, e2)
        det = np.einsum("ij,ij->i", e1, h)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = start - a
            v = np.einsum("ij,ij->i", s, h) / det
            q = np.cross(s, e1)
            w = q @ u / det
            t = np.einsum("ij,ij->i", e2, q) / det
        edge = -1e-9
        return not np.any((v >= edge) & (w >= edge) & (v + w <= 1 - edge) & (t > 0))

    def _starts(
        self, sample: NDArray[np.int64], u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        rise = np.einsum("ij,ij->i", u, self._normals[sample])
        return self._points[sample] + u * (_HEIGHT / rise)[:, None]


def attack(
    scene: Scene,
    template: PlannedProjector,
    rows: Target,
    tree: Tree,
    n_poses: int,
    *,
    seed: int = 0,
) -> Tally:
    """Try random admissible poses against a tree.

    Args:
        scene: Surface and limits; nothing that it computes is used.
        template: Light and optics.
        rows: Samples of the tree.
        tree: The cells.
        n_poses: Poses to try.
        seed: Of the poses.
    """
    limits, rng = scene.requirements.projector, np.random.default_rng((seed, n_poses))
    own = OwnLight(
        scene.mesh,
        rows,
        limits.max_incidence,
        limits.min_tangent_angle,
        template.device.range_m,
    )
    n_lit, suspects, depth = 0, 0, 0
    violations: list[tuple[tuple[float, ...], int]] = []
    for begin in range(0, n_poses, _BATCH):
        n = min(_BATCH, n_poses - begin)
        poses = random_poses(scene, template, rows, n, rng)
        lit = own.lit(poses)
        n_lit += int(lit.sum())
        held, levels = held_by_cells(tree, poses.key)
        depth = max(depth, levels)
        for pose, sample in np.argwhere(lit & ~held).tolist():
            suspects += 1
            if own.free_in_double(sample, poses.towards[pose, sample]):
                violations.append((tuple(poses.key[pose].tolist()), sample))
    return Tally(n_poses, n_lit, suspects, tuple(violations), depth)


def random_poses(
    scene: Scene,
    template: PlannedProjector,
    rows: Target,
    n: int,
    rng: np.random.Generator,
) -> Poses:
    """Return poses at random places of the workspace; parallel ones aim at the body."""
    space, points = scene.requirements.workspace, rows.samples.points
    centre = np.array(space.centre)
    offsets = _places(space, n, rng)
    if template.light == "diverging":
        away = (centre + offsets)[:, None] - points
        distance = np.linalg.norm(away, axis=2)
        everywhere = np.ones(distance.shape, dtype=bool)
        return Poses(away / distance[:, :, None], distance, offsets, everywhere)
    # Towards a sample, and by up to the beam's width beside it.
    device = template.device
    width = float(np.hypot(*device.half_panel))  # type: ignore[union-attr]
    width = min(width, device.beam_radius or np.inf)  # type: ignore[union-attr]
    aims = points[rng.integers(0, len(points), n)] + _balls(n, rng) * width
    u = centre + offsets - aims
    u /= np.linalg.norm(u, axis=1)[:, None]
    from_axis = points - (centre + offsets)[:, None]
    along = np.einsum("mni,mi->mn", from_axis, u)
    across = np.linalg.norm(from_axis - along[:, :, None] * u[:, None], axis=2)
    towards = np.broadcast_to(u[:, None], from_axis.shape)
    return Poses(towards, np.full(along.shape, np.inf), u, across <= width)


def _places(space: Workspace, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Random Q - centre [m]: even over the shell's radii and directions, (n, 3)."""
    near, far = space.projector_radius_m
    found = np.empty((0, 3))
    while len(found) < n:
        outwards = rng.normal(size=(4 * n, 3))
        outwards /= np.linalg.norm(outwards, axis=1)[:, None]
        offsets = rng.uniform(near, far, (4 * n, 1)) * outwards
        kept = outwards @ np.array(space.axis) >= np.cos(space.half_angle)
        if space.floor_m is not None:
            kept &= offsets @ np.array(space.up) >= space.floor_m
        found = np.concatenate([found, offsets[kept]])
    return found[:n]


def _balls(n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1)[:, None] * rng.random((n, 1)) ** (1 / 3)


def held_by_cells(
    tree: Tree, keys: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], int]:
    """Return the samples that every cell of each pose holds, (m, n), and the levels."""
    batch, m = tree.roots(), len(keys)
    held, depth = np.ones((m, tree.n_rows), dtype=bool), 0
    alive, owner = np.arange(m), np.zeros(m, dtype=np.int64)
    names, parents, rows = batch.cells, np.zeros(batch.cells.size, int), batch.rows
    while names.size:
        # Parts of one cell follow each other.
        first = np.searchsorted(parents, np.arange(owner.max() + 2))
        many = np.diff(first)
        split = many[owner] > 0
        alive, owner = alive[split], owner[split]
        steps = np.arange(many.max())
        part = np.minimum(first[owner][:, None] + steps, names.size - 1)
        inside = lies_in(tree, names[part], keys[alive][:, None])
        inside &= steps < many[owner][:, None]
        found = inside.any(axis=1)
        # A pose whose cell was split and that none of the parts holds is lost.
        held[alive[~found]] = False
        taken = np.take_along_axis(part, inside.argmax(axis=1)[:, None], axis=1)[:, 0]
        alive, taken = alive[found], taken[found]
        bits = np.unpackbits(rows.view(np.uint8), axis=1, count=tree.n_rows)
        held[alive] &= bits[taken].astype(bool)
        depth += 1
        if not alive.size:
            break
        own, owner = np.unique(taken, return_inverse=True)
        batch = tree.children(names[own])
        names, parents, rows = batch.cells, batch.parents, batch.rows
    return held, depth


def lies_in(
    tree: Tree, names: NDArray[np.int64], keys: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether cells hold keys: face, both equal angles and radii, shape of names.

    Cells are numbered as the documentation of the cube map says.

    Args:
        tree: The cells.
        names: Cells, shape (m, k).
        keys: One for each row, shape (m, 1, 3); of cameras the aim follows.
    """
    own = np.broadcast_to(keys, (*names.shape, keys.shape[2]))
    if isinstance(tree, AimTree):
        place, level, aim = (
            part.reshape(names.shape) for part in tree.cells(names.ravel())
        )
        looks = level < 0
        looks |= in_direction_cell(np.maximum(level, 0), aim, own[:, :, 3:])
        return looks & lies_in(tree.positions, place, keys)
    own = own[:, :, :3]
    if isinstance(tree, DirectionTree):
        flat, cell = tree.place(names.ravel())
        low, high = np.zeros(flat.size), np.full(flat.size, np.inf)
    else:
        found = tree.cells(names.ravel())
        flat, cell, low, high = found.level, found.cell, found.low_m, found.high_m
    inside = in_direction_cell(
        flat.reshape(names.shape), cell.reshape(names.shape), own
    )
    radius = np.linalg.norm(own, axis=2)
    inside &= radius >= low.reshape(names.shape)
    return inside & (radius <= high.reshape(names.shape))


def in_direction_cell(
    level: NDArray[np.int64], cell: NDArray[np.int64], own: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether directions lie in cells of cube maps, shape (m, k)."""
    n = 1 << level
    face, rest = np.divmod(cell, n * n)
    axis, sign = face // 2, 1.0 - 2.0 * (face % 2)
    x, y, z = (
        np.take_along_axis(own, ((axis + s) % 3)[:, :, None], axis=2)[:, :, 0]
        for s in (1, 2, 0)
    )
    inside = sign * z > 0
    for across, index in ((x, rest % n), (y, rest // n)):
        step = (np.arctan2(across, sign * z) / (0.25 * np.pi) + 1.0) * 0.5 * n
        inside &= (step >= index - 1e-9) & (step <= index + 1 + 1e-9)
    return inside


def tree_of(
    scene: Scene, template: PlannedProjector, rows: Target, finest: int
) -> Tree | None:
    """Return the planner's cells with shadows; None where it would leave them out."""
    # As the planner's, cells of positions go on where the maps of shadows end.
    effort = Effort(finest=finest + 2, maps=finest, budget=1.0, shadows=np.inf)
    # One is enough, so that two are never proved and shadows are drawn.
    question = BoundQuestion(1, 2, len(rows), rows.samples.weight)
    bound = bound_projectors(scene, (template,), rows, question, effort)
    tree = bound.found.tree
    assert isinstance(tree, DirectionTree | PositionTree)
    return tree if bound.shadows else None


def main() -> int:
    """Print the table; return 1 if a bound rests on a cell that lacks a sample."""
    given = _arguments()
    print(
        f"{machine()}, trimesh "
        f"{trimesh.__version__}\n\n"
        f"{given.rows} samples a mesh, maps of {1 << given.finest} cells an edge of "
        f"the cube, cells of positions four times as fine, seed {given.seed}\n\n"
        "| mesh | faces | light | rig | poses | lit pairs | suspects | violations | "
        "levels | seconds |\n|---|---|---|---|---|---|---|---|---|---|",
        flush=True,
    )
    total = 0
    for path, options, up in jobs(given.meshes):
        mesh, _ = cut_for_curvature(load_mesh(path, **options))
        for fit in given.rig_fit:
            for light in given.light:
                begin = time.perf_counter()
                scene, template = _scene(mesh, light, up, fit)
                rows = scene.target_samples(Draw(given.rows, _STREAM))
                tree = tree_of(scene, template, rows, given.finest)
                head = f"| {path.name} | {len(mesh.faces):,} | {light} | {fit} |"
                if tree is None:
                    print(f"{head} passed over: the shell cuts the mesh | | | | | |")
                    continue
                tally = attack(
                    scene, template, rows, tree, given.poses, seed=given.seed
                )
                total += len(tally.violations)
                seconds = time.perf_counter() - begin
                print(
                    f"{head} {tally.poses:,} | {tally.lit:,} | {tally.suspects} | "
                    f"{len(tally.violations)} | {tally.depth} | {seconds:.0f} |",
                    flush=True,
                )
                for key, sample in tally.violations[:3]:
                    print(f"violation: sample {sample}, pose {key}", file=sys.stderr)
    print(f"\n{total} violations", flush=True)
    return 1 if total else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="attack on the cells of bounds")
    parser.add_argument("--meshes", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--light", nargs="+", default=LIGHTS, choices=LIGHTS)
    parser.add_argument("--rig-fit", nargs="+", default=FITS[:1], choices=FITS)
    parser.add_argument("--rows", type=int, default=512, help="samples of the target")
    parser.add_argument(
        "--finest", type=int, default=6, help="maps of 2^finest an edge"
    )
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


def _scene(
    mesh: TriangleMesh, light: str, up: str | None, fit: str
) -> tuple[Scene, PlannedProjector]:
    wishes = Wishes(max_projectors=9, up=up)
    order = PlanRequest(
        mesh, load_rig("default", light), wishes, threads=os.cpu_count() or 1
    )
    ready = prepared(order, Stopwatch())
    return fitted(ready.scene, ready.templates[0], fit)


def fitted(
    scene: Scene, template: PlannedProjector, fit: str
) -> tuple[Scene, PlannedProjector]:
    """Return a scene and a projector with the shell of `--rig-fit`."""
    if fit == "default":
        return scene, template
    required = scene.requirements
    centre = np.array(required.workspace.centre)
    corners = scene.mesh.corners.reshape(-1, 3)
    reach = float(np.linalg.norm(corners - centre, axis=1).max())
    space = replace(required.workspace, projector_radius_m=(1.55 * reach, 2.2 * reach))
    # Half of the samples are in range of a pose, or more.
    device = replace(template.device, range_m=(0.8 * reach, 2.5 * reach))
    # A beam a tenth as wide as the body leaves the shell clear of it.
    if hasattr(device, "beam_radius"):
        device = replace(device, beam_radius=0.1 * reach)
    return replace(scene, requirements=replace(required, workspace=space)), replace(
        template, device=device
    )


if __name__ == "__main__":
    sys.exit(main())
