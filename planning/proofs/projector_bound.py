"""The bound over all poses: how many projectors it takes, wherever they may stand.

The samples are those that the cover over candidates reaches, frozen as a set, and so is
how many of them must be lit. Cells hold every pose of the workspace, each with a
superset of what any of its poses lights; a cover over supersets can't need more. Where
fewer projectors than were found can't be refuted, the cells that are left say where to
look.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel
from geometry.directions.cube_map import CubeMap, cube_map
from geometry.directions.open_directions import DirectionLimits
from geometry.directions.widened_maps import WidenedMaps
from geometry.parallel import mapped
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import Workspace
from planning.proofs.cells.direction_cells import (
    DirectionTree,
    mesh_reach,
    open_samples,
)
from planning.proofs.cells.lit_cells import LitCells
from planning.proofs.cells.position_cells import PositionTree
from planning.scene.lights import light_of
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.scene.workspace.admissible import may_stand
from solvers.bit_rows import BitSum
from solvers.cells.cell_bound import CellBound, CellStatus

from .all_poses import BoundQuestion, ContinuousBound, Effort

_Tree = DirectionTree | PositionTree

_ROOMLESS = Effort(
    finest=8, maps=6, budget=3.5e9, shadows=3e8, most_samples=2000, starts=1
)
_ROOMY = replace(_ROOMLESS, finest=11, maps=7, budget=1.3e10, most_cells=3)
DEFAULT = replace(_ROOMLESS, where_room=_ROOMY)
# Share of the work for a search without shadows, where they can be drawn, and the level
# that its cells end at: finer ones have refuted nothing there.
_FIRST, _FIRST_FINEST = 0.3, 9
PROVE = Effort(
    finest=11,
    maps=7,
    budget=4e10,
    finer_budget=4e10,
    shadows=np.inf,
    offers=150,
    starts=4,
)
# What the multipliers prove over candidates is this share more than they do over all
# poses, and more than cells of any size prove; with less than the other, default work
# ended first wherever that was tried. Bytes that finer maps may take.
_ROOM, _WIDE_ROOM, _MAP_BYTES = 0.05, 0.075, 1.5e8


def bound_projectors(
    scene: Scene,
    templates: Sequence[PlannedProjector],
    samples: Target,
    question: BoundQuestion,
    effort: Effort,
    known: NDArray[np.bool_] | None = None,
    unshadowed: NDArray[np.bool_] | None = None,
) -> ContinuousBound:
    """Bound the projectors over every pose of the workspace.

    Field of view, beam and rings are left out: the bound holds for any of them. Of
    several models it is of the range that any has, and of any number of each.

    The samples are those that some candidate lights and no existing projector does;
    which of them each candidate lights, (k, n), guides the search, and which it would
    light without shadows the search without; that is given up where such candidates
    show that nothing is proved so.
    """
    if question.count <= 1:
        # What is required takes one, with shadows or without: no cell is looked at.
        effort = replace(effort, finest=0, maps=0, shadows=0.0)
    elif effort.where_room is not None and known is not None:
        if question.room(known, effort.budget) >= _WIDE_ROOM:
            effort = effort.where_room
    reach, near = mesh_reach(scene), scene.requirements.workspace.projector_radius_m[0]
    devices = [template.device for template in templates]
    parallel = isinstance(devices[0], ParallelModel)
    # How far off a device's own axis what it lights may be.
    widest = max(light_of(device).image_ring(0.0) for device in devices)
    aside = reach + widest if parallel else 0.0
    depth = float(np.sqrt(max(0.0, near**2 - aside**2)))
    shadows = bool(len(samples) * len(scene.mesh.faces) <= effort.shadows)
    shadows = shadows and bool(depth >= reach)

    def searched(
        effort: Effort,
        known: NDArray[np.bool_] | None,
        *,
        shadows: bool,
        with_floors: bool = True,
        closely: bool = False,
    ) -> tuple[CellBound, _Tree]:
        cube = cube_map(1 << effort.maps)
        required = scene.requirements.projector
        limits = DirectionLimits(required.max_incidence, required.min_tangent_angle)
        if not (parallel or closely):
            # Cells of positions are held against the limits themselves.
            limits = DirectionLimits(required.max_incidence, 0.0, closely=False)
        opened = open_samples(
            scene, limits, samples, cube, shadows=shadows, nearest_m=depth
        )
        if parallel:
            opened[~_within(cube, scene.requirements.workspace, aside)] = 0
            tree = DirectionTree.over(opened, len(samples))
        else:
            tree = _positions(scene, templates, samples, opened, cube, effort.finest)
        found = question.searched(
            tree,
            effort.budget,
            known,
            with_floors=with_floors,
            most_cells=effort.most_cells,
        )
        return found, tree

    # Shadows cost most, and what is proved without them holds with them.
    first, bare = effort, unshadowed if shadows else None
    if shadows:
        maps, finest = max(0, effort.maps - 1), min(effort.finest, _FIRST_FINEST)
        first = replace(effort, maps=maps, finest=finest, budget=_FIRST * effort.budget)
    found: tuple[CellBound, _Tree] | None = None
    if bare is None or question.room(bare, effort.budget) > 0.0:
        guide, floored = (known, True) if bare is None else (bare, False)
        found = searched(first, guide, shadows=False, with_floors=floored)
    if shadows and (found is None or found[0].status is not CellStatus.PROVED):
        among = searched(effort, known, shadows=True)
        finer = replace(
            effort,
            maps=effort.maps + 1,
            finest=effort.finest + 1,
            budget=effort.finer_budget,
        )
        bits = cube_map(1 << finer.maps).size * len(samples)
        if finer.budget and bits <= 8.0 * _MAP_BYTES and _leaves_room(among[0]):
            again = searched(finer, known, shadows=True, closely=True)
            among = max(among, again, key=_proved)
        # Cut short, a longer search may have proved less.
        if shadows := found is None or _proved(among) >= _proved(found):
            found = among
    assert found is not None
    bound, tree = found
    unrefuted = np.empty((0, 3))
    if bound.status in (CellStatus.SURVIVED, CellStatus.CUT):
        unrefuted = _promising(bound, tree, effort.offers)
    shadows = shadows or question.count <= 1
    return ContinuousBound(question, bound, shadows, unrefuted)


def _leaves_room(bound: CellBound) -> bool:
    """Return whether fewer than the count weren't refuted, and finer maps may do so."""
    fewer = max(bound.count - 1, 1)
    left = bound.status is not CellStatus.PROVED and not bound.out_of_work
    return left and bound.over_known >= (1.0 + _ROOM) * fewer


def _proved(found: tuple[CellBound, _Tree]) -> float:
    return found[0].lower_bound


def _positions(
    scene: Scene,
    templates: Sequence[PlannedProjector],
    samples: Target,
    rows: NDArray[np.uint64],
    cube: CubeMap,
    finest: int,
) -> PositionTree:
    """Return the cells of positions, by the samples open to each cell of a map."""
    workspace, threads = scene.requirements.workspace, scene.visibility.caster.threads
    opened, closed = mapped(lambda of: WidenedMaps(of, cube), (rows, ~rows), threads)
    ranges = [template.device.range_m for template in templates]
    return PositionTree(
        workspace,
        workspace.projector_radius_m,
        (min(least for least, _ in ranges), max(most for _, most in ranges)),
        samples.samples.points,
        opened,
        finest=finest,
        closed=closed,
        limits=LitCells(samples, scene.requirements.projector),
        threads=threads,
    )


def _promising(bound: CellBound, tree: _Tree, n: int) -> NDArray[np.float64]:
    """Return the directions of cells that weren't refuted, and of n more.

    In these a projector would save most, by the multipliers.
    """
    names, covered = tree.spread_cells()
    values = BitSum(bound.multipliers)(covered)
    best = names[np.argsort(-values, kind="stable")[:n]]
    if bound.survivor is not None:
        best = np.concatenate([np.unique(bound.survivor), best])
    return tree.directions(best) if best.size else np.empty((0, 3))


def _within(cube: CubeMap, workspace: Workspace, aside: float) -> NDArray[np.bool_]:
    """Cells from which light may come: Q is off it by asin(aside / |Q - C|) at most."""
    near, far = workspace.projector_radius_m
    slack = cube.radii + float(np.arcsin(min(1.0, aside / near))) + 1e-9
    along = np.arccos(np.clip(cube.centres @ np.array(workspace.axis), -1.0, 1.0))
    passed = along <= workspace.half_angle + slack
    if workspace.floor_m is not None:
        lowest = workspace.floor_m / (far if workspace.floor_m > 0 else near)
        above = np.arccos(np.clip(cube.centres @ np.array(workspace.up), -1.0, 1.0))
        passed &= above <= np.arccos(np.clip(lowest, -1.0, 1.0)) + slack
    return passed & may_stand(workspace, cube.centres, slack, near, far)
