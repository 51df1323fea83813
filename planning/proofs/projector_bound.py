"""The bound over all poses: how many projectors it takes, wherever they may stand.

Rows are the samples that the cover over candidates reaches, frozen as a set, and how
many of them must be lit. Cells hold every pose of the workspace, each with a superset
of what any of its poses lights; a cover over supersets can't need more. Where fewer
projectors than were found can't be refuted, the cells that are left say where to look.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel
from geometry.directions.cube_map import CubeMap
from geometry.directions.open_directions import DirectionLimits
from geometry.directions.widened_maps import WidenedMaps
from planning.model.planned import PlannedProjector
from planning.model.requirements import Workspace
from planning.proofs.cells.direction_cells import DirectionTree
from planning.proofs.cells.position_cells import PositionTree
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.scene.workspace.zone_limits import may_hold
from solvers.bit_rows import BitSum
from solvers.cells.cell_bound import CellBound, CellStatus, bound_count
from solvers.cells.cell_problem import CellProblem

from .all_poses import ContinuousBound
from .optimistic_coverage import mesh_reach, open_rows


@dataclass(frozen=True)
class Effort:
    """What is spent on the bound.

    Attributes:
        finest: Cells are parts of a cube map of 2^finest cells an edge.
        budget: Counted work of the search.
        shadows: Pairs of sample and face above which shadows are left out.
        most_samples: Samples of the target at most; None: all that the cover has.
        offers: Poses offered, beside cells that can't be refuted, where the bound
            leaves room for fewer projectors.
    """

    finest: int
    budget: float
    shadows: float
    most_samples: int | None = None
    offers: int = 0


DEFAULT = Effort(finest=6, budget=1.5e9, shadows=3e8, most_samples=2000)
PROVE = Effort(finest=7, budget=6e10, shadows=np.inf, offers=150)


def bound_projectors(
    scene: Scene,
    template: PlannedProjector,
    rows: Target,
    required: int,
    count: int,
    effort: Effort,
    *,
    n_samples: int,
    row_area_m2: float,
) -> ContinuousBound:
    """Bound the projectors over every pose of the workspace.

    Field of view, beam and rings are left out: the bound holds for any of them.

    Args:
        scene: Surface and requirements.
        template: A projector; its optics and light count, not its pose.
        rows: Samples that some candidate lights.
        required: How many of them must be lit.
        count: Projectors that are enough.
        effort: What to spend.
        n_samples: Samples of the target, reached or not, for the record.
        row_area_m2: Area that each stands for.
    """
    reach = mesh_reach(scene)
    if count <= 1:
        # What is required takes one, with shadows or without: no cell is looked at.
        effort = replace(effort, finest=0, shadows=0.0)
    shadows = bool(len(rows) * len(scene.mesh.faces) <= effort.shadows)
    cube, asked = CubeMap(1 << effort.finest), scene.requirements.projector
    limits = DirectionLimits(asked.max_incidence, asked.min_tangent_angle)
    workspace, device = scene.requirements.workspace, template.device
    near = workspace.projector_radius_m[0]
    tree: DirectionTree | PositionTree
    if isinstance(device, ParallelModel):
        # How far off a device's own axis what it lights may be.
        width = float(np.hypot(*device.half_panel))
        aside = reach + min(width, device.beam_radius or np.inf)
        depth = np.sqrt(max(0.0, near**2 - aside**2))
        shadows = shadows and bool(depth >= reach)
        opened = open_rows(scene, limits, rows, cube, shadows=shadows)
        opened[~_within(cube, workspace, aside)] = 0
        tree = DirectionTree.over(opened, len(rows))
    else:
        shadows = shadows and bool(near >= reach)
        opened = open_rows(scene, limits, rows, cube, shadows=shadows)
        tree = PositionTree(
            workspace,
            workspace.projector_radius_m,
            device.range_m,
            rows.samples.points,
            WidenedMaps(opened, cube),
            finest=effort.finest,
        )
    problem = CellProblem(np.ones(len(rows)), np.array([float(required)]))
    found = bound_count(problem, tree, count, budget=effort.budget)
    open_question = found.status in (CellStatus.SURVIVED, CellStatus.CUT)
    left = np.empty((0, 3))
    if open_question:
        left = _promising(found, tree, effort.offers)
    told = shadows or count <= 1
    return ContinuousBound(found, told, left, n_samples, row_area_m2)


def _promising(
    found: CellBound, tree: DirectionTree | PositionTree, n: int
) -> NDArray[np.float64]:
    """Return the directions of cells that weren't refuted, and of n more.

    In these a projector would save most, by the multipliers.
    """
    names, rows = tree.spread_cells()
    prices = BitSum(found.multipliers)(rows)
    dear = names[np.argsort(-prices, kind="stable")[:n]]
    if found.survivor is not None:
        dear = np.concatenate([np.unique(found.survivor), dear])
    return tree.directions(dear) if dear.size else np.empty((0, 3))


def _within(cube: CubeMap, workspace: Workspace, aside: float) -> NDArray[np.bool_]:
    """Return the cells from which parallel light may come at all, shape (size,).

    A device at Q is off the direction u of its light, as the centre C sees it, by
    asin(aside / |Q - C|) at most.
    """
    near, far = workspace.projector_radius_m
    slack = cube.radii + float(np.arcsin(min(1.0, aside / near))) + 1e-9
    along = np.arccos(np.clip(cube.centres @ np.array(workspace.axis), -1.0, 1.0))
    kept = along <= workspace.half_angle + slack
    if workspace.floor_m is not None:
        lowest = workspace.floor_m / (far if workspace.floor_m > 0 else near)
        above = np.arccos(np.clip(cube.centres @ np.array(workspace.up), -1.0, 1.0))
        kept &= above <= np.arccos(np.clip(lowest, -1.0, 1.0)) + slack
    return kept & may_hold(workspace, cube.centres, slack, near, far)
