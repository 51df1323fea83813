"""The bound over all poses for cameras, given the projectors.

The samples are those that the projectors light and some candidate measures, frozen as a
set, and so is how many of them must be measured: the cover's own. Cells hold every
position of the workspace, each with a superset of what a camera anywhere inside it
measures with these projectors, however it is aimed and rolled (`measurable_cells`);
of several models, what one of any model measures. How many there are of each is left
out, which only takes away.
Where the object overflows the image, cells are cut by aim as well (`aim_cells`).

Shadows are counted only if the bound without them stays below the count: they cost
most, and what is proved without them holds with them. So with cells by aim.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.devices import PinholeModel
from geometry.directions.cube_map import cube_map
from geometry.directions.open_directions import DirectionLimits
from geometry.directions.widened_maps import WidenedMaps
from planning.proofs.cells.aim_cells import AimTree
from planning.proofs.cells.direction_cells import mesh_reach, open_samples
from planning.proofs.cells.image_cone import image_cone
from planning.proofs.cells.measurable_cells import MeasurableCells
from planning.proofs.cells.position_cells import PositionTree
from planning.proofs.cells.seen_cells import SeenCells
from planning.scene.measuring.measured import LitSamples
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers.cells.cell_bound import CellStatus

from .all_poses import BoundQuestion, ContinuousBound, Effort

# Levels by which cells without shadows are rougher than those among them.
_ROUGHER = 2
DEFAULT = Effort(
    finest=8,
    aims=None,
    maps=5,
    budget=2.5e9,
    shadows=3e8,
    most_samples=2000,
    starts=1,
)
# Of what is asked only to spare a search: rough cells, no shadows.
ROUGH = replace(DEFAULT, shadows=0.0, budget=1.2e9)
PROVE = Effort(finest=9, aims=5, maps=7, budget=3e10, shadows=np.inf, starts=4)


def bound_cameras(
    scene: Scene,
    devices: Sequence[PinholeModel],
    samples: LitSamples,
    question: BoundQuestion,
    effort: Effort,
    known: NDArray[np.bool_] | None = None,
) -> ContinuousBound:
    """Bound the cameras over every pose of the workspace, for given projectors.

    The samples are those that some candidate measures and no existing camera does;
    which of them each candidate measures, (k, n), guides the search.
    """
    if question.count <= 1:
        # What is required takes one, with shadows or without: no cell is looked at.
        effort = replace(effort, finest=0, aims=None, shadows=0.0)
    trees = camera_trees(scene, devices, samples, effort)
    tree, shadows = next(trees)
    best = question.searched(tree, effort.budget, known)
    # The next tree is asked for only where it is needed: shadows cost most.
    while best.status is not CellStatus.PROVED and (finer := next(trees, None)):
        tree, among_shadows = finer
        better = question.searched(tree, effort.budget, known)
        # Cut short, a finer search may have proved less.
        if better.lower_bound >= best.lower_bound:
            best, shadows = better, among_shadows
    shadows = shadows or best.status is CellStatus.PROVED
    return ContinuousBound(question, best, shadows, np.empty((0, 3)))


def rough_bound(
    scene: Scene,
    devices: Sequence[PinholeModel],
    samples: LitSamples,
    question: BoundQuestion,
) -> int:
    """Return what the roughest cells prove, which costs least."""
    tree, _ = next(camera_trees(scene, devices, samples, ROUGH))
    return int(question.searched(tree, ROUGH.budget).lower_bound)


def camera_trees(
    scene: Scene, devices: Sequence[PinholeModel], samples: LitSamples, effort: Effort
) -> Iterator[tuple[PositionTree | AimTree, bool]]:
    """Yield the trees to search, and whether shadows are counted in each.

    Cells of positions; finer ones among shadows; the same by aim, if that is of use.
    """
    space, drawn = scene.requirements.workspace, samples.target.samples
    if scene.requirements.pattern == "none":
        limits = SeenCells(
            samples.target,
            scene.requirements,
            devices,
            check_cancelled=scene.check_cancelled,
        )
    else:
        limits = MeasurableCells(
            samples, scene.requirements, devices, check_cancelled=scene.check_cancelled
        )
    ends = [device.range_m for device in devices]
    reaches = min(low for low, _ in ends), max(high for _, high in ends)

    def positions(finest: int, maps: WidenedMaps | None) -> PositionTree:
        radius = space.camera_radius_m
        return PositionTree(
            space,
            radius,
            reaches,
            drawn.points,
            maps,
            finest=finest,
            limits=limits,
            threads=scene.visibility.caster.threads,
        )

    # The roughest says soon whether shadows are needed at all.
    yield positions(max(effort.finest - _ROUGHER, 0), None), False
    near = space.camera_radius_m[0]
    shadows = len(samples.target) * len(
        scene.mesh.faces
    ) <= effort.shadows and near >= mesh_reach(scene)
    maps = _shadow_maps(scene, samples.target, effort.maps) if shadows else None
    finest = positions(effort.finest, maps)
    yield finest, shadows
    reach = float(lengths(drawn.points - np.array(space.centre)).max())
    # Where a camera that looks at the centre misses no sample, aims forbid nothing.
    if effort.aims is not None and not any(d.holds_ball(reach, near) for d in devices):
        widest = max(image_cone(device).half_angle for device in devices)
        yield AimTree(finest, widest, finest=effort.aims), shadows


def _shadow_maps(scene: Scene, samples: Target, finest: int) -> WidenedMaps:
    """Directions that are open to samples; incidence is cameras' only limit of them."""
    cube = cube_map(1 << finest)
    incidence = scene.requirements.camera.max_incidence
    limits = DirectionLimits(incidence, 0.0, closely=False)
    near = scene.requirements.workspace.camera_radius_m[0]
    opened = open_samples(scene, limits, samples, cube, shadows=True, nearest_m=near)
    return WidenedMaps(opened, cube)
